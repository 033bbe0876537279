"""A guided calibration without its page: frames go in one by one, and the answer to each says what to do now."""

from __future__ import annotations

from collections.abc import Iterable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from threading import Lock

import numpy as np

from camviz import __version__
from camviz.draw.picture import png
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.boards import kind_of
from camviz_clinic.calibration.camera_models import MODELS
from camviz_clinic.calibration.detection import CannotCalibrate, Detections
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.identifiability import undecided_names
from camviz_clinic.calibration.solving import calibrate
from camviz_clinic.calibration.stamp import Stamp, now
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.summary import GOOD, measured
from camviz_clinic.files.writing import write
from camviz_clinic.live.guiding import Guide, first_guide, guide
from camviz_clinic.live.tracking import BLURRED, Gray, Tracked, apart, track

FEWEST = 6  # views: of fewer, their scatter says too little of how far the solution is off
MOST = 40
ENOUGH = 0.5  # of what the ghost would gain, asked of a view at first
PATIENCE_S = 5.0  # in which half as much is asked, for who cannot or will not follow the ghost
NEW = 0.05  # of the picture's width, that a view differs from all others
SAME = 0.005  # of the picture's width, by which a board at rest may seem to move
CELLS = (8, 6)  # of the picture, whose share with a corner is the coverage


@dataclass(frozen=True, eq=False)
class TakenView:
    """A view that was taken: its frame and the corners in it, (n, 2) pixels."""

    gray: Gray
    corners: Array


@dataclass(frozen=True)
class Known:
    """How well the camera was known after so many views: fx and its σ in pixels, and the largest expected error.

    σ is infinite where the corners do not decide fx.
    """

    views: int
    fx: float
    sigma: float
    largest: float


@dataclass(frozen=True, eq=False)
class FrameAnswer:
    """What a frame showed, and what to do now.

    Args:
        corners: (n, 2), the board in the frame, in pixels; None where it was not seen.
        taken: Whether the frame was taken as a view.
        sentence: What to do, for a person.

    >>> FrameAnswer(None, False, "Hold the board into the picture.").taken
    False
    """

    corners: Array | None
    taken: bool
    sentence: str


@dataclass(frozen=True, eq=False)
class _Step:
    """What came of a frame that was taken: without a view its corners were not found; `why` there is no camera."""

    view: TakenView | None
    calibration: Calibration | None = None
    guide: Guide | None = None
    known: Known | None = None
    why: str = ""


class Session:
    """A guided calibration: it takes a frame as a view when the board rests, is sharp, and says something new.

    The newest frame is looked at and nothing waits: while a solution is worked out in a thread of its own, frames are
    answered and none is taken. It ends when the largest expected error of where a far point is seen (Max ERE) is
    within the goal.

    Args:
        board: What is held before the camera.
        model: One of `camviz_clinic.calibration.MODELS`.
        goal: In pixels.
        most: Views, with which it ends at the latest.

    Attributes:
        views: Those taken so far.
        known: After each view from the third on, how well the camera was known.
        done: Whether it has ended.

    Raises: ValueError for an unknown model, a goal that is not positive, and fewer views than 6.

    >>> from camviz_clinic.calibration import Board
    >>> session = Session(Board(9, 6, 0.025))
    >>> session.look(np.full((480, 640), 127, np.uint8), 0.0).sentence
    'Hold the board into the picture, the whole of it.'
    """

    views: tuple[TakenView, ...]
    known: tuple[Known, ...]
    done: bool

    def __init__(self, board: Board, model: str = "standard", goal: float = GOOD, most: int = MOST) -> None:
        if model not in MODELS:
            raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
        if not 0 < goal < np.inf:
            raise ValueError(f"goal must be a positive number of pixels, got {goal}")
        if not most >= FEWEST:
            raise ValueError(f"most must be at least {FEWEST} views, got {most}")
        self.board, self.model, self.goal, self.most = board, model, goal, most
        self.views = ()
        self.known = ()
        self.done = False
        self.guide: Guide | None = None
        self._calibration: Calibration | None = None
        self._before: Tracked | None = None
        self._sharpest = 0.0
        self._judged: tuple[Array, float] | None = None  # where the board rested, and what it would gain there
        self._asked_s: float | None = None  # when the board was first seen since the last view
        self._trouble = ""
        self._thread = ThreadPoolExecutor(1, "camviz-capture")
        self._solving: Future[_Step] | None = None
        self._once = Lock()

    def look(self, gray: Gray, time_s: float) -> FrameAnswer:
        """Look at a frame, and take it if it is worth it.

        Args:
            gray: (height, width) of uint8, grey levels.
            time_s: When it was taken, in seconds from any moment on.

        Returns: What was seen, and what to do now.
        Raises: ValueError for a frame of another size than the first.
        """
        self._collect()
        self._same_size(gray)
        if self.done:
            return FrameAnswer(None, False, self.verdict)
        seen, before = track(gray, self.board, time_s), self._before
        self._before = seen
        if seen is None:
            return FrameAnswer(None, False, "Hold the board into the picture, the whole of it.")
        if self._solving:
            return FrameAnswer(seen.corners, False, f"View {len(self.views) + 1} is taken; what it says is worked out.")
        if what_lacks := self._lacks(seen, before):
            return FrameAnswer(seen.corners, False, what_lacks)
        self._solving = self._thread.submit(self._solved, gray.copy())
        return FrameAnswer(seen.corners, True, f"View {len(self.views) + 1} is taken.")

    def run(self, frames: Iterable[tuple[Gray, float]]) -> Session:
        """Look at frames, wait for each solution, and stop at the goal.

        Args:
            frames: (height, width) of grey levels each, with the time in seconds when it was taken.

        Returns: Itself.
        """
        for gray, time_s in frames:
            if self.look(gray, time_s).taken:
                self.wait()
            if self.done:
                break
        return self

    def wait(self) -> None:
        """Wait for what is being worked out."""
        if solving := self._solving:
            solving.result()
        self._collect()

    @property
    def calibration(self) -> Calibration:
        """The camera by the views taken so far. Raises CannotCalibrate before there is one."""
        self.wait()
        if self._calibration is None:
            raise CannotCalibrate(
                f"no camera is known yet: {len(self.views)} views were taken. {self._trouble}".strip()
            )
        return self._calibration

    def save(self, path: str | PathLike[str], format: str = "opencv") -> tuple[str, ...]:
        """Write the calibration.

        Args:
            path: Where to.
            format: One of `camviz_clinic.files.formats()`.

        Returns: What the format cannot hold, as noun phrases such as "the board".
        """
        return write(self.calibration, path, format)

    def save_pictures(self, folder: str | PathLike[str]) -> None:
        """Write the frames of the views as PNG, view01.png and so on.

        Args:
            folder: Where to; made when it is not there.

        Raises: OSError where they cannot be written.
        """
        Path(folder).mkdir(parents=True, exist_ok=True)
        for name, view in zip(self._names(), self.views, strict=True):
            Path(folder, name).write_bytes(png(view.gray))

    @property
    def coverage(self) -> float:
        """The share of the picture's cells, eight by six, in which there was a corner."""
        if not self.views:
            return 0.0
        corners = np.concatenate([view.corners[np.isfinite(view.corners).all(axis=1)] for view in self.views])
        height, width = self.views[0].gray.shape
        cells = np.floor((corners + 0.5) / (width, height) * CELLS).astype(int)
        return len(np.unique(cells, axis=0)) / (CELLS[0] * CELLS[1])

    @property
    def verdict(self) -> str:
        """How it ended, or how far it is."""
        if not self.known:
            return f"{len(self.views)} views were taken, and no camera is known yet."
        now, reached = self.known[-1], self.known[-1].largest <= self.goal
        said = f"fx = {measured(now.fx, now.sigma)} px by {len(self.views)} views; where it is worst, a far point is "
        said += f"expected to be {now.largest:.2g} px off, and the goal is {self.goal:g} px."
        return f"{'The goal is reached' if reached else 'The goal is not reached'}: {said}"

    def _same_size(self, gray: Gray) -> None:
        height, width = gray.shape
        if self.guide is None:
            self.guide = first_guide(self.board, width, height, 0)
        k = self.guide.camera.intrinsics
        if (width, height) != (k.width, k.height):
            raise ValueError(f"frames must have {k.width} × {k.height} pixels as the first had, got {width} × {height}")

    def _lacks(self, seen: Tracked, before: Tracked | None) -> str:
        """What keeps a frame from being taken, as a sentence that says what to do; empty when nothing does."""
        assert self.guide is not None
        width = self.guide.camera.intrinsics.width
        self._asked_s = seen.time_s if self._asked_s is None else self._asked_s
        if not seen.still_since(before, width):
            return self._hint("Then rest.")
        if seen.sharpness < BLURRED * self._sharpest:
            return "The board is blurred: hold it still, give it more light, or wait for the focus."
        self._sharpest = max(self._sharpest, seen.sharpness)
        known = any(apart(seen.corners, view.corners) < NEW * width for view in self.views)
        enough = ENOUGH * 0.5 ** ((seen.time_s - self._asked_s) / PATIENCE_S)
        if known or self._share(seen.corners, width) < enough:
            return self._hint("Here it would say little that is new." if self.views else "")
        return ""

    def _share(self, corners: Array, width: int) -> float:
        """What the guide says a view would gain; of a board that rests it is asked once."""
        assert self.guide is not None
        if self._judged is None or apart(corners, self._judged[0]) > SAME * width:
            self._judged = corners, self.guide.share(corners)
        return self._judged[1]

    def _hint(self, more: str) -> str:
        assert self.guide is not None
        return f"{self._trouble} Cover the orange board: {self.guide.instruction}. {more}".strip()

    def _solved(self, gray: Gray) -> _Step:
        """In the thread: the exact corners, the camera by them and all before, and where the board should be next."""
        corners = find_corners(gray, self.board)
        if corners is None:
            return _Step(None)
        views = (*self.views, TakenView(gray, corners))
        height, width = gray.shape
        found = Detections(self._names(len(views)), np.array([view.corners for view in views]), width, height)
        try:
            solved = calibrate(found, self.board, self.model)
            adjustment = Adjustment.of(solved)
            next_guide = guide(adjustment, len(views))
        except (CannotCalibrate, ValueError, np.linalg.LinAlgError) as error:
            why = str(error) if len(views) > 2 else ""
            return _Step(views[-1], guide=first_guide(self.board, width, height, len(views)), why=why)
        sigma = float(np.sqrt(solved.intrinsics_covariance["camera"][0, 0]))
        sigma = np.inf if "fx" in undecided_names(adjustment, "camera") else sigma
        known = Known(len(views), solved.cameras["camera"].intrinsics.fx, sigma, next_guide.largest)
        return _Step(views[-1], self._stamped(solved), next_guide, known)

    def _stamped(self, solved: Calibration) -> Calibration:
        stamp = Stamp(
            made=now(), program=f"camviz {__version__}", model=self.model, views=len(solved.pictures["camera"])
        )
        return replace(solved, stamps={"camera": stamp})

    def _collect(self) -> None:
        """Take over what the thread has worked out, once: front ends answer frames while a cell asks for the camera."""
        with self._once:
            if not self._solving or not self._solving.done():
                return
            step, self._solving = self._solving.result(), None
            self._take_over(step)

    def _take_over(self, step: _Step) -> None:
        self._trouble = step.why if step.view else f"{kind_of(self.board).title} was not found exactly, so no view."
        if step.view is None:
            return
        self.views, self.guide = (*self.views, step.view), step.guide
        self._judged = self._asked_s = None
        if step.known:
            self.known, self._calibration = (*self.known, step.known), step.calibration
            self.done = len(self.views) >= FEWEST and step.known.largest <= self.goal
        self.done |= len(self.views) >= self.most
        if self.done:
            self._thread.shutdown(wait=False)

    def _names(self, count: int | None = None) -> tuple[str, ...]:
        return tuple(f"view{number:02}.png" for number in range(1, (count or len(self.views)) + 1))
