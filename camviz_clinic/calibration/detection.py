"""Boards in many pictures, found by several processes at once."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import inf
from multiprocessing.connection import Connection, wait
from os import PathLike
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.boards import kind_of
from camviz_clinic.calibration.boards.charuco import charuco_dictionary
from camviz_clinic.calibration.boards.markers import grid_dictionary
from camviz_clinic.calibration.chessboards import LEAST_SIDE
from camviz_clinic.calibration.finding import check_finder, find_corners, look
from camviz_clinic.calibration.processes import WorkerPool, processors, signals_put_off
from camviz_clinic.calibration.types import Board, Mask
from camviz_clinic.calibration.wrong_board import another_board, part_of_a_larger

__all__ = ["CannotCalibrate", "Detections", "detect", "detect_pair", "find_corners", "seen"]

Progress = Callable[[int, int], object]
Look = tuple[tuple[int, int] | None, Array | None, str]

LISTEN = 0.1  # seconds between two checks for Ctrl-C
PATIENCE = 120.0  # seconds that a process has for one picture, unless somebody says otherwise
WORTH_A_PROCESS = 4  # pictures: a process takes as long to start as three pictures take


class CannotCalibrate(ValueError):  # noqa: N818 - it says what is the case
    """Pictures or corners that no camera can be calibrated from; the message is one sentence.

    >>> from camviz_clinic.calibration import Board, calibrate
    >>> board = Board(9, 6, 0.025)
    >>> calibrate(Detections(("a.png", "b.png"), np.zeros((2, 54, 2)), 640, 480), board)
    Traceback (most recent call last):
    camviz_clinic.calibration.detection.CannotCalibrate: at least 3 views of the board are needed for a calibration, got
    2
    """


class NoBoard(CannotCalibrate):
    """A board that is in none of the pictures: `said` tells so, and what is not as described may follow it."""

    def __init__(self, said: str, advice: str) -> None:
        super().__init__(f"{said}: {advice}")
        self.said = said


@dataclass(frozen=True, eq=False)
class Detections:
    """The board's corners in pictures of one size.

    Args:
        pictures: Names of the views.
        corners: (views, corners, 2), pixels, NaN where a corner was not seen.
        width, height: Size of the pictures in pixels.
        skipped: tuple of (str, str), pictures without a view, each with the reason.
        places: The views' indices among all the pictures that were looked at, by which those of a pair find each other.

    Raises: ValueError where corners or places are not one for each picture.

    >>> found = Detections(("a.png",), np.array([[[10, 20], [np.nan, np.nan]]]), 640, 480)
    >>> seen(found.corners)
    array([[ True, False]])
    """

    pictures: tuple[str, ...]
    corners: Array
    width: int
    height: int
    skipped: tuple[tuple[str, str], ...] = ()
    places: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "corners", np.asarray(self.corners, dtype=float))
        if self.corners.ndim != 3 or self.corners.shape[-1] != 2 or len(self.corners) != len(self.pictures):
            raise ValueError(
                f"corners must have shape ({len(self.pictures)}, corners, 2), as there are pictures, "
                f"got {self.corners.shape}"
            )
        if not self.places:
            object.__setattr__(self, "places", tuple(range(len(self.pictures))))
        if len(self.places) != len(self.pictures):
            raise ValueError(f"places must be {len(self.pictures)} indices, as there are pictures, got {self.places}")

    def only(self, views: Iterable[int]) -> Detections:
        """Some of the views, with their places.

        Args:
            views: Their numbers, in the order wanted.

        Returns: Detections of these.

        >>> Detections(("a.png", "b.png"), np.zeros((2, 1, 2)), 640, 480).only([1]).places
        (1,)
        """
        kept = list(views)
        names, places = tuple(self.pictures[view] for view in kept), tuple(self.places[view] for view in kept)
        return replace(self, pictures=names, corners=self.corners[kept], places=places)


def detect(
    paths: Sequence[str | PathLike[str]],
    board: Board,
    *,
    finder: str = "auto",
    workers: int | None = None,
    progress: Progress | None = None,
    seconds: float | None = None,
) -> Detections:
    """Find a board in pictures, in several processes where there are many.

    Pictures without the board, those that cannot be read and those of another size than most are skipped.

    Args:
        paths: The pictures.
        board: What they show.
        finder: {"auto", "sectors", "classic", "saddles"}, how a chessboard is found: see `find_corners`.
        workers: Processes; unless given, as many as there are processors, for many pictures.
        progress: callable, called with the numbers of pictures done and in all.
        seconds: A search that takes longer is ended, and its picture skipped. Unless given, that is so after two
            minutes, and only where there are enough pictures for several processes.

    Returns: One view for each picture that shows the board.

    Raises:
        CannotCalibrate: Where the board is in none of the pictures or most show a larger one, or a process is lost.
        ValueError: For another finder, and for one path in place of a list.

    >>> from camviz_clinic.calibration import Board
    >>> from PIL import Image
    >>> from camviz_clinic.calibration.boards.picture import whiteness
    >>> board = Board(9, 6, 0.025)
    >>> white = whiteness(board, 20, margin=1)  # squares of 20 pixels
    >>> Image.fromarray((255 * white).astype(np.uint8)).save("board.png")
    >>> detect(["board.png"], board).corners[0, 0].round(1)  # after 20 of margin and 20 of a square: between 39 and 40
    array([39.5, 39.5])
    """
    return _gathered(paths, _looked(paths, board, finder, workers, progress, seconds), board)


def detect_pair(
    left: Sequence[str | PathLike[str]],
    right: Sequence[str | PathLike[str]],
    board: Board,
    *,
    finder: str = "auto",
    workers: int | None = None,
    progress: Progress | None = None,
    seconds: float | None = None,
) -> tuple[Detections, Detections]:
    """`detect` in the pictures of two cameras at once; those with the same index are of one moment.

    Args:
        left, right: The pictures of either camera, as many of the one as of the other.
        board: What they show.
        finder, workers, progress, seconds: As of `detect`.

    Returns:
        left: Of the left camera.
        right: Of the right camera.

    Raises:
        ValueError: Where there are not as many pictures of both.
        CannotCalibrate: Where `detect` would.

    >>> from camviz_clinic.calibration import Board
    >>> detect_pair(["left1.png", "left2.png"], ["right1.png"], Board(9, 6, 0.025))
    Traceback (most recent call last):
    ValueError: right must have as many pictures as left, 2, got 1
    """
    if len(left) != len(right):
        raise ValueError(f"right must have as many pictures as left, {len(left)}, got {len(right)}")
    looks = _looked([*left, *right], board, finder, workers, progress, seconds)
    return (
        _gathered(left, looks[: len(left)], board),
        _gathered(right, looks[len(left) :], board),
    )


def seen(corners: Array) -> Mask:
    """Which corners were seen.

    Args:
        corners: (..., 2), pixels, NaN where a corner was not seen.

    Returns: (...) of bool, True where both coordinates are numbers.

    >>> seen(np.array([[10, 20], [np.nan, 20]]))
    array([ True, False])
    """
    return np.asarray(np.isfinite(corners).all(axis=-1))


def _looked(
    paths: Sequence[str | PathLike[str]],
    board: Board,
    finder: str,
    workers: int | None,
    progress: Progress | None,
    seconds: float | None,
) -> list[Look]:
    if isinstance(paths, (str, PathLike)):
        raise ValueError(f"pictures must be a list of paths, got the one path {str(paths)!r}")
    if not paths:
        raise CannotCalibrate("there are no pictures to look for a board in")
    check_finder(finder)
    if board.kind == "charuco":
        charuco_dictionary(board)  # complains about a board that cannot be
    elif board.kind == "markers":
        grid_dictionary(board)
    elif board.kind == "chessboard" and min(board.columns, board.rows) < LEAST_SIDE:
        raise CannotCalibrate(
            f"a chessboard is found by at least {LEAST_SIDE}×{LEAST_SIDE} inner corners, this board has "
            f"{board.columns}×{board.rows}"
        )
    looks: dict[int, Look] = {}
    for place, found in _looks([str(path) for path in paths], board, finder, workers, seconds):
        looks[place] = found
        if progress:
            progress(len(looks), len(paths))
    return [looks[place] for place in range(len(paths))]


def _gathered(paths: Sequence[str | PathLike[str]], looks: Sequence[Look], board: Board) -> Detections:
    names = _names(paths)
    sizes = Counter(size for size, corners, _ in looks if corners is not None)
    if not sizes:
        raise _nothing_found(paths, names, looks, board)
    size = max(sizes, key=lambda one: sizes[one])
    found, skipped = {}, []
    for place, (own_size, corners, why) in enumerate(looks):
        if own_size is not None and own_size != size:
            why = f"it has {own_size[0]}×{own_size[1]} pixels, most have {size[0]}×{size[1]}"  # type: ignore[index]
        if why:
            skipped.append((names[place], why))
        else:
            found[place] = corners
    wrong = part_of_a_larger([paths[i] for i in found], [names[i] for i in found], list(found.values()), board)  # type: ignore[arg-type]
    if wrong:
        raise CannotCalibrate(wrong)
    return Detections(
        pictures=tuple(names[place] for place in found),
        corners=np.stack(list(found.values())),  # type: ignore[arg-type]
        width=size[0],  # type: ignore[index]
        height=size[1],  # type: ignore[index]
        skipped=tuple(skipped),
        places=tuple(found),
    )


def _nothing_found(
    paths: Sequence[str | PathLike[str]], names: Sequence[str], looks: Sequence[Look], board: Board
) -> CannotCalibrate:
    reasons = Counter(why for _, _, why in looks)
    shown = ", ".join(names[:3]) + f" and {len(names) - 3} more" * (len(names) > 3)
    if all(size is None for size, _, _ in looks):
        why, _ = reasons.most_common(1)[0]
        return CannotCalibrate(f"none of the pictures can be used: {why} ({shown})")
    kind, read = kind_of(board), [place for place, (size, _, _) in enumerate(looks) if size is not None]
    seen = another_board([paths[i] for i in read], [names[i] for i in read], board)
    said = f"no {kind.says(board)} was found in any of {len(names)} pictures ({shown})"
    return NoBoard(said, seen or kind.advice)


def _names(paths: Sequence[str | PathLike[str]]) -> list[str]:
    """The files' names, and as much of the folders as tells them apart."""
    names = [Path(path).name for path in paths]
    return names if len(set(names)) == len(names) else [Path(path).as_posix() for path in paths]


def _looks(
    paths: list[str], board: Board, finder: str, workers: int | None, seconds: float | None
) -> Iterator[tuple[int, Look]]:
    if workers is None:
        workers = min(processors(), len(paths) // WORTH_A_PROCESS)
    if (workers > 1 and len(paths) > 1) or seconds is not None:
        yield from _in_processes(paths, board, finder, max(workers, 1), seconds or PATIENCE)
    else:
        for place, path in enumerate(paths):
            yield place, look(path, board, finder)


def _in_processes(
    paths: list[str], board: Board, finder: str, workers: int, seconds: float
) -> Iterator[tuple[int, Look]]:
    """Each process has one picture at a time, by a pipe of its own; signals are heard between two pictures.

    Python raises KeyboardInterrupt between any two of its steps. Where that is just after a lock was taken, as in
    `concurrent.futures`, the lock is never given back and everybody waits for it. So no lock takes part in this.

    The first thing that comes from a process says that it is ready; from then on a picture's time counts.
    """
    waiting = enumerate(paths)
    busy: dict[Any, tuple[int | None, float]] = {}  # the picture's place and when its time is over, by pipe
    with signals_put_off() as hear, WorkerPool(board, finder) as pool:
        try:
            busy |= {pool.another(): (None, inf) for _ in range(min(workers, len(paths)))}
            while busy:
                hear()
                for pipe, (place, end) in list(busy.items()):
                    if place is not None and monotonic() > end and not pipe.poll():
                        del busy[pipe]
                        pool.dismiss(pipe)
                        busy[pool.another()] = None, inf
                        yield place, (None, None, f"the search for the board did not end within {seconds:g} s")
                ready: list[Any] = wait(list(busy), timeout=LISTEN)
                for pipe in ready:
                    (place, _), found = busy.pop(pipe), pipe.recv()
                    _hand_out(waiting, pipe, busy, seconds)
                    if isinstance(found, Exception):
                        raise found
                    if place is not None:
                        yield place, found
        except (EOFError, ConnectionError) as error:
            raise CannotCalibrate(
                "a process that was looking for boards was ended from outside, perhaps because memory ran out: "
                "try again with fewer processes at a time (--workers 1)"
            ) from error


def _hand_out(
    waiting: Iterator[tuple[int, str]], pipe: Connection, busy: dict[Any, tuple[int | None, float]], seconds: float
) -> None:
    """Send the next picture to a process, if there is one."""
    for place, path in waiting:
        busy[pipe] = place, monotonic() + seconds
        pipe.send(path)
        return
