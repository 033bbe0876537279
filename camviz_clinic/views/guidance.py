"""Where to hold the board next: the pose that would take most off the uncertainty, as a board to imitate."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import transform
from camviz.draw import svg
from camviz.draw.flow import Part, Sentences, rows
from camviz.draw.items import Face, Item, Line, closed
from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.space import OrbitCamera, axes_triad, camera_body, space_panel
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.views.base import Drawn, OrbitView, slider
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.boards import kind_of
from camviz_clinic.calibration.guidance import Candidate, instruction, next_board_poses
from camviz_clinic.calibration.types import Board
from camviz_clinic.views.board_poses import BoardPosesView
from camviz_clinic.views.chessboard import outline
from camviz_clinic.views.observations import Missing
from camviz_clinic.views.uncertainty import adjusted, determined

_OFFERED, _APART = 8, 0.35  # candidates shown, and how unlike each other: corner distance in widths of the picture
_SIDE = 16  # points along the edge of a square, so that it bends with the lens
_DETAILED = 300  # rectangles: a board of more is one of tags
_LAYOUT = rows((382, {"the board to imitate": 480, "its picture": 480}), (50, {"in words": 960}))


@dataclass(frozen=True)
class GuidanceView(OrbitView):
    """The boards of a calibration in space with a ghost among them, and the picture that the ghost would give.

    Candidate 1 lessens the mean uncertainty of projection most; the next ones are the best that look different.
    """

    title: ClassVar[str] = "Where to hold the board next"

    adjustment: Adjustment = field(compare=False, repr=False)
    candidates: tuple[Candidate, ...] = field(compare=False, repr=False)
    camera: str = "camera"
    choice: int = slider(1, 1, _OFFERED, 1, label="candidate", help="1 lessens the uncertainty most")
    backdrop: NDArray[np.uint8] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(yaw_deg=-50, pitch_deg=20)

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> GuidanceView:
        """The view of a calibration. Raises Missing where it does not hold what its solution was made from."""
        name = camera or next(iter(calibration.cameras))
        return cls.about(adjusted(calibration, name), name)

    @classmethod
    def about(cls, adjustment: Adjustment, camera: str = "") -> GuidanceView:
        """The view of an adjustment; the candidates are tried here."""
        name = camera or next(iter(adjustment.cameras))
        determined(adjustment)
        try:
            ranked = next_board_poses(adjustment, camera=name)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise Missing(f"No pose can be proposed: {error}.") from error
        return cls(adjustment, unlike(ranked, adjustment, name), name)

    @property
    def chosen(self) -> Candidate:
        """The candidate shown."""
        return self.candidates[min(max(round(self.choice), 1), len(self.candidates)) - 1]

    def sentences(self) -> list[str]:
        """What to do, in words."""
        c = self.chosen
        hold = instruction(self.adjustment, c, self.camera)
        gain = 100 * (1 - c.after / c.before)
        return [
            f"{hold[0].upper()}{hold[1:]}, as in the picture on the right.",
            f"One such view would lessen the mean uncertainty from {c.before:.3g} px to {c.after:.3g} px, by "
            f"{gain:.0f} %.",
        ]

    def description(self) -> str:
        return f"{self.camera}, candidate {round(self.choice)} of {len(self.candidates)}. {' '.join(self.sentences())}"

    def figure(self, *, draft: bool = False) -> Picture:
        space, attached = self._space(draft)
        shown, pictures = self._imitate()
        words = Sentences("\n".join(self.sentences()))
        parts: dict[str, Part] = {"the board to imitate": space, "its picture": shown, "in words": words}
        return self.tiled(_LAYOUT, parts, attached | pictures)

    @cached_property
    def _cam_from_board(self) -> RigidTransform:
        a = self.adjustment
        return a.cameras[self.camera].cam_from_world * a.first_from_board[a.posed]

    def _space(self, draft: bool) -> Drawn:
        a, standing = self.adjustment, self.adjustment.cameras[self.camera].at(RigidTransform.identity())
        boards = BoardPosesView(standing, self._cam_from_board, a.board, "camera")
        size = a.board.square_size
        items: list[Item] = [
            *camera_body(standing, 2 * size, colour="blue"),
            *axes_triad(RigidTransform.identity(), 2 * size),
        ]
        for pose in self._cam_from_board[: 60 if len(self._cam_from_board) > 60 else None]:
            items += boards.board_items(pose, False)
        ghost = transform(self.chosen.cam_from_board, outline(a.board))
        items += [Face(ghost, "orange", 0.25), Line(closed(ghost), "orange dashed", 2.2)]
        items += [Line(transform(self.chosen.cam_from_board, line), "orange", 1.0) for line in _lines(a.board)]
        middle = ghost.mean(axis=0)
        typical = float(np.median(np.linalg.norm(self._cam_from_board.translation, axis=-1)))
        farthest = max(float(np.linalg.norm(middle)), typical)
        eye = self.from_afar(middle / 2, 1.6 * farthest)
        panel = space_panel("guidance", 15, 34, 450, 340)
        label = "The boards in space; drag or press the arrow keys to walk around them"
        return self.in_space(panel, items, draft, "Imitate the orange board", label, eye=eye)

    def _imitate(self) -> Drawn:
        """The picture that the ghost would give, its squares bent as the lens bends them."""
        a, camera = self.adjustment, self.adjustment.cameras[self.camera].at(RigidTransform.identity())
        k, board = camera.intrinsics, a.board
        panel = image_panel("imitate", 495, 34, 450, k.width, k.height, tallest=340)
        content, attached = svg.NOTHING, {}
        if self.backdrop is not None:
            content = placed_image(panel, "backdrop", k.width, k.height, class_="faint")
            attached = {"backdrop": jpeg(self.backdrop)}
        along = np.linspace(0, 1, _SIDE, endpoint=False)[:, None]
        corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
        ring = np.concatenate([p + along * (q - p) for p, q in zip(corners, np.roll(corners, -1, 0), strict=True)])

        def projected(points: Array) -> Array:
            points = np.column_stack([points, np.zeros(len(points))])
            return panel.place(camera.project(transform(self.chosen.cam_from_board, points)))

        left, top, right, bottom = board.area
        whole = projected(ring * (right - left, bottom - top) + (left, top))
        content += svg.polygon(whole, "fill-orange", fill_opacity=0.18, stroke="none")
        dark = [projected(edge) for edge in _rings(board, ring)]
        content += svg.path([d for d in dark if np.isfinite(d).all()], "fill-orange", closed=True)
        content += svg.line(closed(whole), "orange thick")
        return panel.show(content, title="The picture it would give"), attached


def unlike(ranked: tuple[Candidate, ...], adjustment: Adjustment, name: str) -> tuple[Candidate, ...]:
    """The best candidates that differ from each other in the picture, the best first."""
    camera = adjustment.cameras[name].at(RigidTransform.identity())
    corners = adjustment.board.corners
    kept: list[Candidate] = []
    seen: list[Array] = []
    for candidate in ranked:
        uv = camera.project(transform(candidate.cam_from_board, corners)) / camera.intrinsics.width
        if all(np.linalg.norm(uv - other, axis=-1).max() > _APART for other in seen):
            kept.append(candidate)
            seen.append(uv)
        if len(kept) == _OFFERED:
            break
    return tuple(kept)


def _lines(board: Board) -> list[Array]:
    """The lines through a board's points from the first to the last of each row and column, in its own frame."""
    grid = board.corners.reshape(board.rows, board.columns, 3)
    return [*grid[:, [0, -1]], *grid[[0, -1]].swapaxes(0, 1)]


def _rings(board: Board, ring: Array) -> list[Array]:
    """The edges of what is black of a board, each (n, 2) in metres: `ring` (n, 2) is that of the unit square."""
    drawing = kind_of(board).drawn(board)
    rings = ring if len(drawing.rectangles) <= _DETAILED else ring[::_SIDE]  # the cells of tags are small
    around = np.linspace(0, 2 * np.pi, 2 * _SIDE, endpoint=False)
    circle = np.stack([np.cos(around), np.sin(around)], axis=-1)
    black = [rings * [wide, high] + [x, y] for x, y, wide, high in drawing.rectangles]
    return black + [circle * size / 2 + [x, y] for x, y, size in drawing.discs]
