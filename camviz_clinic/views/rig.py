"""The cameras of a calibration in space, each with its axes, and the boards that they saw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera
from camviz.draw.flow import Sentences, rows
from camviz.draw.items import Item, Label, Line
from camviz.draw.picture import Picture
from camviz.draw.space import OrbitCamera, axes_triad, camera_body, space_panel
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views.base import OrbitView, choice
from camviz_clinic.calibration.types import Board
from camviz_clinic.views.board_poses import BoardPosesView
from camviz_clinic.views.observations import Missing

_BODIES = 12  # cameras up to which each has its frustum and axes; more of them are pyramids
_BOARDS = 60
_TOLD = 4  # cameras up to which each one's place is told
_LAYOUT = rows((470, {"cameras": 960}), (62, {"in words": 960}))


@dataclass(frozen=True)
class RigView(OrbitView):
    """The cameras as the file places them, with frusta that bend with the lens, axes x right, y down, z forward.

    Read the other way round (`reading`), each transform is taken for its inverse: the one that makes sense is right.
    """

    title: ClassVar[str] = "The cameras in space"

    cameras: Mapping[str, Camera] = field(compare=False, repr=False)
    board: Board | None = None
    world_from_board: RigidTransform | None = field(default=None, compare=False, repr=False)
    reading: str = choice(
        "as written", "inverted", "both", help="the transforms as the file has them, or each inverted"
    )
    eye: OrbitCamera = OrbitCamera(yaw_deg=-40, pitch_deg=25)

    @classmethod
    def of(cls, calibration: Any) -> RigView:
        """The cameras of a calibration, and its boards. Raises Missing where it does not place two cameras apart."""
        centres = np.stack([camera.centre for camera in calibration.cameras.values()])
        if len(centres) < 2:
            raise Missing("The file holds one camera and no board poses, so there is nothing to place in space.")
        if not np.linalg.norm(np.ptp(centres, axis=0)) > 0:
            raise Missing("The file does not say how one camera stands to the other.")
        name = next((name for name in calibration.cameras if name in calibration.cam_from_board), None)
        if name is None:
            return cls(calibration.cameras)
        boards = calibration.cameras[name].world_from_cam * calibration.cam_from_board[name]
        if name in calibration.detections:
            corners = calibration.detections[name]
            same = [each for each in calibration.detections.values() if each.shape == corners.shape]
            boards = boards[np.any([np.isfinite(each).any(axis=(1, 2)) for each in same], axis=0)]
        return cls(calibration.cameras, calibration.board, boards)

    @cached_property
    def readings(self) -> dict[str, dict[str, Camera]]:
        """The cameras by what they are called, for every reading that is shown; the first camera stays where it is."""
        first = next(iter(self.cameras.values())).world_from_cam
        written = dict(self.cameras)
        inverted = {
            name: camera.at(first * (first.inv() * camera.world_from_cam).inv()) for name, camera in written.items()
        }
        return {"as written": {"as written": written}, "inverted": {"inverted": inverted}}.get(
            self.reading, {"as written": written, "inverted": inverted}
        )

    def description(self) -> str:
        names = list(self.cameras)
        told = [f"{len(names)} cameras, transforms {self.reading}."]
        first = self.cameras[names[0]]
        for name in names[1:] if len(names) <= _TOLD else ():
            x, y, z = first.world_from_cam.inv().apply(self.cameras[name].centre)
            turn = np.degrees((first.world_from_cam.inv() * self.cameras[name].world_from_cam).rotation.magnitude())
            sides = (_side(x, "to its right", "to its left"), _side(y, "below", "above"), _side(z, "before", "behind"))
            told.append(
                f"{name} stands {np.linalg.norm((x, y, z)):.4g} m from {names[0]}, {', '.join(sides)}, turned by "
                f"{turn:.1f}°."
            )
        if self._boards is not None:
            told.append(f"{len(self._boards)} boards.")
        return " ".join(told)

    @property
    def _boards(self) -> RigidTransform | None:
        poses = self.world_from_board
        return poses if poses is not None and self.board is not None and not poses.single else None

    def figure(self, *, draft: bool = False) -> Picture:
        panel = space_panel("rig", 20, 34, 920, 430)
        label = "The cameras in space; drag or press the arrow keys to walk around them, plus and minus to go nearer"
        note = {"both": "blue: as written; orange: inverted"}.get(self.reading, self.reading)
        seen: dict[str, Any] = {"eye": self._onlooker, "note": note, "hint": ""}
        space, attached = self.in_space(panel, self._items(), draft, "The cameras in space", label, **seen)
        return self.tiled(_LAYOUT, {"cameras": space, "in words": Sentences(self.description())}, attached)

    @cached_property
    def _places(self) -> Array:
        """Everything there is (n, 3): the cameras' centres and the boards' origins."""
        centres = [camera.centre for cameras in self.readings.values() for camera in cameras.values()]
        boards = [] if self._boards is None else list(np.atleast_2d(self._boards.translation)[:_BOARDS])
        return np.stack(centres + boards)

    @cached_property
    def _size(self) -> float:
        """How deep the cameras are drawn, in metres: a third of the smallest step between them, or a few squares."""
        centres = np.stack([camera.centre for camera in self.cameras.values()])
        steps = np.linalg.norm(np.diff(centres, axis=0), axis=-1)
        steps = steps[steps > 0]
        reach = float(np.linalg.norm(np.ptp(self._places, axis=0)))
        return float(np.clip(0.5 * np.median(steps) if steps.size else reach, 0.03 * reach, 0.3 * reach))

    @property
    def _onlooker(self) -> OrbitCamera:
        places = self._places
        middle = (places.min(axis=0) + places.max(axis=0)) / 2
        reach = max(float(np.linalg.norm(np.ptp(places, axis=0))), 1e-6)
        return self.from_afar(middle, 1.25 * (reach + self._size))

    def _items(self) -> list[Item]:
        items: list[Item] = []
        for reading, cameras in self.readings.items():
            colour = "orange" if reading == "inverted" else "blue"
            if len(cameras) <= _BODIES:
                for name, camera in cameras.items():
                    items += camera_body(camera, self._size, colour=colour, name=name)
                    items += axes_triad(camera.world_from_cam, 0.8 * self._size)
            else:
                items += [Line(_pyramid(camera, self._size), colour, 1.1) for camera in cameras.values()]
                path = np.stack([camera.centre for camera in cameras.values()])
                items += [Line(path, "muted", 1.0), Label(path[0], "first", "note"), Label(path[-1], "last", "note")]
        if self._boards is not None and self.board is not None:
            first = next(iter(self.cameras.values()))
            drawn = BoardPosesView(first, self._boards, self.board)
            for pose in self._boards[:_BOARDS]:
                items += drawn.board_items(pose, False)
        return items


def _pyramid(camera: Camera, depth: float) -> Array:
    """A line through a camera's centre and the rim of what it sees."""
    a, b, c, d = camera.frustum(0, depth, 1)[1]
    o = camera.centre
    return np.array([o, a, b, o, c, d, o, b, c, d, a])


def _side(value: float, positive: str, negative: str) -> str:
    return f"{1000 * abs(value):.3g} mm {positive if value >= 0 else negative}"
