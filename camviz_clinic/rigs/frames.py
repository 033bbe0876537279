"""Which pictures of a rig's cameras were taken at the same moment."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from camviz_clinic.calibration.detection import CannotCalibrate, Detections
from camviz_clinic.calibration.pairing import last_number


def synchronised(pictures: Mapping[str, Sequence[Path]], *, by_order: bool = True) -> dict[str, tuple[int, ...]]:
    """The frame of every picture: of one moment are those of the same name, else those with the same last number.

    Args:
        pictures: By camera; each may have pictures of any of the frames.
        by_order: Where names tell nothing and all cameras have as many pictures, take these in their order.

    Returns: By camera, one frame's number for each picture; frames count in the order of their names.
    Raises: CannotCalibrate where nothing tells which pictures are of one moment.

    >>> from pathlib import Path
    >>> films = {"cam0": [Path("cam0/07.png"), Path("cam0/09.png")], "cam1": [Path("cam1/08.png"), Path("cam1/09.png")]}
    >>> synchronised(films)
    {'cam0': (0, 2), 'cam1': (1, 2)}
    """
    for key in (_name, last_number):
        keys = {name: [key(path) for path in paths] for name, paths in pictures.items()}
        if _tell(keys):
            order = sorted({each for several in keys.values() for each in several}, key=_natural)
            frame = {each: number for number, each in enumerate(order)}
            return {name: tuple(frame[each] for each in several) for name, several in keys.items()}
    counts = {name: len(paths) for name, paths in pictures.items()}
    if by_order and len(set(counts.values())) == 1:
        return {name: tuple(range(count)) for name, count in counts.items()}
    said = ", ".join(f"{count} of {name}" for name, count in counts.items())
    raise CannotCalibrate(
        f"there are pictures of several cameras ({said}), and their names do not tell which are of one moment: give "
        "pictures of one moment the same name or number, as in cam0/07.png and cam1/07.png"
    )


def in_frames(detections: Mapping[str, Detections]) -> dict[str, Detections]:
    """Views with the same `places` for those of one moment, as the names of their pictures have it.

    Args:
        detections: By camera.

    Returns: The same with places that are frames.
    Raises: CannotCalibrate where the names do not tell which views are of one moment.

    >>> import numpy as np
    >>> from camviz_clinic.calibration import Detections
    >>> film = Detections(("a7.png", "a9.png"), np.zeros((2, 4, 2)), 640, 480)
    >>> other = Detections(("b8.png", "b9.png"), np.zeros((2, 4, 2)), 640, 480)
    >>> [each.places for each in in_frames({"a": film, "b": other}).values()]
    [(0, 2), (1, 2)]
    """
    frames = synchronised(
        {name: [Path(picture) for picture in each.pictures] for name, each in detections.items()}, by_order=False
    )
    return {name: replace(each, places=frames[name]) for name, each in detections.items()}


def _tell(keys: Mapping[str, Sequence[str]]) -> bool:
    """Whether every picture of a camera has a key of its own, and every camera shares one with another."""
    for name, several in keys.items():
        others = {each for other, those in keys.items() if other != name for each in those}
        if "" in several or len(set(several)) < len(several) or not others & set(several):
            return False
    return True


def _name(path: Path) -> str:
    return path.stem


def _natural(key: str) -> tuple[tuple[int, int | str], ...]:
    """left2 before left10."""
    parts = re.split(r"([0-9]+)", key)
    return tuple((0, int(part)) if part.isdigit() else (1, part) for part in parts)
