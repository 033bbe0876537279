"""Views: each is a frozen state of one visualizer, with pure methods from that state to a picture."""

from camviz import _answering

__getattr__ = _answering("views")
