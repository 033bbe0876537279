"""`camviz calibrate --rig`: from the pictures of many cameras to a calibration of all of them."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import Refusal, loaded

if TYPE_CHECKING:
    from camviz.cameras import Camera
    from camviz_clinic.calibration.detection import Detections
    from camviz_clinic.calibration.types import Board, Calibration

TO = "anipose"
RIG = """\
With --rig the pictures are of any number of cameras, each in a folder of its own, or in one folder under names that
differ before their last number (left07.jpg, right07.jpg). Pictures of the same name, or else of the same last number,
are of one moment. Each camera may see the board in any of them, as long as the moments that two cameras share tie all
of them together. The frame of the first camera is the world.
"""


def add_rig(command: argparse.ArgumentParser) -> None:
    """The options of a rig."""
    command.add_argument(
        "--rig", metavar="IMAGES", nargs="+", help="pictures of several cameras: folders, patterns or files"
    )
    command.add_argument(
        "--model-of", metavar="NAME=MODEL", nargs="+", default=[], help="the model of one camera of a rig"
    )
    command.add_argument(
        "--held", metavar="NAME=FILE", nargs="+", default=[], help="a camera of a rig whose intrinsics a file holds"
    )
    command.add_argument("--to", metavar="FORMAT", help=f"of a rig: as `camviz convert --to` (default: {TO})")


def refuse_mixed(options: argparse.Namespace) -> None:
    """Refuses what does not go with --rig, and what goes with nothing else."""
    others = {"IMAGES": options.images, "--right": options.right, "--corners": options.corners}
    given = [word for word, value in others.items() if value]
    if options.rig and given:
        raise Refusal(f"--rig names the pictures of all cameras: leave {' and '.join(given)} out.")
    if options.rig and options.baseline_mm:
        raise Refusal("--baseline-mm is for a pair: leave it out of --rig.")
    alone = {"--model-of": options.model_of, "--held": options.held, "--to": options.to}
    given = [word for word, value in alone.items() if value]
    if not options.rig and given:
        raise Refusal(f"{' and '.join(given)} is for a rig of cameras: name their pictures with --rig.")


def format_of_rig(options: argparse.Namespace) -> str:
    """The format that a rig is written in; raises Refusal for one that has no place for it."""
    from camviz_clinic.files.registry import written

    known = written()
    name = options.to or TO
    if name not in known:
        raise Refusal(f"--to: expected one of {', '.join(known)}, got {name!r}.")
    if known[name].most_cameras == 1 or known[name].rectifies:
        raise Refusal(f"--to {name}: {known[name].title} holds {known[name].holds}, not a rig.")
    return name


def usual_name(form: str) -> str:
    """What a rig's file is called in a format, unless somebody says otherwise."""
    from camviz_clinic.files.registry import written

    return f"rig{Path(written()[form].file).suffix}"


def by_camera(words: Sequence[str], found: Callable[[Sequence[str]], list[Path]]) -> dict[str, list[Path]]:
    """The pictures of each camera, by their folders, or in a single folder by what stands before the last number.

    Raises Refusal for fewer than two cameras.
    """
    paths = found(words)
    folders = list(dict.fromkeys(path.parent for path in paths))
    if len(folders) > 1:
        called = told_apart(folders)
        return {called[folder]: [path for path in paths if path.parent == folder] for folder in folders}
    cameras: dict[str, list[Path]] = {}
    for path in paths:
        cameras.setdefault(re.sub(r"[-_ .]*\d+\D*$", "", path.stem) or "camera", []).append(path)
    if len(cameras) < 2:
        raise Refusal(
            "--rig: expected the pictures of at least two cameras, each in a folder of its own, or with names that "
            f"differ before their last number; these {len(paths)} look like those of one."
        )
    return cameras


def told_apart(folders: Sequence[Path]) -> dict[Path, str]:
    """The folders' names, and as much of what is above them as tells them apart."""
    for depth in range(1, max(len(folder.parts) for folder in folders) + 1):
        names = {folder: "/".join(folder.parts[-depth:]) or "." for folder in folders}
        if len(set(names.values())) == len(folders):
            return names
    return {folder: folder.as_posix() for folder in folders}


def rig_of_pictures(
    cameras: Mapping[str, list[Path]],
    board: Board,
    options: argparse.Namespace,
    look: Callable[[list[Path]], Detections],
    how: Mapping[str, Any],
) -> Calibration:
    """Detected, paired and solved for; raises CannotCalibrate and Refusal."""
    from camviz_clinic.calibration import CannotCalibrate
    from camviz_clinic.rigs import calibrate_rig, synchronised

    models, held = models_of(cameras, options), held_of(cameras, options)
    frames = synchronised(cameras)
    found = {}
    for name, paths in cameras.items():
        try:
            seen = look(paths)
        except CannotCalibrate as error:
            raise CannotCalibrate(f"{name}: {error}") from error
        found[name] = replace(seen, places=tuple(frames[name][place] for place in seen.places))
    with unknown_parameters_refused():
        return calibrate_rig(found, board, models, held=held, **how)


@contextmanager
def unknown_parameters_refused() -> Iterator[None]:
    """Raises Refusal for a parameter to fix that a model does not have."""
    try:
        yield
    except ValueError as error:
        if not str(error).startswith("fixed"):
            raise
        raise Refusal(f"{error}.") from error


def models_of(cameras: Iterable[str], options: argparse.Namespace) -> dict[str, str]:
    """The model of each camera."""
    from camviz_clinic.calibration import MODELS

    models = dict.fromkeys(cameras, options.model)
    for name, model in _assigned("--model-of", options.model_of, cameras):
        if model not in MODELS:
            raise Refusal(f"--model-of {name}: expected one of {', '.join(MODELS)}, got {model!r}.")
        models[name] = model
    return models


def held_of(cameras: Iterable[str], options: argparse.Namespace) -> dict[str, Camera]:
    """The cameras whose intrinsics files hold: that of the same name, or the only one."""
    held = {}
    for name, file in _assigned("--held", options.held, cameras):
        there = loaded(Path(file), None).cameras
        if name not in there and len(there) > 1:
            raise Refusal(f"--held {name}: {file} holds {', '.join(there)}, and none of that name.")
        held[name] = there.get(name) or next(iter(there.values()))
    return held


def _assigned(option: str, words: Sequence[str], cameras: Iterable[str]) -> list[tuple[str, str]]:
    pairs = []
    for word in words:
        name, equals, value = word.partition("=")
        if not equals or not value:
            raise Refusal(f"{option}: expected NAME={'FILE' if option == '--held' else 'MODEL'}, got {word!r}.")
        if name not in cameras:
            raise Refusal(f"{option}: expected one of the cameras {', '.join(cameras)}, got {name!r}.")
        pairs.append((name, value))
    return pairs


def placed(calibration: Calibration) -> list[str]:
    """Where the cameras stand, in sentences with their ±, and what ties them together."""
    import numpy as np

    from camviz_clinic.rigs import relative_pose, rig_of

    rig = rig_of(calibration)
    names, said = list(rig.cameras), []
    for name in names[1:]:
        beside = relative_pose(rig, name, names[0])
        x, y, z = (f"{1000 * value:.2f}".replace("-", "−") for value in beside.pose.translation)
        common = {other: int((_views(rig, name) & _views(rig, other)).sum()) for other in names if other != name}
        most = max(common, key=lambda other: common[other])
        tied = f"{common[most]} frame{'s' * (common[most] != 1)} tie{'s' * (common[most] == 1)} it to {most}"
        said.append(
            f"{name} stands {pm(1000 * beside.distance, 1000 * beside.distance_deviation)} mm from {names[0]} at "
            f"x = {x}, y = {y}, z = {z} mm, turned by "
            f"{pm(np.degrees(beside.angle), np.degrees(beside.angle_deviation))}°; {tied}."
        )
    return said


def _views(rig: Any, name: str) -> Any:
    return rig.used[name].any(axis=1)


def pm(value: float, sigma: float) -> str:
    """A value with its σ, both rounded by it."""
    from camviz_clinic.checks.summary import measured

    return measured(float(value), float(sigma))
