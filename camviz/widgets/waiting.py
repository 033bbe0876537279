"""Views that wait for a reader's function: they are told that it still runs, and given it when it is written anew."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol
from weakref import WeakSet

from IPython import get_ipython
from ipywidgets.widgets.widget import _instances


class Waiting(Protocol):
    """A view that a reader's function draws."""

    def take(self, function: Callable[..., Any]) -> bool:
        """Draw with the function in the place of one of the same name; whether that changes anything."""


_waiting: WeakSet[Waiting] = WeakSet()


def wait(view: Waiting) -> None:
    """Have a view take part in `hand_out` for as long as it lives."""
    _waiting.add(view)


def hand_out(function: Callable[..., Any]) -> int:
    """Give a function to every view that was made with an older one of its name; how many are drawn anew.

    A view in whose place a function cannot be drawn with keeps what it shows: its own controls say why.
    """
    drawn = 0
    for view in list(_waiting):
        try:
            drawn += view.take(function)
        except ValueError:  # the state that the reader left it in is none that can be drawn with this function
            continue
    return drawn


def told_in_its_view(words: str) -> bool:
    """Show the words above the picture that the kernel is drawing for a view's control; False where a cell is run."""
    kernel = getattr(get_ipython(), "kernel", None)
    message = kernel.get_parent() if kernel else {}
    if message.get("header", {}).get("msg_type") != "comm_msg":
        return False
    view = _instances.get(message["content"]["comm_id"])
    if view is None or not view.has_trait("frame"):
        return False
    view.set_trait("frame", {**view.frame, "error": f"Your function is {words}."})
    return True
