"""Bursts of frames that follow one another, spread over a film, as pictures with their times."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import cv2
import numpy as np

from camviz_clinic.calibration.rolling_solving import FRAMES, even_times
from camviz_clinic.films.candidates import DIGITS
from camviz_clinic.films.reading import Film, FilmError

Step = Callable[[int, int], object]


@dataclass(frozen=True)
class Bursts:
    """Frames of a film that follow one another, as pictures.

    Args:
        pictures: In their order.
        times_s: One for each, from the film's first frame.
        notes: Sentences on how the film was read, and how many frames were taken.

    >>> Bursts((Path("film_000012.png"),), (0.4,)).notes
    ()
    """

    pictures: tuple[Path, ...]
    times_s: tuple[float, ...]
    notes: tuple[str, ...] = ()


def bursts(path: str | PathLike[str], folder: Path, frames: int, reading: Step | None = None) -> Bursts:
    """Bursts of eight frames at even distances over a film, or all frames of one that has no more than asked for.

    A film whose frames come at even distances has the times of these, and not those that its clock rounds.

    Args:
        path: The film.
        folder: Where the pictures go, `NAME_000123.png` for frame 123.
        frames: How many at most.
        reading: callable, called with the numbers of frames read and in all.

    Returns: The frames.
    Raises: FilmError for a film that cannot be read, and where the pictures cannot be written.

    >>> from camviz_clinic.films.virtual import example
    >>> example("film.avi")
    >>> taken = bursts("film.avi", Path("."), 16)
    >>> len(taken.pictures), round(taken.times_s[1], 3)
    (16, 0.1)
    """
    count = _counted(path)
    wanted = set(chosen(count, frames))
    kept, numbers, times = [], [], []
    with Film(path) as film:
        for frame in film.frames():
            if reading:
                reading(min(frame.number, count), count)
            if frame.number in wanted:
                picture = folder / f"{film.label}_{frame.number:0{DIGITS}}.png"
                if not cv2.imwrite(str(picture), frame.gray, [cv2.IMWRITE_PNG_COMPRESSION, 1]):
                    raise FilmError(film.path, f"its frames cannot be kept in {folder}: is there room left?")
                kept.append(picture)
                numbers.append(frame.number)
                times.append(frame.time_s)
        notes = tuple(f"{film.path.name}: {note}" for note in film.notes)
    said = f"{Path(path).name}: {len(kept)} of {count} frames were taken, {FRAMES} or more after one another."
    return Bursts(tuple(kept), tuple(even_times(numbers, np.array(times)).tolist()), (said, *notes))


def chosen(count: int, frames: int) -> list[int]:
    """The numbers of at most `frames` of a film's frames, in bursts of eight at even distances.

    >>> chosen(40, 17)
    [0, 1, 2, 3, 4, 5, 6, 7, 32, 33, 34, 35, 36, 37, 38, 39]
    >>> chosen(5, 17)
    [0, 1, 2, 3, 4]
    """
    if count <= frames:
        return list(range(count))
    begins = np.linspace(0, count - FRAMES, max(frames // FRAMES, 1)).round().astype(int)
    return sorted({int(begin) + place for begin in begins for place in range(FRAMES)})


def _counted(path: str | PathLike[str]) -> int:
    """How many frames a film has, by its own word where it gives one."""
    with Film(path) as film:
        return film.count or sum(1 for _ in film.frames())
