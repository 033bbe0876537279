"""The error of every view as the file tells it, where the file does not hold the corners themselves."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from camviz.draw import plot
from camviz.draw.flow import Sentences, rows
from camviz.draw.picture import Picture
from camviz.lenses.base import Array
from camviz.views.base import View
from camviz.views.view_bars import bars_of, ceiling, figures_on, names_below
from camviz_clinic.views.observations import Missing

_LAYOUT = rows((200, {"errors": 960}), (50, {"in words": 960}))


@dataclass(frozen=True)
class ErrorsView(View):
    """A bar for the RMS (views,) in pixels of every view; where in its picture it is, only corners could tell."""

    title: ClassVar[str] = "Error of every view"

    errors: Array = field(compare=False, repr=False)
    name: str = "camera"

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> ErrorsView:
        """The errors of a calibration's camera. Raises Missing where the file does not hold them."""
        name = camera or next(iter(calibration.cameras))
        errors = np.asarray(calibration.per_view_errors.get(name, ()), dtype=float)
        if not np.isfinite(errors).any():
            raise Missing(f"The file holds neither the corners that {name} saw nor the error of its views.")
        return cls(errors, name)

    def description(self) -> str:
        worst = int(np.nanargmax(self.errors))
        return (
            f"{len(self.errors)} views of {self.name}: view {worst + 1} has the largest error, "
            f"{self.errors[worst]:.3g} px; the median is {np.nanmedian(self.errors):.3g} px. The file does not hold "
            "the corners, so where in the picture the error is cannot be shown."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        errors, median = self.errors, float(np.nanmedian(self.errors))
        limits = (0.5, len(errors) + 0.5), (0.0, ceiling(errors))
        panel = plot.plot_panel("bars", 70, 34, 870, 140, *limits)
        content = plot.grid(panel, xticks=[]) + bars_of(panel, errors)
        content += plot.level(panel, median, "ink dashed") + figures_on(panel, errors)
        ticks = names_below([f"{i + 1}" for i in range(len(errors))])
        shown = panel.show(
            content, title=f"RMS error of every view, {self.name}", note=f"dashed: median, {median:.3g} px"
        )
        body = shown + plot.axes(panel, "", "RMS [px]", xticks=ticks)
        return self.tiled(_LAYOUT, {"errors": body, "in words": Sentences(self.description())})
