"""A small extension of the Jupyter server: what a kernel says goes to the browser at once, and opening changes nothing.

Left alone, the system holds a message back until the browser has acknowledged the one before (Nagle 1984, RFC 896), and
the browser's system waits up to 40 ms for something that could carry the acknowledgement (RFC 1122, 4.2.3.2). A kernel
says "busy" before every answer, so that a slider's picture is the message that waits.

JupyterLab writes the version of the kernel's Python into a notebook that it opens, and then calls the notebook unsaved.
So it is given the notebook with that version in it.
"""

from __future__ import annotations

import sys
from inspect import isawaitable
from typing import Any


def _jupyter_server_extension_points() -> list[dict[str, str]]:
    return [{"module": "camviz_school.server"}]


def _load_jupyter_server_extension(app: Any) -> None:
    """Let every connection between browser and kernel, of whatever class, be prompt, and notebooks name this Python."""
    app.web_app.settings["kernel_websocket_connection_class"] = prompt(app.kernel_websocket_connection_class)
    app.contents_manager.get = naming_this_python(app.contents_manager.get)


def prompt(connection_class: type) -> type:
    """The connection class, but without Nagle's delay."""

    class PromptConnection(connection_class):
        def connect(self) -> Any:
            self.websocket_handler.set_nodelay(True)
            return super().connect()

    return PromptConnection


def naming_this_python(get: Any) -> Any:
    """A contents manager's `get`; a notebook that tells its version of Python comes with the one that runs here."""

    def named(model: dict[str, Any]) -> dict[str, Any]:
        if model["type"] == "notebook" and model["content"]:
            language = model["content"]["metadata"].get("language_info", {})
            if language.get("name") == "python" and "version" in language:
                language["version"] = sys.version.split()[0]
        return model

    async def later(model: Any) -> dict[str, Any]:
        return named(await model)

    def get_named(*given: Any, **options: Any) -> Any:
        model = get(*given, **options)
        return later(model) if isawaitable(model) else named(model)

    return get_named
