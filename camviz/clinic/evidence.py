"""What there is to judge a calibration by: its numbers, the corners it was solved from, pictures, another one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from camviz.cameras import Camera
from camviz.files.calibration import Calibration
from camviz.lenses import Cylindrical, Equirectangular

PANORAMAS = (Cylindrical, Equirectangular)


@dataclass(frozen=True, eq=False)
class Evidence:
    """A calibration and what goes with it. `sizes` are (width, height) of pictures by their names."""

    calibration: Calibration
    compare: Calibration | None = None
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    @cached_property
    def cameras(self) -> dict[str, Camera]:
        """The cameras that differ in their pixels or their lens, by the first name that has them."""
        distinct: dict[object, str] = {}
        for name, camera in self.calibration.cameras.items():
            distinct.setdefault((camera.intrinsics, camera.lens), name)
        return {name: self.calibration.cameras[name] for name in distinct.values()}

    def counterparts(self) -> Iterator[tuple[str, Camera, Camera]]:
        """Name, camera, and the same camera in the other calibration: by name, else by order if both have as many."""
        if self.compare is None:
            return
        ours, others = self.calibration.cameras, self.compare.cameras
        if set(ours) & set(others):
            for name in self.cameras:
                if name in others:
                    yield name, ours[name], others[name]
        elif len(ours) == len(others):
            for (name, camera), other in zip(ours.items(), others.values(), strict=True):
                yield name, camera, other


def border_pixels(camera: Camera, samples: int = 16) -> np.ndarray:
    """The centres of pixels all along the border (n, 2)."""
    grid = camera.intrinsics
    return np.asarray(np.clip(grid.border(samples), [0, 0], [grid.width - 1, grid.height - 1]))
