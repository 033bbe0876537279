"""A bare calibration as the last line of a notebook's cell: a small table and a still picture, or a few lines of text.

`camviz/__init__.py` tells IPython of it, for a calibration itself knows nothing of what is drawn.
"""

from __future__ import annotations

from camviz.calibration.types import Calibration
from camviz.clinic.summary import Summary
from camviz.report.findings import glance_html
from camviz.views.clinic.catalogue import VIEWS, Case
from camviz.views.clinic.missing import MissingView

_PICTURES = ("boards", "distortion")  # the first of them that the calibration has evidence for
_MORE = "camviz.inspect(calibration) says what is wrong with it."


def html(calibration: Calibration) -> str:
    """The table, and the cameras and boards in space; where there is but a lens, what that does."""
    case = Case(calibration)
    views = (VIEWS[name].view(case) for name in _PICTURES)
    view = next(view for view in views if not isinstance(view, MissingView))
    return f"{glance_html(Summary(case))}{view.figure().figure()}<p>{_MORE}</p>"


def text(calibration: Calibration) -> str:
    """The same in lines."""
    return "\n".join([*Summary.of(calibration).lines(), *calibration.notes, _MORE])
