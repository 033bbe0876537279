"""Which frames of films are worth a search for the board: the stillest and sharpest of every short while."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz_clinic.films.reading import Film, FilmError, Frame

Progress = Callable[[int, int], object]

SIDE = 960  # pixels along the longer side of the copy that is judged
FLAT = 1e-3  # of the light's range squared: what is below has no edges to judge
WHILE_S = 0.25  # of a film that does not say how long it is
DIGITS = 6  # of a frame's number in a file's name


@dataclass(frozen=True)
class FilmedMoment:
    """A moment of a take and the frames of it, written as pictures.

    Args:
        number: Of the frame in the take's first film.
        time_s: From the take's beginning.
        pictures: By camera.

    >>> FilmedMoment(12, 0.4, {"camera": Path("film_000012.png")}).number
    12
    """

    number: int
    time_s: float
    pictures: Mapping[str, Path]


@dataclass(frozen=True, eq=False)
class _Judged:
    """Frames of one moment, and how much better than others they are for finding corners in."""

    frames: Mapping[str, Frame]
    merit: float


def candidates(
    films: Mapping[str, Film], folder: Path, count: int, progress: Progress | None = None
) -> list[FilmedMoment]:
    """The best moment of each of `count` equal whiles, as pictures in a folder.

    The best is where edges are sharp and move little, in all films of the take together: blur and a rolling shutter
    spoil corners by how fast the board moves.

    Args:
        films: By camera, begun at the same moment; frames of one moment are those next to each other in time.
        folder: Where the pictures go, `NAME_000123.png` by the name of the film, or in a folder of each camera.
        count: How many there may be.
        progress: callable, called with the numbers of frames read and in all.

    Returns: In the order of their times.
    Raises: FilmError for a film without a frame, and where the pictures cannot be written.
    """
    longest = max(films.values(), key=lambda film: film.count / film.rate)
    length_s = longest.count / longest.rate
    while_s = length_s / count if length_s else WHILE_S
    kept: list[FilmedMoment] = []
    best: _Judged | None = None
    place = 0
    for done, moment in enumerate(_judged(_moments(films))):
        if progress:
            progress(min(done, longest.count), longest.count or done)
        now = int(_time(moment) / while_s)
        if best is not None and now > place:
            kept.append(_written(best, films, folder))
            best = None
        place = now
        if best is None or moment.merit > best.merit:
            best = moment
    if best is not None:
        kept.append(_written(best, films, folder))
    return _thinned(kept, count)


def _time(moment: _Judged) -> float:
    return next(iter(moment.frames.values())).time_s


def _moments(films: Mapping[str, Film]) -> Iterator[dict[str, Frame]]:
    """The frames of the slowest film, each with those of the others that are next to it in time."""
    slowest = min(films, key=lambda name: films[name].rate)
    others = {name: _Nearest(film.frames()) for name, film in films.items() if name != slowest}
    half = 0.5 / films[slowest].rate
    for frame in films[slowest].frames():
        near = {name: other.at(frame.time_s, half) for name, other in others.items()}
        found = {slowest: frame, **{name: each for name, each in near.items() if each is not None}}
        yield {name: found[name] for name in films if name in found}


class _Nearest:
    """Frames in the order of their times, of which the one nearest to a time is asked for, later and later."""

    def __init__(self, frames: Iterator[Frame]) -> None:
        self._frames = frames
        self._here: Frame | None = next(frames, None)
        self._next: Frame | None = next(frames, None)

    def at(self, time_s: float, within_s: float) -> Frame | None:
        while self._next and self._here and abs(self._next.time_s - time_s) <= abs(self._here.time_s - time_s):
            self._here, self._next = self._next, next(self._frames, None)
        here = self._here
        return here if here is not None and abs(here.time_s - time_s) <= within_s else None


def _judged(moments: Iterator[dict[str, Frame]]) -> Iterator[_Judged]:
    """Every moment with its merit: log of sharpness over speed, the mean of its films."""
    before: dict[str, tuple[Frame, NDArray[np.float32]]] = {}
    held: tuple[dict[str, Frame], dict[str, float], dict[str, float]] | None = None
    for frames in moments:
        small = {name: _small(frame.gray) for name, frame in frames.items()}
        sharp = {name: sharpness(each) for name, each in small.items()}
        moved = {
            name: speed(before[name][1], small[name], frame.time_s - before[name][0].time_s)
            for name, frame in frames.items()
            if name in before
        }
        if held is not None:
            yield _merited(*held, moved)
        held = frames, sharp, moved
        before |= {name: (frame, small[name]) for name, frame in frames.items()}
    if held is not None:
        yield _merited(*held, held[2])


def _merited(
    frames: dict[str, Frame], sharp: dict[str, float], came: dict[str, float], goes: dict[str, float]
) -> _Judged:
    """The speed is the larger of that from the frame before and that to the next one."""
    merits = []
    for name, edges in sharp.items():
        fast = max(came.get(name, 0.0), goes.get(name, 0.0))
        merits.append(np.log(edges + FLAT) - 2 * np.log(fast + 1))
    return _Judged(frames, float(np.mean(merits)))


def sharpness(gray: NDArray[np.float32]) -> float:
    """The mean square of a picture's second derivatives, which blur lessens more than anything else does.

    Args:
        gray: (height, width), from 0 to 1.

    Returns: 0 for an even picture.

    >>> edge = np.repeat(np.float32([[0, 0, 0, 1, 1, 1]]), 6, axis=0)
    >>> sharpness(edge) > 2 * sharpness(cv2.blur(edge, (3, 3)))
    True
    """
    return float(np.mean(cv2.Laplacian(gray, cv2.CV_32F) ** 2))


def speed(before: NDArray[np.float32], after: NDArray[np.float32], seconds: float) -> float:
    """How fast edges move, in pixels a second: the least squares solution v of |∂I/∂t| = v |∇I|.

    Args:
        before, after: (height, width), from 0 to 1.
        seconds: Between them.

    Returns: 0 for pictures without edges.
    Source: Horn & Schunck (1981), "Determining optical flow", Artificial Intelligence 17, eq. for the normal flow.

    >>> ramp = np.tile(np.linspace(0, 1, 101, dtype=np.float32), (9, 1))  # moved by a pixel in a tenth of a second
    >>> round(speed(ramp[:, :-1], ramp[:, 1:], 0.1), 1)
    10.0
    """
    across, down = (cv2.Sobel(before, cv2.CV_32F, *order, ksize=3, scale=1 / 8) for order in ((1, 0), (0, 1)))
    slope = cv2.magnitude(across, down)
    against = float(np.sum(slope**2))
    return float(np.sum(np.abs(after - before) * slope)) / against / max(seconds, 1e-6) if against > 0 else 0.0


def _small(gray: NDArray[np.uint8]) -> NDArray[np.float32]:
    scale = min(SIDE / max(gray.shape), 1)
    size = (round(gray.shape[1] * scale), round(gray.shape[0] * scale))
    small = cv2.resize(gray, size, interpolation=cv2.INTER_AREA) if scale < 1 else gray
    return np.asarray(small, np.float32) / np.float32(255)


def _written(moment: _Judged, films: Mapping[str, Film], folder: Path) -> FilmedMoment:
    number = next(iter(moment.frames.values())).number
    pictures = {}
    for name, frame in moment.frames.items():
        room = folder / name if len(films) > 1 else folder
        room.mkdir(parents=True, exist_ok=True)
        path = room / f"{films[name].label}_{number:0{DIGITS}}.png"
        if not cv2.imwrite(str(path), frame.gray, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
            raise FilmError(films[name].path, f"its frames cannot be kept in {folder}: is there room left?")
        pictures[name] = path
    return FilmedMoment(number, _time(moment), pictures)


def _thinned(found: list[FilmedMoment], count: int) -> list[FilmedMoment]:
    """At most so many, evenly; the pictures of the others are removed."""
    left = set(np.linspace(0, len(found) - 1, count).round().astype(int)) if len(found) > count else range(len(found))
    for place, each in enumerate(found):
        if place not in left:
            for path in each.pictures.values():
                path.unlink()
    return [each for place, each in enumerate(found) if place in left]
