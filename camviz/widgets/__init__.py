"""Widgets: what a reader touches. They hold no mathematics and no drawing."""

from camviz.widgets.explorer import Explorer, explore
from camviz.widgets.question import ask, quiz

__all__ = ["Explorer", "ask", "explore", "quiz"]
