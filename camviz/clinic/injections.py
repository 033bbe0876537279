"""The fault lab's injections: a healthy virtual set-up, one fault put into it, solved again.

Every function takes a generator of random numbers and a strength, and gives a `Case`. The same generator makes the same
set-up whatever the strength, so that a slider moves the fault alone.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from camviz.calibration.adjustment import Adjustment
from camviz.calibration.types import Calibration
from camviz.cameras import Camera
from camviz.clinic.findings import Inspection, inspect, inspect_file
from camviz.clinic.rig import FLIPPED
from camviz.clinic.virtual import SetUp, pair, single, spread_boards
from camviz.distortion import ideal_image_radius, image_corner_radius
from camviz.files import kalibr, ros
from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation

Rng = np.random.Generator


@dataclass(frozen=True, eq=False)
class Case:
    """A calibration with a fault in it, or the text of a file that has one, and what goes with it."""

    calibration: Calibration | None = None
    compare: Calibration | None = None
    text: str = ""
    name: str = "camera.yaml"
    sizes: Mapping[str, tuple[int, int]] = field(default_factory=dict)

    def inspected(self) -> Inspection:
        """What the clinic says of it."""
        if self.calibration is not None:
            return inspect(self.calibration, compare=self.compare, pictures=self.sizes)
        with tempfile.TemporaryDirectory() as room:
            path = Path(room) / self.name
            path.write_text(self.text, encoding="utf-8")
            return inspect_file(path)


def alone(calibration: Calibration, camera: Camera) -> Calibration:
    """The numbers of one camera and nothing else, as most files have them."""
    return Calibration({"camera": camera}, Path("virtual"), calibration.format)


def changed(calibration: Calibration, **values: Any) -> Calibration:
    """A calibration with other numbers in the camera matrix of its first camera."""
    name, camera = next(iter(calibration.cameras.items()))
    other = replace(camera, intrinsics=replace(camera.intrinsics, **values))
    return replace(calibration, cameras={**calibration.cameras, name: other})


def healthy(rng: Rng) -> tuple[SetUp, Calibration]:
    set_up = single(rng)
    return set_up, set_up.solved(set_up.observed(rng))


def healthy_pair(rng: Rng) -> tuple[SetUp, Calibration]:
    set_up = pair(rng)
    return set_up, set_up.solved(set_up.observed(rng))


def _polynomial(camera: Camera) -> BrownConrady:
    assert isinstance(camera.lens, BrownConrady)
    return camera.lens


# The corners ---------------------------------------------------------------------------------------------------------


def with_corners(rng: Rng, strength: float, change: Callable[[Rng, Array, tuple[int, int], float], None]) -> Case:
    """One camera solved from corners that `change(rng, corners, (rows, columns), strength)` has damaged in place."""
    set_up = single(rng)
    observed = set_up.observed(rng)
    change(rng, observed[0], (set_up.board.rows, set_up.board.columns), strength)
    return Case(set_up.solved(observed))


def one_corner_off(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    angle = rng.uniform(0, 2 * np.pi)
    place = rng.integers(len(corners)), rng.integers(corners.shape[1])
    corners[place] += strength * np.array([np.cos(angle), np.sin(angle)])


def one_view_blurred(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    view = rng.integers(len(corners))
    corners[view] += rng.normal(0, strength, corners[view].shape)


def one_column_off(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """A column taken for a line beside it, so many squares away."""
    grid = corners[rng.integers(len(corners))].reshape(*shape, 2)
    column = rng.integers(shape[1])
    towards = column - 1 if column else 1
    grid[:, column] += strength * (grid[:, towards] - grid[:, column])


def rows_swapped(rng: Rng, corners: Array, shape: tuple[int, int], strength: float) -> None:
    """Two neighbouring rows exchanged, in so many views."""
    for view in rng.permutation(len(corners))[: round(strength)]:
        grid, row = corners[view].reshape(*shape, 2), rng.integers(shape[0] - 1)
        grid[[row, row + 1]] = grid[[row + 1, row]]


# The scene -----------------------------------------------------------------------------------------------------------


def parallel_boards(rng: Rng, strength: float) -> Case:
    """All boards tilted by no more than so many degrees."""
    set_up = single(rng, tilt_deg=(0, strength))
    return Case(set_up.solved(set_up.observed(rng)))


def boards_in_the_middle(rng: Rng, strength: float) -> Case:
    """All boards inside the middle of the image, of so much of its width and height."""
    set_up = single(rng)
    poses = spread_boards(rng, set_up.cameras, set_up.board, 15, (15, 40), strength)
    set_up = replace(set_up, cam_from_board=poses)
    return Case(set_up.solved(set_up.observed(rng)))


def warped_board(rng: Rng, strength: float) -> Case:
    """A board bent along its rows, by so many percent of its longer side."""
    set_up = single(rng)
    side = (max(set_up.board.columns, set_up.board.rows) - 1) * set_up.board.square_size
    set_up = replace(set_up, warp=(strength / 100 * side, 0.0))
    return Case(set_up.solved(set_up.observed(rng)))


def autofocus_drift(rng: Rng, strength: float) -> Case:
    """A focal length that grows by so many percent from the first view to the last."""
    set_up = single(rng)
    zoom = 1 + strength / 100 * np.linspace(-0.5, 0.5, len(set_up.cam_from_board))
    set_up = replace(set_up, zoom=zoom)
    return Case(set_up.solved(set_up.observed(rng)))


def rolling_shutter(rng: Rng, strength: float) -> Case:
    """A board that moves by so many pixels, sideways and turning, from the first row of the image to the last."""
    set_up = single(rng)
    corners = read_by_rows(rng, set_up, strength)
    return Case(set_up.solved((corners + rng.normal(0, set_up.noise, corners.shape),)))


def read_by_rows(rng: Rng, set_up: SetUp, strength: float) -> Array:
    """The corners (views, corners, 2) of such boards: each seen when its row is read, half a frame early or late."""
    camera, points = set_up.camera, set_up.board.corners
    corners: Array = set_up.corners[0].copy()
    for view, pose in enumerate(set_up.cam_from_board):
        depth = pose.apply(points)[:, 2].mean()
        drift, spin = rng.normal(size=3) * [1, 1, 0.3], rng.normal(size=3)
        drift *= strength * depth / camera.intrinsics.fx / np.linalg.norm(drift)
        spin *= strength / camera.intrinsics.fx / np.linalg.norm(spin) * 2
        for _ in range(3):
            late = corners[view, :, 1] / camera.intrinsics.height - 0.5
            there = Rotation.from_rotvec(late[:, None] * spin).apply(pose.apply(points) - pose.translation)
            corners[view] = camera.project(there + pose.translation + late[:, None] * drift)
    return corners


def richer_lens(rng: Rng, strength: float) -> Case:
    """A lens whose r⁵ term moves the image's corner by so many pixels, solved with k1 alone."""
    set_up = single(rng)
    camera, grid = set_up.camera, set_up.camera.intrinsics
    k2 = strength / (grid.fx * image_corner_radius(grid) ** 5)
    lens = BrownConrady(k1=0.05, k2=k2)
    set_up = replace(set_up, cameras=(replace(camera, lens=lens),))
    poses = spread_boards(rng, set_up.cameras, set_up.board, 15, (15, 40))
    set_up = replace(set_up, cam_from_board=poses)
    return Case(set_up.solved(set_up.observed(rng), fixed=("k2", "p1", "p2", "k3")))


# The numbers of one camera -------------------------------------------------------------------------------------------


def near_pole(rng: Rng, strength: float) -> Case:
    """A rational model that fits the corners, and whose denominator falls to so much at the farthest corner's ray.

    N = D (1 + k1 s + k2 s² + k3 s³) up to s³, with D = 1 + k4 s, and adjusted with that k4.
    """
    _, solved = healthy(rng)
    camera = solved.cameras["camera"]
    lens, k4 = _polynomial(camera), -(1 - strength) / ideal_image_radius(camera) ** 2
    k1, k2, k3 = lens.k1 + k4, lens.k2 + lens.k1 * k4, lens.k3 + lens.k2 * k4
    start = replace(camera, lens=replace(lens, k1=k1, k2=k2, k3=k3, k4=k4))
    best = replace(Adjustment.of(solved), cameras={"camera": start}).refined()
    return Case(replace(solved, cameras=best.cameras, cam_from_board={"camera": best.first_from_board}))


def fold(rng: Rng, strength: float) -> Case:
    """A k3 that makes the polynomial turn back at so much of the farthest corner's radius: g'(r) = 0 there."""
    _, solved = healthy(rng)
    camera = solved.cameras["camera"]
    lens = BrownConrady(k1=-0.2, k2=0.04)
    r = strength * ideal_image_radius(replace(camera, lens=lens))
    k3 = -(1 + 3 * lens.k1 * r**2 + 5 * lens.k2 * r**4) / (7 * r**6)
    return Case(alone(solved, replace(camera, lens=replace(lens, k3=k3))))


def strong_lens(rng: Rng, strength: float) -> Case:
    """A barrel lens of so much k1, seen 80° wide."""
    set_up = single(rng)
    grid = type(set_up.camera.intrinsics).from_fov(1280, 960, 80)
    lens = BrownConrady(k1=-strength, k2=0.5 * strength**2)
    return Case(Calibration({"camera": Camera(grid, lens)}, Path("virtual"), "OpenCV FileStorage"))


def absurd_centre(rng: Rng, strength: float) -> Case:
    """A principal point so many percent of the width away, and poses that make the best of it."""
    _, solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    shifted = changed(solved, cx=grid.cx + strength / 100 * grid.width)
    best = Adjustment.of(shifted).refined(only_poses=True)
    return Case(replace(shifted, cam_from_board={"camera": best.first_from_board}))


def resized_unevenly(rng: Rng, strength: float) -> Case:
    """fx and cx multiplied by so much, fy and cy not, and the width of the image as well."""
    _, solved = healthy(rng)
    camera = solved.cameras["camera"]
    grid = camera.intrinsics.resized(round(camera.intrinsics.width * strength), camera.intrinsics.height)
    return Case(alone(solved, replace(camera, intrinsics=grid)))


def resized(rng: Rng, strength: float) -> Case:
    """A camera matrix for pictures that are so many times as large."""
    _, solved = healthy(rng)
    camera, grid = solved.cameras["camera"], solved.cameras["camera"].intrinsics
    large = grid.resized(round(grid.width * strength), round(grid.height * strength))
    return Case(alone(solved, replace(camera, intrinsics=replace(large, width=grid.width, height=grid.height))))


def resized_pictures(rng: Rng, strength: float) -> Case:
    """Pictures so many times as large as those that were calibrated with."""
    _, solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    size = round(grid.width * strength), round(grid.height * strength)
    return Case(alone(solved, solved.cameras["camera"]), sizes={"picture.png": size})


def uncropped(rng: Rng, strength: float) -> Case:
    """A crop at the left by so many percent of the width, of which the camera matrix does not know."""
    _, solved = healthy(rng)
    camera, grid = solved.cameras["camera"], solved.cameras["camera"].intrinsics
    width = round(grid.width * (1 - strength / 100))
    return Case(alone(solved, replace(camera, intrinsics=replace(grid, width=width, cx=grid.cx))))


def zeroed(rng: Rng, strength: float) -> Case:
    """Distortion coefficients that were not kept; the corners were seen through so much of the lens."""
    set_up = single(rng)
    camera = replace(set_up.camera, lens=BrownConrady(k1=-0.2 * strength))
    set_up = replace(set_up, cameras=(camera,))
    set_up = replace(set_up, cam_from_board=spread_boards(rng, set_up.cameras, set_up.board, 15, (15, 40)))
    solved = set_up.solved(set_up.observed(rng))
    return Case(replace(solved, cameras={"camera": replace(solved.cameras["camera"], lens=BrownConrady())}))


def half_pixel(rng: Rng, strength: float) -> Case:
    """cx and cy larger by so much, as in programs whose first pixel is not at 0."""
    _, solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    return Case(changed(solved, cx=grid.cx + strength, cy=grid.cy + strength))


def half_pixel_against(rng: Rng, strength: float) -> Case:
    """The same without corners, beside the calibration as it was."""
    _, solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    shifted = changed(solved, cx=grid.cx + strength, cy=grid.cy + strength)
    return Case(alone(solved, shifted.cameras["camera"]), alone(solved, solved.cameras["camera"]))


# The text of a file --------------------------------------------------------------------------------------------------


def mislabelled(rng: Rng, strength: float) -> Case:
    """So many coefficients, 4, 5 or 8, under a name that has another number."""
    tree = yaml.safe_load(ros.write(healthy(rng)[1]))
    held = tree["distortion_coefficients"]
    held["data"] = [*held["data"], 1e-3, 1e-4, 1e-5][: round(strength)]
    held["cols"] = len(held["data"])
    tree["distortion_model"] = "rational_polynomial" if strength == 5 else "plumb_bob"
    return Case(text=yaml.safe_dump(tree))


def edited_rotation(rng: Rng, strength: float) -> Case:
    """An element of the rotation of a pair changed by so much."""
    _, solved = healthy_pair(rng)
    cameras = {
        name: replace(camera, lens=replace(_polynomial(camera), k3=0.0)) for name, camera in solved.cameras.items()
    }
    tree = yaml.safe_load(kalibr.write(replace(solved, cameras=cameras)))
    tree["cam1"]["T_cn_cnm1"][0][1] += strength
    return Case(text=yaml.safe_dump(tree))


def transposed(rng: Rng, strength: float) -> Case:
    """A camera matrix as MATLAB has it; or multiplied by a strength other than 1."""
    _, solved = healthy(rng)
    tree = yaml.safe_load(ros.write(solved))
    K = solved.cameras["camera"].intrinsics.K
    tree["camera_matrix"]["data"] = (K.T if strength == 1 else strength * K).ravel().tolist()
    return Case(text=yaml.safe_dump(tree))


# A pair --------------------------------------------------------------------------------------------------------------


def swapped(rng: Rng, strength: float) -> Case:
    """Left and right exchanged; half of the strengths without the corners."""
    _, solved = healthy_pair(rng)
    left, right = solved.cameras.values()
    exchanged = {"left": right, "right": left}
    return Case(Calibration(exchanged, Path("virtual"), "OpenCV FileStorage, stereo"))


def square_in_millimetres(rng: Rng, strength: float) -> Case:
    """A square's side taken for so many times what it is."""
    set_up = pair(rng)
    return Case(set_up.solved(set_up.observed(rng), square=strength))


def wrong_square(rng: Rng, strength: float) -> Case:
    """A square's side wrong by so many percent, beside a calibration with the right one."""
    set_up = pair(rng)
    good, bad = (set_up.solved(set_up.observed(rng), square=1 + off / 100) for off in (0, strength))
    return Case(bad, good)


def turned_away(rng: Rng, strength: float) -> Case:
    """A right camera turned by so many degrees from where it was, in the file alone."""
    _, solved = healthy_pair(rng)
    right = solved.cameras["right"]
    turn = RigidTransform.from_rotation(Rotation.from_rotvec([0, np.radians(strength), 0]))
    cameras = {**solved.cameras, "right": right.at(right.world_from_cam * turn)}
    return Case(Calibration(cameras, Path("virtual"), "OpenCV FileStorage, stereo"))


def _with_right(solved: Calibration, right_from_left: RigidTransform) -> Calibration:
    right = solved.cameras["right"].at(right_from_left.inv())
    return replace(solved, cameras={**solved.cameras, "right": right})


def inverted(rng: Rng, strength: float) -> Case:
    """left_from_right in the place of right_from_left, beside the corners (1) or beside another calibration (2)."""
    _, solved = healthy_pair(rng)
    wrong = _with_right(solved, solved.cameras["right"].world_from_cam)
    return Case(wrong) if strength == 1 else Case(replace(wrong, detections={}, cam_from_board={}), solved)


def in_opengl(rng: Rng, strength: float) -> Case:
    """OpenGL's axes: in the boards' poses of one camera (1), or in the transform of a pair (2)."""
    if strength == 1:
        _, solved = healthy(rng)
        poses = {"camera": FLIPPED * solved.cam_from_board["camera"]}
        return Case(replace(solved, detections={}, cam_from_board=poses))
    _, solved = healthy_pair(rng)
    right_from_left = solved.rig.a_from_b("right", "left")
    tilted = RigidTransform.from_rotation(Rotation.from_rotvec([0.1, 0, 0])) * right_from_left
    true, wrong = _with_right(solved, tilted), _with_right(solved, FLIPPED * tilted * FLIPPED)
    return Case(replace(wrong, detections={}, cam_from_board={}), true)


def other_order(rng: Rng, strength: float) -> Case:
    """The corners of the right camera counted backwards in so many views."""
    set_up = pair(rng)
    left, right = set_up.observed(rng)
    views = rng.permutation(len(right))[: round(strength)]
    right[views] = right[views, ::-1]
    return Case(set_up.solved((left, right)))
