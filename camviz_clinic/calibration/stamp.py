"""What a calibration holds for: when and how it was made, and how the camera was set, as its pictures tell it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from math import inf
from os import PathLike
from typing import Any, TypeVar

from camviz.colour.picture_files import PictureError, picture_exif

FAR = 1000.0  # metres: focused this far away, or further, is focused at infinity
LONGEST = 100  # characters of a name
_EPOCH = "SOURCE_DATE_EPOCH"  # reproducible-builds.org: the time that a file is to bear, in seconds from 1970
_Value = TypeVar("_Value", str, float)

# EXIF 2.32, section 4.6
MAKE, MODEL, SERIAL, LENS_MODEL, TAKEN = 0x010F, 0x0110, 0xA431, 0xA434, 0x9003
FOCAL_LENGTH, SUBJECT_DISTANCE, DIGITAL_ZOOM = 0x920A, 0x9206, 0xA404


@dataclass(frozen=True)
class Stamp:
    """How the pictures of one camera were taken, and when and by what a calibration was made of them.

    A field is empty where nothing is known. `made`, `program`, `model`, `views` and `conditions` are of the
    calibration; `conditions` are the words of who made it. The others are what EXIF tells, each value once:
    `focal_lengths` are in millimetres, `focus_distances` in metres (1000 is infinity), `digital_zooms` are factors, and
    `taken` are the times of the first and the last picture. The size of the image and the board are the calibration's.
    """

    made: str = ""
    program: str = ""
    model: str = ""
    views: int = 0
    conditions: str = ""
    cameras: tuple[str, ...] = ()
    lenses: tuple[str, ...] = ()
    focal_lengths: tuple[float, ...] = ()
    focus_distances: tuple[float, ...] = ()
    digital_zooms: tuple[float, ...] = ()
    taken: tuple[str, ...] = ()

    @classmethod
    def of(cls, pictures: Iterable[str | PathLike[str]], **made: Any) -> Stamp:
        """The stamp of the pictures in files; `made` are the fields of the calibration.

        A file that is no picture, or has no EXIF, tells nothing.
        """
        tags = [tags for path in pictures if (tags := _exif(path))]
        times = _each(tags, _time)
        return cls(
            cameras=_each(tags, _camera),
            lenses=_each(tags, lambda each: word(each.get(LENS_MODEL))),
            focal_lengths=_each(tags, lambda each: _number(each.get(FOCAL_LENGTH), 1e-3, 1e5)),
            focus_distances=_each(tags, _focus),
            digital_zooms=_each(tags, lambda each: _number(each.get(DIGITAL_ZOOM), 1e-3, 1e3)),
            taken=tuple(dict.fromkeys((times[0], times[-1]))) if times else (),
            **made,
        )

    def known(self) -> dict[str, Any]:
        """The fields of which something is known, by their names, lists for tuples.

        >>> Stamp(made="2026-01-31 12:00 UTC", focal_lengths=(35.0,)).known()
        {'made': '2026-01-31 12:00 UTC', 'focal_lengths': [35.0]}
        """
        held = {each.name: getattr(self, each.name) for each in fields(self)}
        return {key: list(value) if isinstance(value, tuple) else value for key, value in held.items() if value}


def now() -> str:
    """The time in UTC, to the minute; that of SOURCE_DATE_EPOCH where it is set, so that a file can be made again."""
    said = os.environ.get(_EPOCH, "")
    moment = datetime.fromtimestamp(int(said), UTC) if said.isdigit() and len(said) < 12 else datetime.now(UTC)
    return f"{moment:%Y-%m-%d %H:%M} UTC"


def _exif(path: str | PathLike[str]) -> Mapping[int, Any]:
    try:
        return picture_exif(path)
    except PictureError:
        return {}


def _each(tags: Sequence[Mapping[int, Any]], read: Callable[[Mapping[int, Any]], _Value | None]) -> tuple[_Value, ...]:
    """What the pictures tell, in order, each value once."""
    return tuple(sorted({value for each in tags if (value := read(each))}))


def _camera(tags: Mapping[int, Any]) -> str | None:
    """Make and model, the make once, and the number of the body: two bodies of one model are two cameras."""
    make, model, serial = (word(tags.get(tag)) or "" for tag in (MAKE, MODEL, SERIAL))
    named = model if model.lower().startswith(make.lower()) else f"{make} {model}".strip()
    return f"{named}, no. {serial}" if named and serial else named or None


def _time(tags: Mapping[int, Any]) -> str | None:
    """ "2026:01:31 12:00:00" as "2026-01-31 12:00"."""
    try:
        return f"{datetime.strptime(word(tags.get(TAKEN)) or '', '%Y:%m:%d %H:%M:%S'):%Y-%m-%d %H:%M}"
    except ValueError:
        return None


def _focus(tags: Mapping[int, Any]) -> float | None:
    """The distance in metres; EXIF has 0 where it is not known."""
    distance = _number(tags.get(SUBJECT_DISTANCE), 1e-3, inf)
    return None if distance is None else min(distance, FAR)


def word(value: Any) -> str | None:
    """What can be printed of a word; None where nothing is left."""
    words = "".join(c if c.isprintable() else " " for c in value) if isinstance(value, str) else ""
    return " ".join(words.split())[:LONGEST] or None


def _number(value: Any, least: float, most: float) -> float | None:
    """A number within bounds, to four digits; None for anything else."""
    try:
        number = float(value)
    except (TypeError, ValueError, ArithmeticError):
        return None
    return float(f"{number:.4g}") if least <= number <= most else None
