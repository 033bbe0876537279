"""From films to the few frames that a calibration is made of, as pictures in a folder."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz_clinic.calibration.detection import CannotCalibrate, Detections, NoBoard, detect
from camviz_clinic.calibration.types import Board
from camviz_clinic.films.candidates import FilmedMoment, candidates
from camviz_clinic.films.choosing import most_telling, most_telling_of_boards
from camviz_clinic.films.reading import Film

FRAMES = 30
LOOKED_AT = 4  # times as many frames as are chosen
FEWEST_LOOKED_AT = 60

Step = Callable[[int, int], object]
Path_ = str | PathLike[str]


@dataclass(frozen=True)
class Chosen:
    """The chosen frames of films.

    Args:
        pictures: By camera, in the order of their moments.
        notes: Sentences on each film: how many frames were used, how it was read, and where it is damaged.

    >>> from pathlib import Path
    >>> Chosen({"camera": (Path("film_000012.png"),)}).notes
    ()
    """

    pictures: Mapping[str, tuple[Path, ...]]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class FrameChoice:
    """How frames are chosen: what `chosen_frames` takes beside films and a folder."""

    boards: Mapping[str, Board]  # one has no name
    frames: int = FRAMES
    model: str | Mapping[str, str] = "standard"
    held: Mapping[str, Camera] | None = None
    fixed: Sequence[str] = ()
    search: Mapping[str, Any] | None = None
    fixture: Mapping[str, Any] | None = None

    @property
    def looked_at(self) -> int:
        return max(LOOKED_AT * self.frames, FEWEST_LOOKED_AT)


def chosen_frames(
    takes: Sequence[Mapping[str, Path_]],
    folder: Path_,
    board: Board | Mapping[str, Board],
    frames: int = FRAMES,
    *,
    model: str | Mapping[str, str] = "standard",
    held: Mapping[str, Camera] | None = None,
    fixed: Sequence[str] = (),
    search: Mapping[str, Any] | None = None,
    fixture: Mapping[str, Any] | None = None,
    reading: Step | None = None,
    looking: Step | None = None,
) -> Chosen:
    """The frames by which cameras are known best, of all that their films hold.

    Each film is read once. Of every short while the stillest and sharpest frame is looked at. Those that show the board
    give a first solution, and from these are chosen, one after the other, the ones that lessen the variances of its
    parameters most (`most_telling`). Where they give no solution they are chosen evenly: the solution from the pictures
    will say what is wrong.

    Args:
        takes: What was filmed at one time, by each camera's name its film. A camera may have several takes; several
            cameras begin to film at the same moment, and have one take.
        folder: Where the frames go, as PNG: `NAME_000123.png` for frame 123, counted from 0, of the film NAME.
        board: What is filmed; several boards by their names.
        frames: How many are chosen at most, for each camera.
        model, held, fixed: As of `calibrate_rig`.
        search: The keywords finder, workers and seconds of `detect`.
        fixture: Of several boards the keywords apart and known of `calibrate_boards`.
        reading, looking: callable, called with the numbers of frames done and in all, while films are read and while
            the board is looked for.

    Returns: The pictures by camera.
    Raises: FilmError for a film that cannot be read, ValueError for a number below 1.

    >>> from camviz_clinic.films.virtual import example
    >>> from camviz_clinic.calibration import Board
    >>> example("film.avi")  # a board of 4 by 3 corners, carried before a virtual camera
    >>> chosen = chosen_frames([{"camera": "film.avi"}], "frames", Board(4, 3, 0.05), 3)
    >>> len(chosen.pictures["camera"])
    3
    """
    if frames < 1:
        raise ValueError(f"frames must be at least 1, got {frames}")
    boards = {"": board} if isinstance(board, Board) else board
    plan = FrameChoice(boards, frames, model, held, fixed, search, fixture)
    found, notes = _candidates(takes, Path(folder), plan, reading)
    left, showing = _choose(found, plan, looking)
    for place, candidate in enumerate(found):
        for path in candidate.pictures.values() if place not in left else ():
            path.unlink()
    names = dict.fromkeys(name for take in takes for name in take)
    pictures = {
        name: tuple(found[place].pictures[name] for place in left if name in found[place].pictures) for name in names
    }
    of = {name: ", ".join(Path(take[name]).name for take in takes if name in take) for name in names}
    told = [f"{of[name]}: {_used(name, pictures[name], found, showing)}" for name in names]
    return Chosen(pictures, (*told, *notes))


def _candidates(
    takes: Sequence[Mapping[str, Path_]], folder: Path, plan: FrameChoice, reading: Step | None
) -> tuple[list[FilmedMoment], list[str]]:
    """The moments of all takes that are looked at, and what was noted of the films."""
    labels = _labels([Path(path) for take in takes for path in take.values()])
    found: list[FilmedMoment] = []
    notes: list[str] = []
    for take in takes:
        with ExitStack() as open_films:
            films = {name: open_films.enter_context(Film(path, labels[Path(path)])) for name, path in take.items()}
            found += candidates(films, folder, -(-plan.looked_at // len(takes)), reading)
            notes += [f"{film.path.name}: {note}" for film in films.values() for note in film.notes]
    return found, notes


def _labels(paths: Sequence[Path]) -> dict[Path, str]:
    """The films' names without their endings; where two are alike, with the folder or a number before them."""
    stems = [path.stem for path in paths]
    named: dict[Path, str] = {}
    for path in dict.fromkeys(paths):
        label = path.stem if stems.count(path.stem) == 1 else f"{path.parent.name or 'film'}-{path.stem}"
        number = 2
        while label in named.values():
            label, number = f"{path.stem}-{number}", number + 1
        named[path] = label
    return named


def _choose(found: Sequence[FilmedMoment], plan: FrameChoice, looking: Step | None) -> tuple[list[int], dict[str, int]]:
    """The chosen candidates' places, and by camera how many show a board."""
    try:
        seen = _seen(found, plan, looking)
    except CannotCalibrate:  # which will be said of the pictures themselves
        return _evenly(range(len(found)), plan.frames), {}
    shown = {name: {place for one in each.values() for place in one.places} for name, each in seen.items()}
    counts = {name: len(places) for name, places in shown.items()}
    try:
        return list(_most_telling(seen, plan)), counts
    except CannotCalibrate:
        return _evenly(sorted(set().union(*shown.values())), plan.frames), counts


def _seen(found: Sequence[FilmedMoment], plan: FrameChoice, looking: Step | None) -> dict[str, dict[str, Detections]]:
    """What each camera saw of each board; raises CannotCalibrate for a camera that saw none."""
    names = dict.fromkeys(name for each in found for name in each.pictures)
    total, begun = len(plan.boards) * sum(len(each.pictures) for each in found), 0
    seen: dict[str, dict[str, Detections]] = {name: {} for name in names}
    for name in names:
        places = [place for place, each in enumerate(found) if name in each.pictures]
        paths = [found[place].pictures[name] for place in places]
        for called, board in plan.boards.items():
            progress = None if looking is None else _from(begun, total, looking)
            begun += len(paths)
            try:
                each = detect(paths, board, progress=progress, **(plan.search or {}))
            except NoBoard:
                continue
            seen[name][called] = replace(each, places=tuple(places[place] for place in each.places))
        if not seen[name]:
            raise CannotCalibrate(f"{name} shows no board")
    return seen


def _most_telling(seen: Mapping[str, Mapping[str, Detections]], plan: FrameChoice) -> tuple[int, ...]:
    if len(plan.boards) > 1:
        how = {"held": plan.held, "fixed": plan.fixed, **(plan.fixture or {})}
        return most_telling_of_boards(seen, plan.boards, plan.model, plan.frames, **how)
    ((called, board),) = plan.boards.items()
    alone = {name: each[called] for name, each in seen.items()}
    return most_telling(alone, board, plan.model, plan.frames, held=plan.held, fixed=plan.fixed)


def _from(begun: int, total: int, looking: Step) -> Step:
    return lambda done, _: looking(begun + done, total)


def _evenly(places: Sequence[int], count: int) -> list[int]:
    if len(places) <= count:
        return list(places)
    return [places[int(at)] for at in np.unique(np.linspace(0, len(places) - 1, count).round())]


def _used(name: str, pictures: Sequence[Path], found: Sequence[FilmedMoment], showing: Mapping[str, int]) -> str:
    """How many frames were used, of how many that were looked at."""
    looked = sum(name in each.pictures for each in found)
    shown = f", {showing[name]} of which show the board" if name in showing else ""
    return f"{len(pictures)} frames were chosen, of {looked} that were looked at{shown}."
