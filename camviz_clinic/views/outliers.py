"""The corners that fit worst, each as the picture has it."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.draw import svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.panel import Panel
from camviz.draw.picture import Picture, jpeg
from camviz.views.base import Drawn, slider
from camviz.views.marks import arrows, crop, cross
from camviz_clinic.views.observations import Observations, ObservedView

_COUNT, _COLUMNS = 12, 6
_LAYOUT = rows(
    *((212, {f"corner {first + i + 1}": 160.0 for i in range(_COLUMNS)}) for first in range(0, _COUNT, _COLUMNS)),
    (34, {"in words": 960}),
)


@dataclass(frozen=True)
class OutliersView(ObservedView):
    """The twelve corners that are farthest from their projection, used or set aside, enlarged out of their pictures."""

    title: ClassVar[str] = "The worst corners"

    observations: Observations = field(compare=False, repr=False)
    patch: float = slider(24.0, 8, 96, 4, label="window", unit="px", help="how much of the picture each detail shows")

    @cached_property
    def worst(self) -> list[tuple[int, int]]:
        """The (view, corner) of the largest residuals, the largest first."""
        lengths = np.where(np.isfinite(self.observations.lengths), self.observations.lengths, -1)
        order = np.argsort(-lengths, axis=None)[:_COUNT]
        return [divmod(int(i), lengths.shape[1]) for i in order if lengths.flat[i] > 0]

    def description(self) -> str:
        seen = self.observations
        told = [
            f"{seen.picture(view)} row {corner // seen.board.columns + 1} column {corner % seen.board.columns + 1}: "
            f"{seen.lengths[view, corner]:.2f} px{', set aside' if seen.aside[view, corner] else ''}"
            for view, corner in self.worst
        ]
        typical = float(np.median(seen.lengths[seen.used])) if seen.used.any() else np.nan
        return (
            f"{seen.aside.sum()} corners are set aside. A typical residual is {typical:.2g} px. The largest: "
            f"{'; '.join(told)}."
        )

    def figure(self, *, draft: bool = False) -> Picture:
        parts, attached = dict[str, Part](), dict[str, bytes]()
        images: dict[int, Any] = {}
        for i, (view, corner) in enumerate(self.worst):
            if view not in images:
                images[view] = self.observations.photographs(view)
            x, y, _, _ = _LAYOUT[f"corner {i + 1}"]
            parts[f"corner {i + 1}"], crops = self._detail(i, view, corner, images[view], x + 11, y + 30)
            attached |= crops
        seen = self.observations
        words = (
            f"Green: detected; orange arrow: from the projection to it; red cross: set aside ({seen.aside.sum()} of "
            f"{(seen.used | seen.aside).sum()} corners)."
        )
        if not attached:
            words += " The pictures are not at hand, so the places are bare."
        return self.tiled(_LAYOUT, parts | {"in words": Sentences(words)}, attached)

    def _detail(self, i: int, view: int, corner: int, image: Any, x: float, y: float) -> Drawn:
        seen = self.observations
        middle = np.round(seen.detections[view, corner])
        half = self.patch / 2
        panel = Panel(
            f"corner {i + 1}", x, y, 138, 138, middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half
        )
        content, crops = svg.NOTHING, {}
        if image is not None:
            crops = {f"corner{i}": jpeg(crop(image, seen.camera.intrinsics, middle, self.patch))}
            content = svg.image(f"corner{i}", 0, 0, 138, 138)
        start, end = panel.place(seen.projected[view, corner]), panel.place(seen.detections[view, corner])
        content += arrows([start], [end], "orange thick", 8)
        content += (
            cross([end], "red")
            if seen.aside[view, corner]
            else svg.dots([end], "paper-dot", 7) + svg.dots([end], "green", 5)
        )
        row, column = divmod(corner, seen.board.columns)
        below = svg.text((x, y + 156), f"{seen.lengths[view, corner]:.2f} px", "note")
        below += svg.text((x, y + 174), f"row {row + 1}, col. {column + 1}", "note")
        return panel.show(content, title=seen.picture(view)[-14:]) + below, crops
