"""The rotation visualizer: one rotation on three nested rings, and the same in every way one writes it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.picture import Picture
from camviz.draw.readout import decimal, vector
from camviz.draw.space import Dots, Item, Label, Line, OrbitCamera, axes_triad, camera_body, space_panel
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.views.base import OrbitView, slider
from camviz.views.marks import circle

_RINGS = (  # name and colour of the turn, radius of its ring, and the axis at right angles to the ring's plane
    ("yaw", "green", 1.0, 2),
    ("pitch", "orange", 0.84, 1),
    ("roll", "blue", 0.68, 0),
)
_LAYOUTS = {
    "rings numbers": rows((466, {"rings": 620, "numbers": 340})),
    "rings": rows((340, {"rings": 480})),
}
_STAND = 1.2  # where the outer ring's pins are held
_BODY = Intrinsics.from_fov(640, 480, 60)


@dataclass(frozen=True)
class RotationView(OrbitView):
    """A camera held by three rings, each turning inside the one before: yaw about y, pitch about x, roll about z.

    The outer ring turns about the world's vertical and carries the axis of pitch, the middle one carries the axis of
    roll, the inner one holds the camera. At pitch ±90° the axes of yaw and roll fall into one line: gimbal lock.
    `panels` are the rings, alone or with the numbers beside them.
    """

    title: ClassVar[str] = "One rotation, written in every way"
    layouts: ClassVar[Iterable[str]] = tuple(_LAYOUTS)
    openable: ClassVar[Mapping[str, str]] = {"numbers": "the same in every way"}

    yaw_deg: float = slider(30.0, -180, 180, 1.0, label="yaw", unit="°", help="of the outer ring, to the right")
    pitch_deg: float = slider(20.0, -90, 90, 1.0, label="pitch", unit="°", help="of the middle ring, up")
    roll_deg: float = slider(10.0, -180, 180, 1.0, label="roll", unit="°", help="of the inner ring, clockwise")
    panels: str = "rings numbers"
    eye: OrbitCamera = OrbitCamera(distance=4.3, yaw_deg=-35, pitch_deg=22)

    # The numbers -----------------------------------------------------------------------------------------------------

    @cached_property
    def rotation(self) -> Rotation:
        """world_from_cam, R_y(yaw) R_x(pitch) R_z(roll)."""
        return Rotation.from_euler("YXZ", [self.yaw_deg, self.pitch_deg, self.roll_deg], degrees=True)

    @cached_property
    def rings(self) -> tuple[Rotation, Rotation, Rotation]:
        """world_from_ring of the outer, the middle and the inner ring."""
        outer = Rotation.from_euler("Y", self.yaw_deg, degrees=True)
        return outer, outer * Rotation.from_euler("X", self.pitch_deg, degrees=True), self.rotation

    @cached_property
    def axes(self) -> Array:
        """The unit axes (3, 3) in the world about which yaw, pitch and roll turn, one per row."""
        outer, middle, _ = self.rings
        return np.stack([[0.0, 1.0, 0.0], outer.as_matrix()[:, 0], middle.as_matrix()[:, 2]])

    def numbers(self) -> dict[str, Array]:
        """R (3, 3) of the extrinsics; rotation vector, its length and quaternion (scalar last) of world_from_cam.

        "lock_deg" is the angle in degrees between the lines of the first and the last axis: 90 is best, 0 is lock.
        """
        first, _, last = self.axes
        return {
            "R": self.rotation.inv().as_matrix(),
            "rotation_vector": self.rotation.as_rotvec(),
            "quaternion": self.rotation.as_quat(canonical=True),
            "angle_deg": np.degrees(self.rotation.magnitude()),
            "lock_deg": np.degrees(np.arctan2(np.linalg.norm(np.cross(first, last)), abs(first @ last))),
        }

    @property
    def locked(self) -> bool:
        """True where yaw and roll turn about the same line."""
        return bool(self.numbers()["lock_deg"] < 0.5)

    def description(self) -> str:
        n = self.numbers()
        state = "They lie in one line: gimbal lock." if self.locked else "The three turns are independent."
        return (
            f"Yaw {decimal(self.yaw_deg, 0)}°, pitch {decimal(self.pitch_deg, 0)}°, roll {decimal(self.roll_deg, 0)}°; "
            f"rotation vector {_row(n['rotation_vector'])}, an angle of {n['angle_deg']:.1f}°; quaternion (x, y, z, w) "
            f"{_row(n['quaternion'])}. The axes of yaw and roll are {n['lock_deg']:.0f}° apart. {state}"
        )

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        layout = _LAYOUTS[self.panels]
        x, y, across, high = layout["rings"]
        panel = space_panel("rings", x + 10, y + 34, across - 20, high - 44)
        label = "The rings in space; drag or press the arrow keys to walk around them, plus and minus to go nearer"
        over = svg.text((14, 24), "gimbal lock: one line for both", "label halo red") if self.locked else svg.NOTHING
        space, attached = self.in_space(panel, self._items(), draft, "Three rings hold a camera", label, over=over)
        beside = {"numbers": self._numbers_panel()} if self._has("numbers") else {}
        return self.tiled(layout, {"rings": space} | beside, attached)

    def _items(self) -> list[Item]:
        camera = Camera(_BODY, world_from_cam=RigidTransform.from_rotation(self.rotation))
        items = [*camera_body(camera, 0.34, colour="purple"), *axes_triad(camera.world_from_cam, 0.5)]
        outside = _STAND
        for (name, colour, radius, across), ring, axis in zip(_RINGS, self.rings, self.axes, strict=True):
            items.append(Line(_ring(ring, radius, across), colour, 3))
            pins = np.array([[radius], [outside], [np.nan], [-outside], [-radius]]) * axis
            items += [Line(pins, colour, 5), Dots(pins[[1, 3]], colour, 8)]
            items.append(Label(outside * axis, name, f"label {colour}"))
            outside = radius
        return items

    def _numbers_panel(self) -> svg.Marks:
        n = self.numbers()
        apart = f"{n['lock_deg']:.0f}°" + (", gimbal lock" if self.locked else "")
        rows = [
            ("Euler angles: yaw, pitch, roll [°]", _row([self.yaw_deg, self.pitch_deg, self.roll_deg], 1)),
            ("between the axes of yaw and roll", apart),
            ("rotation vector, axis · angle [rad]", _row(n["rotation_vector"])),
            ("its length, the one turn’s angle", f"{n['angle_deg']:.2f}°"),
            ("quaternion (x, y, z, w)", _row(n["quaternion"])),
            ("R, its rows the camera’s axes", _row(n["R"][0])),
            ("", _row(n["R"][1])),
            ("", _row(n["R"][2])),
        ]
        y, words = 54.0, svg.NOTHING
        for name, value in rows:
            words += svg.text((634, y), name, "note")
            y += 21 if name else 0
            words += svg.text((634, y), value, "number red" if "lock" in value else "number")
            y += 35 if name and value is not rows[-3][1] else 21
        return svg.text((634, 26), "The same in every way", "title") + words


def _ring(world_from_ring: Rotation, radius: float, across: int) -> Array:
    """A circle (65, 3) in the plane at right angles to the ring's axis number `across`."""
    return world_from_ring.apply(np.insert(radius * circle(65), across, 0, axis=-1))


def _row(values: ArrayLike, decimals: int = 3) -> str:
    return vector(values, decimals, width=decimals + 3)
