"""An inspection in a notebook: its findings in words, and every view of the clinic to choose from, live."""

from __future__ import annotations

import os
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from IPython.display import display
from ipywidgets import Dropdown, HBox, Layout, VBox

from camviz.views.base import View
from camviz.views.distortion import DistortionView
from camviz.widgets.explorer import Explorer, explore
from camviz.widgets.still import display_kept
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.report.findings import findings_html, verdict_html
from camviz_clinic.views.catalogue import ALIASES, VIEWS, Case

LOOK, CAMERA = "look at", "of camera"  # what the two choosers are called, and no control of any view
_LARGEST = 800  # pixels, of the longer side of a photograph
_OF_DISTORTION = ("show", "hide_fold")  # the sliders would make it another lens


class ShownInspection(Inspection):
    """An inspection that a notebook shows with every view of the clinic."""

    def explore(self, images: str | PathLike[str] | None = None) -> LiveInspection:
        """The findings with every view of the clinic; `images` is the folder of the pictures."""
        return LiveInspection(self, images)

    def _ipython_display_(self) -> None:
        self.explore()._ipython_display_()


def inspect(
    calibration: Calibration,
    *,
    compare: Calibration | None = None,
    pictures: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
) -> ShownInspection:
    """What is wrong with a calibration, and what to do: `camviz_clinic.checks.inspect` for a notebook.

    Args:
        calibration: What to look at.
        compare: Another calibration of the same cameras.
        pictures: Sizes (width, height) in pixels of pictures, by their names, that the calibration is meant for.
        board: The board as it was measured, where that is known.

    Returns: An Inspection that a notebook shows with every view of the clinic.

    >>> from pathlib import Path
    >>> from camviz.cameras import Camera, Intrinsics
    >>> camera = Camera(Intrinsics.from_fov(640, 480, 60))
    >>> inspect(Calibration({"camera": camera}, Path(), "a data sheet")).healthy
    True
    """
    return ShownInspection.of(Evidence(calibration, compare, pictures or {}, board))


class LiveInspection:
    """The findings and, below them, one view under the reader's hands; which one, and of which camera, is chosen above.

    `explorer` is the view that is shown now; `show` chooses another one from code.
    """

    def __init__(self, inspection: Inspection, images: str | PathLike[str] | None = None) -> None:
        self.inspection = inspection
        self.explorer: Explorer | None = None
        self.widget: VBox | None = None
        if inspection.calibration is None:
            return
        folder = None if images is None else Path(images)
        self.case = Case.of(inspection, folder, _LARGEST)
        wide, narrow = Layout(width="min(28em, 55vw)"), Layout(width="min(300px, 55vw)")  # of a telephone
        self._view = Dropdown(options=self._options(), value=self._first(), description=LOOK, layout=wide)
        camera = self._camera_of(self._view.value)
        self._camera = Dropdown(options=self.case.names, value=camera, description=CAMERA, layout=narrow)
        several = len(self.case.names) > 1
        choosers = [self._view, self._camera] if several else [self._view]
        self._above = HBox(choosers, layout=Layout(flex_flow="row wrap"))
        self._still_hidden = ""
        self._changed()
        self._view.observe(self._changed, "value")
        self._camera.observe(self._changed, "value")

    def show(self, name: str, camera: str = "") -> LiveInspection:
        """Show the view of that name, of a camera; ValueError naming those there are for any other."""
        name = ALIASES.get(name, name)
        if name not in VIEWS:
            raise ValueError(f"name must be one of {', '.join(VIEWS)}, got {name!r}")
        if self.inspection.calibration is None:
            raise ValueError("the file could not be read, so there is nothing to show of it")
        if camera and camera not in self.case.names:
            raise ValueError(f"camera must be one of {', '.join(self.case.names)}, got {camera!r}")
        self._camera.value = camera or self._camera.value
        self._view.value = name
        return self

    @property
    def view(self) -> View | None:
        """The view that is shown now."""
        return self.explorer.view if self.explorer else None

    def _options(self) -> list[tuple[str, str]]:
        """The views by their titles, those that show a finding marked."""
        told = {ALIASES.get(finding.view, finding.view) for finding in self.inspection.findings}
        return [(f"{'⚠ ' if name in told else ''}{entry.title}", name) for name, entry in VIEWS.items()]

    def _first(self) -> str:
        """The view of the worst finding; the residuals where nothing was found."""
        first = next((finding.view for finding in self.inspection.findings), "residual-vectors")
        return ALIASES.get(first, first)

    def _camera_of(self, name: str) -> str:
        findings = (f.camera for f in self.inspection.findings if ALIASES.get(f.view, f.view) == name)
        camera = next(findings, None)
        return camera if camera in self.case.names else self.case.names[0]

    def _changed(self, _change: Any = None) -> None:
        view = VIEWS[self._view.value].view(self.case, self._camera.value)
        explorer = explore(view, *(_OF_DISTORTION if isinstance(view, DistortionView) else ()))
        # Whatever is shown later takes the place of the one saved picture.
        self._still_hidden = self._still_hidden or explorer.still_hidden
        explorer.still_hidden = self._still_hidden
        before, self.explorer = self.explorer, explorer
        if self.widget is None:
            self.still_id = explorer.model_id
            self.widget = VBox([self._above, explorer])
            return
        self.widget.children = (self._above, explorer)
        if before is not None:
            explorer.keep_instead_of(before)
            before.close()

    def _ipython_display_(self) -> None:
        html = verdict_html(self.inspection) + findings_html(self.inspection)
        self.display({"text/html": html, "text/plain": self.inspection.as_text()})

    def display(self, words: Mapping[str, str]) -> None:
        """Show words, given by their MIME types, then a still picture to be saved, then the live view."""
        display(words, raw=True)
        if self.explorer is None or self.widget is None:
            return
        if os.environ.get("CAMVIZ_STATIC"):
            display(self.explorer)
            return
        display_kept(self._kept, self.explorer)
        display(self.widget._repr_mimebundle_(), raw=True)  # the still is shown already

    def _kept(self) -> dict[str, str]:
        """The still of the view that is shown now, marked by the widgets that hide it while they live."""
        still = self.explorer.still() if self.explorer else {"text/html": "", "text/plain": ""}
        return {**still, "text/html": f'<div data-camviz-still="{self.still_id}">{still["text/html"]}</div>'}
