"""One camera, one board, many pictures: where the camera stood before the board, or the board before the camera."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.marks import Marks
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import readout, vector
from camviz.draw.space import Dots, Item, Label, Line, OrbitCamera, axes_triad, camera_body, draw_space, space_panel
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views.base import Control, Drawn, OrbitView, choice, slider, without
from camviz.views.patience import Patience
from camviz.views.yours import is_unwritten, tried
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.views.chessboard import outline, rim, squares

_LAYOUT = rows((490, {"poses": 620, "picture": 340}))
_NINE_BY_SIX = Board(9, 6, 0.025)
_MOST_NUMBERED = 40  # boards that still leave room for each other's numbers


@dataclass(frozen=True)
class BoardPosesView(OrbitView):
    """The poses of a calibration's pictures in space, one of them picked out, and the board as that picture has it.

    `cam_from_board` holds one pose per picture. The board's frame has its origin at the first inner corner, x along the
    rows of corners, y along the columns and z away from the camera. `photographs`, uint8 RGB, are the pictures
    themselves where they are at hand; `hidden` are the indices of poses that are not drawn; `names` are what the
    others are called, their places from 1 on where none are given. `yours` is a reader's function of (R, t) that gives
    a centre (3,): where it has the camera in each picture is an orange dot, while the board stands still.
    """

    title: ClassVar[str] = "Camera and board"

    camera: Camera = field(compare=False)
    cam_from_board: RigidTransform = field(compare=False, repr=False)
    board: Board = _NINE_BY_SIX
    still: str = choice("board", "camera", label="what stands still", help="the board, or the camera")
    picture: int = slider(1, 1, 13, 1, label="picture", help="which of the pictures is picked out, in orange")
    photographs: Sequence[NDArray[np.uint8]] = field(default=(), compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(distance=0.9, yaw_deg=-50, pitch_deg=20)
    hidden: frozenset[int] = frozenset()
    names: tuple[str, ...] = ()
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.cam_from_board.single or not len(self.cam_from_board):
            raise ValueError(f"cam_from_board must hold one pose per picture, got {self.cam_from_board!r}")
        if self.photographs and len(self.photographs) != len(self.cam_from_board):
            got = len(self.photographs)
            raise ValueError(f"photographs must be as many as the {len(self.cam_from_board)} poses, got {got}")

    @classmethod
    def of(cls, calibration: Calibration, camera: str = "") -> BoardPosesView:
        """The boards of a calibration before its camera, the first unless named. Raises ValueError without poses."""
        name = camera or next(iter(calibration.cameras))
        if calibration.board is None or name not in calibration.cam_from_board:
            raise ValueError(f"The file does not hold where the board was in the views of {name}.")
        standing = calibration.cameras[name].at(RigidTransform.identity())
        poses = calibration.cam_from_board[name]
        unseen = frozenset[int]()  # a view of a rig may be another camera's alone
        if name in calibration.detections:
            unseen = frozenset(np.flatnonzero(~np.isfinite(calibration.detections[name]).any(axis=(1, 2))).tolist())
        view = cls(standing, poses, calibration.board, "camera", hidden=unseen)
        away = float(np.median(np.linalg.norm(poses.translation, axis=-1)))
        return view.but(eye=replace(view.eye, distance=2.2 * away))

    def offered(self) -> dict[str, Control]:
        controls = self.controls()
        return {**controls, "picture": replace(controls["picture"], high=len(self.cam_from_board))}

    # The numbers -----------------------------------------------------------------------------------------------------

    @property
    def index(self) -> int:
        """The place of the chosen picture in the list of poses."""
        return min(max(round(self.picture), 1), len(self.cam_from_board)) - 1

    @cached_property
    def centres(self) -> Array:
        """Where the camera stood in each picture, (n, 3) in the board's frame: C = -Rᵀ t."""
        return np.asarray(self.cam_from_board.inv().translation, dtype=np.float64)

    @cached_property
    def your_centres(self) -> tuple[Array, str]:
        """Where the reader's function has the camera, (n, 3), NaN where nowhere, and what is wrong with it.

        Where it is not written yet, it is where a right one would have it.
        """
        if self.yours is None:
            return np.full_like(self.centres, np.nan), ""
        R, t = self.cam_from_board.rotation.as_matrix(), self.cam_from_board.translation
        with Patience() as patience:
            each = [tried(self.yours, one, self.centres[0], patience) for one in zip(R, t, strict=True)]
        problem = next((words for _, words in each if words), "")
        return (self.centres if is_unwritten(problem) else np.stack([centre for centre, _ in each])), problem

    @property
    def chosen(self) -> RigidTransform:
        """cam_from_board of the chosen picture."""
        return self.cam_from_board[self.index]

    def pixels(self) -> Array:
        """Where the chosen picture has the corners, (rows * columns, 2), by pose, lens and camera matrix."""
        return self.camera.at(self.chosen.inv()).project(self.board.corners)

    def numbers(self) -> dict[str, float]:
        """The camera's distance from the board's middle in metres, and its axis against the board's normal in °."""
        cosine = self.chosen.rotation.as_matrix()[2, 2]
        distance = np.linalg.norm(self.centres[self.index] - self._middle)
        return {"distance": float(distance), "tilt_deg": float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))}

    def description(self) -> str:
        n, chosen = self.numbers(), self.chosen
        return (
            f"{len(self.cam_from_board)} pictures of one board; the {self.still} stands still. "
            f"Picture {self.index + 1}: t = {vector(chosen.translation, 3)} m, the camera stood at "
            f"C = {vector(self.centres[self.index], 3)} m in the board's frame, {n['distance']:.2f} m from its middle, "
            f"its axis {n['tilt_deg']:.0f}° from the board's normal."
        )

    @property
    def _middle(self) -> Array:
        return self.board.corners.mean(axis=0)

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        space, attached = self.space(space_panel("poses", 10, 34, 600, 446), draft)
        if self.photographs:
            attached = attached | {"photograph": jpeg(self.photographs[self.index])}
        return self.tiled(_LAYOUT, {"poses": space, "picture": self._image() + self._equation()}, attached)

    def space(self, panel: Panel, draft: bool) -> Drawn:
        """The panel with the poses in space, a handle called "eye", and the photographs it needs."""
        before_board = self.still == "board"
        target = (self._middle + self.centres.mean(0)) / 2 if before_board else transform(self.chosen, self._middle) / 2
        eye = replace(self.eye, target=tuple(target.tolist()))
        items = self._cameras() if before_board else self._boards()
        title = "Where the camera stood" if before_board else "Where the board was held"
        label = "The poses in space; drag or press the arrow keys to walk around them, plus and minus to go nearer"
        centres, problem = self.your_centres
        if self.yours is None or not before_board:
            return self.in_space(panel, items, draft, title, label, eye=eye)
        items.append(Dots(centres[np.isfinite(centres).all(axis=-1)], "orange", 16))
        if is_unwritten(problem):
            pale = [one for one in items if not isinstance(one, Label)]  # too pale for words
            content, attached = draw_space(panel, pale, eye, draft=draft, renderer="wire")
            return without(panel, problem, title, right=content), attached
        away = np.linalg.norm(centres - self.centres, axis=-1).max()
        words = svg.text((14, 24), f"orange dots: your centres, wrong by up to {away:.2f} m", "label halo orange")
        over = svg.paragraph((14, 24), problem, panel.width - 28) if problem else words
        return self.in_space(panel, items, draft, title, label, eye=eye, over=over)

    def _cameras(self) -> list[Item]:
        """The board, and every picture's camera around it."""
        still = RigidTransform.identity()
        items = [*self.board_items(still, True), *axes_triad(still, 3 * self.board.square_size)]
        for i, board_from_cam in enumerate(self.cam_from_board.inv()):
            if i in self.hidden:
                continue
            drawn = self._body if i == self.index else self._pyramid
            items += drawn(board_from_cam, self._name(i))
        return items

    def _boards(self) -> list[Item]:
        """The camera, and every picture's board before it."""
        still = RigidTransform.identity()
        items = [*self._body(still, "C"), *axes_triad(still, 2 * self.board.square_size)]
        for i, cam_from_board in enumerate(self.cam_from_board):
            if i in self.hidden:
                continue
            items += self.board_items(cam_from_board, i == self.index)
            if i == self.index or len(self.cam_from_board) <= _MOST_NUMBERED:
                where = transform(cam_from_board, outline(self.board)[0])
                items.append(Label(where, self._name(i), "label orange" if i == self.index else "note"))
        return items

    def _body(self, pose: RigidTransform, name: str) -> list[Item]:
        return camera_body(self.camera.at(pose), 2 * self.board.square_size, colour="orange", name=name)

    def _name(self, i: int) -> str:
        return self.names[i] if self.names else str(i + 1)

    def _pyramid(self, pose: RigidTransform, name: str) -> list[Item]:
        """A camera that is not picked out: its four corner rays and the square they end on."""
        a, b, c, d = transform(pose, self._corner_rays)
        centre = np.asarray(pose.translation)
        return [Line(np.array([centre, a, b, centre, c, d, centre, b, c, d, a]), "blue", 1.2),
                Label(centre, name, "label blue")]  # fmt: skip

    @cached_property
    def _corner_rays(self) -> Array:
        """The corners (4, 3) of a drawn camera's rim in its own frame."""
        return (
            2
            * self.board.square_size
            * self.camera.lens.unproject(self.camera.intrinsics.from_pixels(self.camera.intrinsics.border(1)))
        )

    def board_items(self, frame_from_board: RigidTransform, chosen: bool) -> list[Item]:
        """The board's rim, and if it is picked out its squares, standing in a frame."""
        corners = transform(frame_from_board, outline(self.board))
        edge = rim(corners, "orange" if chosen else "muted", 1.8 if chosen else 1)
        return [edge, squares(corners, self.board)] if chosen else [edge]

    def _image(self) -> Marks:
        k = self.camera.intrinsics
        panel = image_panel("picture", 630, 34, 310, k.width, k.height, tallest=230)
        content = placed_image(panel, "photograph", k.width, k.height) if self.photographs else self._drawn(panel)
        title = f"Picture {self.index + 1}, corners computed"
        return panel.show(content + svg.dots(panel.place(self.pixels()), "red", 5), title=title)

    def _drawn(self, panel: Panel) -> Marks:
        """The board's squares as lines, for want of a photograph."""
        grid = panel.place(self.pixels()).reshape(self.board.rows, self.board.columns, 2)
        return svg.path([*grid, *grid.swapaxes(0, 1)], "muted")

    def _equation(self) -> Marks:
        n, chosen = self.numbers(), self.chosen
        figures = [
            ("rotation vector, axis · angle [rad]", vector(chosen.rotation.as_rotvec(), 3)),
            ("t, the board before the camera [m]", vector(chosen.translation, 3)),
            ("C = −Rᵀt, in the board’s frame [m]", vector(self.centres[self.index], 3)),
            ("from the board’s middle", f"{n['distance']:.3f} m"),
            ("axis against the board’s normal", f"{n['tilt_deg']:.1f}°"),
        ]
        return readout(figures, (630, 294), (0, 43), (0, 18.5), "number")
