"""Where a reader is told that their function still runs while no cell does: in the view whose control they moved."""

from __future__ import annotations

from IPython import get_ipython
from ipywidgets.widgets.widget import _instances


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
