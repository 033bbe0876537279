"""A small extension of the Jupyter server: what a kernel says goes to the browser at once.

Left alone, the system holds a message back until the browser has acknowledged the one before (Nagle 1984, RFC 896), and
the browser's system waits up to 40 ms for something that could carry the acknowledgement (RFC 1122, 4.2.3.2). A kernel
says "busy" before every answer, so that a slider's picture is the message that waits.
"""

from __future__ import annotations

from typing import Any


def _jupyter_server_extension_points() -> list[dict[str, str]]:
    return [{"module": "camviz.server"}]


def _load_jupyter_server_extension(app: Any) -> None:
    """Let every connection between a browser and a kernel, of whatever class the server uses, be prompt."""
    app.web_app.settings["kernel_websocket_connection_class"] = prompt(app.kernel_websocket_connection_class)


def prompt(connection_class: type) -> type:
    """The connection class, but without Nagle's delay."""

    class PromptConnection(connection_class):
        def connect(self) -> Any:
            self.websocket_handler.set_nodelay(True)
            return super().connect()

    return PromptConnection
