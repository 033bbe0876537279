"""A bare calibration as the last line of a notebook's cell: a small table and a still picture, or a few lines of text.

`camviz/__init__.py` tells IPython of it, for a calibration itself knows nothing of what is drawn.
"""

from __future__ import annotations

from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.summary import Summary
from camviz_clinic.report.findings import glance_html
from camviz_clinic.views.catalogue import VIEWS, Case
from camviz_clinic.views.missing import MissingView

_PICTURES = ("boards", "distortion")  # the first of them that the calibration has evidence for
_MORE = "camviz_clinic.inspect(calibration) says what is wrong with it."


def html(calibration: Calibration) -> str:
    """The table, and the cameras and boards in space; where there is but a lens, what that does."""
    case = Case(calibration)
    views = (VIEWS[name].view(case) for name in _PICTURES)
    view = next(view for view in views if not isinstance(view, MissingView))
    return f"{glance_html(Summary(case))}{view.figure().figure()}<p>{_MORE}</p>"


def text(calibration: Calibration) -> str:
    """The same in lines."""
    return "\n".join([*Summary.of(calibration).lines(), *calibration.notes, _MORE])
