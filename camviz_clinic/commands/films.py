"""Films and HEIC stills on a command line: for as long as the command works, their frames are pictures in a folder."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.boards import board_of
from camviz_clinic.commands.common import LACKING, Refusal, refuse_output
from camviz_clinic.commands.pictures import PICTURES, Bar, pictures
from camviz_clinic.commands.rig import held_of, models_of, told_apart
from camviz_clinic.commands.rolling import OFF, film_in_bursts, is_rolling, refuse_no_film
from camviz_clinic.commands.several import read_boards

if TYPE_CHECKING:
    from camviz_clinic.films import Chosen

FILM = re.compile(r"\.(avi|m2ts|m4v|mkv|mov|mp4|mpeg|mpg|mts|webm|wmv|3gp)", re.IGNORECASE)
HEIC = re.compile(r"\.(heic|heif|hif)", re.IGNORECASE)
STILL = re.compile(f"{PICTURES.pattern}|{HEIC.pattern}", re.IGNORECASE)
FILMS = """\
A film may stand for pictures (FILM.mp4, .mov, .avi, .mkv …). It is read once; of its still and sharp frames those are
used, at most --frames, by which the camera is known best. A pair has a film for each camera (left.mp4 --right
right.mp4), and so has a rig (--rig cam0.mp4 cam1.mp4); they begin at the same moment. Films and HEIC stills are not
turned as a phone would show them: the camera is that of the sensor's own rows and columns.
"""


def add_frames(command: argparse.ArgumentParser, default: str = "30") -> None:
    command.add_argument(
        "--frames",
        metavar="N",
        type=_frames,
        help=f"how many frames of films are used, for each camera (default: {default})",
    )


def take_films_alone(command: argparse.ArgumentParser) -> None:
    """A command with IMAGES and --right takes films in their place, and nothing else that `camviz calibrate` takes."""
    add_frames(command)
    command.set_defaults(corners=None, rig=None, rolling_shutter=OFF, output=None, report=None)


def _frames(text: str) -> int:
    if not re.fullmatch("[0-9]{1,3}", text) or int(text) < 3:
        raise argparse.ArgumentTypeError(f"expected a number of frames from 3 to 999, got {text!r}")
    return int(text)


@contextmanager
def as_pictures(options: argparse.Namespace, how: Mapping[str, Any]) -> Iterator[tuple[str, ...]]:
    """The options name pictures where they named films and HEIC stills; what is to be said of these, in sentences.

    `how` is what `chosen_frames` is told of the model and the search, and of the board where no option names it.
    Raises Refusal for films that cannot be used.
    """
    if options.corners:
        if is_rolling(options):
            refuse_no_film(options, 0, 0)
        yield ()
        return
    given = {word: _found(getattr(options, word) or []) for word in ("images", "right", "rig")}
    paths = [path for several in given.values() for path in several]
    films = [path for path in paths if FILM.fullmatch(path.suffix)]
    if is_rolling(options):
        refuse_no_film(options, len(films), len(paths) - len(films))
    if options.frames and not films:
        raise Refusal("--frames is for films: pictures are all used.")
    if not films and not any(HEIC.fullmatch(path.suffix) for path in paths):
        yield ()
        return
    for output in (options.output, options.report, options.junit):
        if output:
            refuse_output(output, "file", *films)
    _refuse_half(given, options)
    with TemporaryDirectory(prefix="camviz-") as room:
        notes = list(_frames_of(given, Path(room), options, how)) if films else []
        for word, several in given.items():
            if several:
                stills, skipped = _stills(several, Path(room) / word)
                notes += skipped
                setattr(options, word, [str(path) for path in stills])
        yield tuple(notes)


def _found(words: Sequence[str]) -> list[Path]:
    """The files that words name; of a folder its stills, or its films where it has no stills."""
    found: dict[Path, None] = {}
    for word in words:
        folder = Path(word) if "\0" not in word and Path(word).is_dir() else None
        stills = folder is None or any(STILL.fullmatch(each.suffix) for each in folder.iterdir())
        found |= dict.fromkeys(pictures([word], STILL if stills else FILM))
    return list(found)


def _refuse_half(given: Mapping[str, list[Path]], options: argparse.Namespace) -> None:
    """Refuses films of a pair or a rig where another camera has none, for nothing tells which moments are the same."""
    films = {word: [path for path in several if FILM.fullmatch(path.suffix)] for word, several in given.items()}
    if given["rig"] and len(films["rig"]) != len(given["rig"]):
        raise Refusal("--rig: expected films of all cameras or pictures of all, got both.")
    if given["rig"] and len(films["rig"]) < 2:
        raise Refusal("--rig: expected a film of each of at least two cameras, got one.")
    if given["right"] and not len(films["images"]) == len(films["right"]) == len(given["images"]) == len(
        given["right"]
    ):
        raise Refusal("--right: expected one film of each camera, got films and pictures.")
    if given["right"] and len(films["right"]) != 1:
        raise Refusal(f"--right: expected one film of each camera, got {len(films['right'])} films of each.")


def _frames_of(
    given: dict[str, list[Path]], room: Path, options: argparse.Namespace, how: Mapping[str, Any]
) -> tuple[str, ...]:
    """Puts the chosen frames of films in their place; what is to be said of the films."""
    if is_rolling(options):
        given["images"], said = film_in_bursts(given["images"][0], room, options)
        return said
    if given["rig"]:
        cameras = _by_name(given["rig"])
        lenses = {"model": models_of(cameras, options), "held": held_of(cameras, options)}
        chosen = _chosen([cameras], room, options, {**how, **lenses})
        given["rig"] = [path for several in chosen.pictures.values() for path in several]
    elif given["right"]:
        chosen = _chosen([{"left": given["images"][0], "right": given["right"][0]}], room, options, how)
        given["images"], given["right"] = (list(chosen.pictures[name]) for name in ("left", "right"))
    else:
        stills = [path for path in given["images"] if not FILM.fullmatch(path.suffix)]
        takes = [{"camera": path} for path in given["images"] if path not in stills]
        chosen = _chosen(takes, room, options, how)
        given["images"] = [*stills, *chosen.pictures["camera"]]
    return chosen.notes


def _chosen(
    takes: Sequence[Mapping[str, Path]], room: Path, options: argparse.Namespace, how: Mapping[str, Any]
) -> Chosen:
    from camviz.colour.picture_files import PictureError
    from camviz_clinic.films import FilmError, chosen_frames
    from camviz_clinic.films.taking import FRAMES

    boards = read_boards(options.boards) if getattr(options, "boards", None) else None
    frames = options.frames or FRAMES
    if "board" not in how:
        how = {"board": boards.boards if boards else board_of(options), **how}
    fixture = {"apart": boards.apart, "known": boards.known} if boards else None
    with Bar("frames read") as reading, Bar("frames looked at") as looking:
        try:
            return chosen_frames(takes, room, frames=frames, fixture=fixture, reading=reading, looking=looking, **how)
        except (FilmError, PictureError) as error:
            raise Refusal(f"{error}.") from error
        except ValueError as error:  # a parameter to fix that the model does not have
            if not str(error).startswith("fixed"):
                raise
            raise Refusal(f"{error}.") from error


def _by_name(films: Sequence[Path]) -> dict[str, Path]:
    """The films of a rig by what tells them apart."""
    called = told_apart([path.with_suffix("") for path in films])
    return {called[path.with_suffix("")]: path for path in films}


def _stills(paths: Sequence[Path], room: Path) -> tuple[list[Path], list[str]]:
    """The pictures, of HEIC stills the PNG; and what is to be said of those that cannot be read.

    Raises Refusal where none can be.
    """
    from camviz.colour.picture_files import PictureError
    from camviz_clinic.films.stills import HeicMissing, as_png

    found: list[Path] = []
    notes: list[str] = []
    for path in paths:
        if not HEIC.fullmatch(path.suffix):
            found.append(path)
            continue
        own = room / (path.parent.name or "stills")
        if (own / f"{path.stem}.png").exists():
            own = room / str(len(found))
        own.mkdir(parents=True, exist_ok=True)
        try:
            found.append(as_png(path, own))
        except HeicMissing as error:
            raise Refusal(f"{path}: {error}.", LACKING) from error
        except PictureError as error:
            notes.append(f"{path.name}: skipped, {error.why}.")
    if notes and not found:
        raise Refusal(f"none of the pictures can be used: {notes[0]}")
    return found, notes
