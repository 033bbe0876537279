"""How well rigs are calibrated from other people's pictures, beside other programs, and the truth where it is known.

    CAMVIZ_FIELD=~/field python tools/benchmarks/rigs_public.py             runs every set, as Markdown tables
    CAMVIZ_FIELD=~/field python tools/benchmarks/rigs_public.py NAME …      runs these sets
    CAMVIZ_FIELD=~/field python tools/benchmarks/rigs_public.py --hashes    prints the hash of every set

CAMVIZ_FIELD is the folder of tools/benchmarks/field.py; rigs_public.toml says what is in it. The corners are found
once, by camviz, kept in CAMVIZ_FIELD/found and given to all programs. Of films every frame is looked at. The films of
`mirrored` cameras are turned round first. Where the manifest names a `quick` finder, the board is looked for only
where this one finds it.

Every fifth frame is held out, the others give the rig: five times, until each frame was held out once. In a held-out
frame that two cameras or more see, only the board's one pose is fitted, the rig and its lenses held. The held-out error
is the RMS distance of all corners of these frames, in pixels, the board flat for everyone. Behind the stroke it is that
of corners within WILD pixels in the solutions of all programs, which a wrongly found corner does not rule. Of films a
second table has the error of all corners apart for frames in which the board moves by less or more than FAST pixels
from one to the next: a moving board is in another place for each camera, and for each row of a rolling shutter.

A program fails in a fold in which it gives no rig, or one that is off by more than WILD pixels in the median. Such a
program has no number, and has no say in which corners are kept.

OpenCV solves for each camera by all its corners (calibrateCamera), and for their places by the corners that all cameras
of a frame see (calibrateMultiview). Its documentation has missing corners given to the latter as (-1, -1), but 5.0.0
takes these for corners: one of them in 720 moves the focal length of a virtual camera from 900 to 171 pixels.
"""

from __future__ import annotations

import hashlib
import os
import re
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from field import FAILURES, FOLDS
from kernel import table
from rig_programs import MODEL, PROGRAMS, Found, Rig
from rigs import pairs

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Detections, detect
from camviz_clinic.calibration.detection import seen
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.types import Board
from camviz_clinic.rigs import calibrate_rig, relative_pose, rig_of, synchronised
from camviz_clinic.rigs.adjustment import RigAdjustment
from camviz_clinic.rigs.start import board_poses

MANIFEST = Path(__file__).with_name("rigs_public.toml")
WILD = 5.0  # pixels
FAST = 25.0  # pixels
FEWEST = 4  # corners that make a view
NORMAL_95 = 1.96


@dataclass(frozen=True)
class Set:
    """A rig's pictures or films, as rigs_public.toml names them."""

    name: str
    repository: str
    commit: str
    path: str
    licence: str
    board: str
    square_mm: float
    sha256: str
    marker_mm: float = 0
    dictionary: str = ""
    truth: str = ""
    finder: str = "auto"  # as of --finder
    quick: str = ""  # another finder, which says where the board is looked for
    mirrored: tuple[str, ...] = ()  # cameras whose films are mirrored

    def files(self, pattern: str) -> list[Path]:
        """The files of a pattern, in order."""
        return sorted(Path(os.environ["CAMVIZ_FIELD"], self.repository.replace("/", "+")).glob(pattern))

    @property
    def hash(self) -> str:
        """SHA-256 of the lines "SHA-256 of a file, two spaces, its folders' and its own name", in order."""
        root = Path(os.environ["CAMVIZ_FIELD"], self.repository.replace("/", "+"))
        files = self.files(self.path) + (self.files(self.truth) if self.truth else [])
        lines = [f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(root)}\n" for path in files]
        return hashlib.sha256("".join(lines).encode()).hexdigest()

    @property
    def of_board(self) -> Board:
        """What the cameras saw."""
        columns, rows = map(int, self.board.split("x"))
        markers = {"marker_size": self.marker_mm / 1000, "dictionary": self.dictionary} if self.dictionary else {}
        return Board(columns, rows, self.square_mm / 1000, **markers)

    def found(self) -> Found:
        """The corners of every camera, with frames as places."""
        kept = Path(os.environ["CAMVIZ_FIELD"], "found", f"rig-{self.name}-{self.hash[:12]}-{self.finder}.npz")
        if not kept.exists():
            kept.parent.mkdir(exist_ok=True)
            keep(kept, self.looked_at())
        with np.load(kept) as all_cameras:
            found = {}
            for name in all_cameras["names"]:
                pictures, corners, size, places = (
                    all_cameras[f"{name}.{what}"] for what in ("pictures", "corners", "size", "places")
                )
                width, height = map(int, size)
                found[str(name)] = Detections(
                    tuple(map(str, pictures)), corners, width, height, places=tuple(map(int, places))
                )
            return found

    def looked_at(self) -> Found:
        """What `camviz calibrate --rig` finds in the folders of all cameras."""
        with tempfile.TemporaryDirectory() as room:
            cameras: dict[str, list[Path]] = {}
            for path in self.files(self.path):
                if path.suffix == ".mp4":
                    cameras[path.stem] = stills(path, Path(room, path.stem), path.stem in self.mirrored)
                else:
                    cameras.setdefault(path.parent.parent.name, []).append(path)
            frames = synchronised(cameras)
            found = {}
            for name, paths in cameras.items():
                one = detect(paths, self.of_board, finder=self.quick or self.finder, workers=1)
                if self.quick:
                    one = found_again(paths, one, self.of_board, self.finder)
                found[name] = replace(one, places=tuple(frames[name][place] for place in one.places))
            return found

    def placed(self) -> dict[str, RigidTransform]:
        """world_from_cam by camera, where the set tells the truth."""
        poses = {}
        for path in self.files(self.truth) if self.truth else []:
            matrix = np.loadtxt(path)
            number = re.findall("[0-9]+", path.stem)[-1]
            poses[f"camera{number}"] = RigidTransform.from_components(
                matrix[:3, 3], Rotation.from_matrix(matrix[:3, :3])
            )
        return poses


def found_again(paths: list[Path], quick: Detections, board: Board, finder: str) -> Detections:
    """The views in which a finder finds the board too, in the part of the picture where a quick one found it."""
    kept, corners = [], []
    for view, place in enumerate(quick.places):
        gray = cv2.imread(str(paths[place]), cv2.IMREAD_GRAYSCALE)
        rough = quick.corners[view]
        around = np.ptp(rough, axis=0).max() / 2
        left, top = np.maximum(rough.min(axis=0) - around, 0).astype(int)
        right, bottom = np.ceil(rough.max(axis=0) + around).astype(int)
        one = find_corners(np.ascontiguousarray(gray[top:bottom, left:right]), board, finder)
        if one is not None:
            kept.append(view)
            corners.append(one + [left, top])
    return replace(quick.only(kept), corners=np.stack(corners))


def stills(film: Path, folder: Path, mirrored: bool) -> list[Path]:
    """Every frame of a film as a picture with the frame's number, right way round."""
    folder.mkdir()
    reader, paths = cv2.VideoCapture(str(film)), []
    while (frame := reader.read()[1]) is not None:
        paths.append(folder / f"{len(paths):04d}.png")
        cv2.imwrite(str(paths[-1]), cv2.flip(frame, 1) if mirrored else frame)
    return paths


def keep(path: Path, found: Found) -> None:
    """Write the corners to an NPZ file."""
    arrays: dict[str, object] = {"names": list(found)}
    for name, each in found.items():
        arrays |= {
            f"{name}.pictures": each.pictures,
            f"{name}.corners": each.corners,
            f"{name}.size": (each.width, each.height),
            f"{name}.places": each.places,
        }
    np.savez(path, **arrays)


# The held-out error ---------------------------------------------------------------------------------------------------


def only(found: Found, frames: set[int]) -> Found:
    """The views of some frames."""
    return {name: each.only([i for i, place in enumerate(each.places) if place in frames])
            for name, each in found.items()}  # fmt: skip


def shared(found: Found) -> list[int]:
    """The frames that two cameras or more see."""
    times: dict[int, int] = {}
    for each in found.values():
        for place in each.places:
            times[place] = times.get(place, 0) + 1
    return sorted(place for place, count in times.items() if count >= 2)


def held_out_squares(rig: Rig, found: Found, board: Board) -> np.ndarray:
    """Squared errors (frames, all cameras' corners) in px²; NaN where none was seen, infinite where none has an image.

    The pose of each frame is refined from what every camera that sees the board says, and the best of these is taken.
    """
    frames = shared(found)
    corners = {name: np.full((len(frames), len(board.corners), 2), np.nan) for name in rig}
    for name, each in found.items():
        for place, view in zip(each.places, each.corners, strict=True):
            if place in frames:
                corners[name][frames.index(place)] = view
    there = seen(np.concatenate([corners[name] for name in rig], axis=1))
    best = np.where(there, np.inf, np.nan)
    nothing = {name: np.zeros(each.shape[:2], dtype=bool) for name, each in corners.items()}
    for name, camera in rig.items():
        views = np.flatnonzero(seen(corners[name]).sum(axis=1) >= FEWEST)
        if not len(views):
            continue
        poses, _ = board_poses(camera.at(RigidTransform.identity()), board, corners[name][views])
        theirs, aside = ({other: each[views] for other, each in what.items()} for what in (corners, nothing))
        start = camera.world_from_cam * poses
        problem = RigAdjustment(board, rig, theirs, start, dict.fromkeys(rig, ()), aside).refined(only_poses=True)
        off = np.concatenate([problem.residuals[other] for other in rig], axis=1)
        squares = np.where(there[views], np.sum(np.nan_to_num(off, nan=np.inf) ** 2, axis=-1), np.nan)
        better = np.nansum(squares, axis=1) < np.nansum(best[views], axis=1)
        best[views[better]] = squares[better]
    return best


def first_world(rig: Rig) -> Rig:
    """The same rig in the frame of its first camera."""
    here = next(iter(rig.values())).cam_from_world
    return {name: camera.at(here * camera.world_from_cam) for name, camera in rig.items()}


def folds(found: Found, board: Board) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, int]]:
    """By program the squared errors over all folds, the seconds of a solution, and in how many folds it fails.

    The errors are of the same corners for every program, and infinite in a fold where it fails.
    """
    frames = shared(found)
    every = {place for each in found.values() for place in each.places}
    squares: dict[str, list[np.ndarray]] = {name: [] for name in PROGRAMS}
    seconds, failed = dict.fromkeys(PROGRAMS, 0.0), dict.fromkeys(PROGRAMS, 0)
    for first in range(FOLDS):
        out = set(frames[first::FOLDS])
        for name, solve in PROGRAMS.items():
            start = time.perf_counter()
            try:
                rig = solve(only(found, every - out), board)
                seconds[name] += (time.perf_counter() - start) / FOLDS
                off = held_out_squares(first_world(rig), only(found, out), board)
                if not np.nanmedian(off) <= WILD**2:
                    raise ValueError(f"its median error is {np.sqrt(np.nanmedian(off)):.3g} px")
            except FAILURES as failure:
                print(f"  {name}, fold {first + 1}: {str(failure)[:200]}", file=sys.stderr, flush=True)
                off = np.full((len(out), len(found) * len(board.corners)), np.inf)
                failed[name] += 1
            squares[name].append(off)
    return {name: np.concatenate(each) for name, each in squares.items()}, seconds, failed


def row(
    one: Set, found: Found, squares: dict[str, np.ndarray], seconds: dict[str, float], failed: dict[str, int]
) -> list[str]:
    """The line of a set in the table."""
    solved = {name: each for name, each in squares.items() if not failed[name]}
    corners = np.isfinite(next(iter(solved.values()))).sum() if solved else 0
    tame = np.all([each <= WILD**2 for each in solved.values()], axis=0)
    rms = {name: float(np.sqrt(np.nanmean(each))) for name, each in solved.items()}
    kept = {name: float(np.sqrt(np.mean(each[tame]))) for name, each in solved.items()}
    cells = [f"{rms[name]:.3f} / {kept[name]:.3f} ({seconds[name]:.1f} s)" if name in solved else
             f"fails in {failed[name]} of {FOLDS}" for name in PROGRAMS]  # fmt: skip
    others = [name for name in solved if name != "camviz"]
    behind = [f"{100 * (each['camviz'] / min(each[name] for name in others) - 1):+.1f}" for each in (rms, kept)
              if others and "camviz" in solved]  # fmt: skip
    views = sum(len(each.places) for each in found.values())
    wild = f"{1 - tame.sum() / corners:.1%}" if corners else "–"
    size = next(iter(found.values()))
    told = f"{len(found)}, {views} views, {len(shared(found))} frames shared, {size.width} × {size.height}"
    return [one.name, told, *cells, f"{' / '.join(behind)} %" if behind else "–", wild]


def moves(found: Found) -> np.ndarray:
    """By how many pixels the board moves from each shared frame to the next or from the last one, in order of folds.

    It is the median of a view's corners in the camera where this is most; NaN where the frames beside were not seen.
    """
    views = [dict(zip(each.places, each.corners, strict=True)) for each in found.values()]
    frames = shared(found)
    most = []
    for frame in (each for first in range(FOLDS) for each in frames[first::FOLDS]):
        beside = [each[other] - each[frame] for each in views for other in (frame - 1, frame + 1)
                  if frame in each and other in each]  # fmt: skip
        most.append(max((float(np.nanmedian(np.linalg.norm(one, axis=-1))) for one in beside), default=np.nan))
    return np.array(most)


def by_motion(one: Set, found: Found, squares: dict[str, np.ndarray], failed: dict[str, int]) -> list[str]:
    """The line of a film in the second table: the held-out errors in frames below FAST, and from there on."""
    fast = moves(found) >= FAST
    cells = [" / ".join(f"{np.sqrt(np.nanmean(each[which])):.3f}" for which in (~fast, fast) if which.any())
             if not failed[name] else "–" for name, each in squares.items()]  # fmt: skip
    return [one.name, f"{np.sum(~fast)} / {np.sum(fast)}", *cells]


# Beside the truth -----------------------------------------------------------------------------------------------------


def beside_truth(one: Set, found: Found) -> list[str]:
    """How far the relative poses of all frames are off, and how many of their numbers are within their ±."""
    truth = one.placed()
    solved = calibrate_rig(found, one.of_board, MODEL, board_warp="auto")
    adjustment, off = rig_of(solved), []
    for a, b in pairs(list(truth)):
        beside = relative_pose(adjustment, b, a)
        off.append(error(truth, a, b, beside.pose) / beside.deviations)
    cells = []
    for name, solve in PROGRAMS.items():
        try:
            rig = solved.cameras if name == "camviz" else solve(found, one.of_board)
        except FAILURES:
            cells.append("–")
            continue
        wrong = np.array([error(truth, a, b, rig[a].cam_from_world * rig[b].world_from_cam)
                          for a, b in pairs(list(truth))])  # fmt: skip
        turn, shift = (np.linalg.norm(part, axis=1) for part in (wrong[:, :3], wrong[:, 3:]))
        cells.append(f"{1000 * np.median(shift):.2f} / {1000 * shift.max():.2f} mm, {np.degrees(np.median(turn)):.4f}°")
    ratios = np.abs(off)
    within = f"{np.mean(ratios < 3):.0%} / {np.mean(ratios < NORMAL_95):.0%} of {ratios.size}"
    return [one.name, *cells, within, f"{np.sqrt(np.mean(ratios**2)):.2f}"]


def error(truth: dict[str, RigidTransform], a: str, b: str, found: RigidTransform) -> np.ndarray:
    """(6,), the turn in radians and the shift in metres of b in the frame of a."""
    true = truth[a].inv() * truth[b]
    return np.concatenate([(found.rotation * true.rotation.inv()).as_rotvec(), found.translation - true.translation])


def sets() -> list[Set]:
    """All sets of the manifest."""
    return [Set(**each) for each in tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["set"]]


def main(arguments: list[str]) -> None:
    """Run what is there."""
    cv2.setNumThreads(1)
    names = {each for each in arguments if not each.startswith("-")}
    lines, films, true = [], [], []
    for one in sets():
        if names and one.name not in names:
            continue
        if not one.files(one.path):
            print(f"{one.name}: not there", file=sys.stderr)
        elif "--hashes" in arguments:
            print(one.name, len(one.files(one.path)), one.hash)
        elif one.hash != one.sha256:
            print(f"{one.name}: left out, its files have the hash {one.hash}, not {one.sha256}", file=sys.stderr)
        else:
            try:
                found = one.found()
            except FAILURES as failure:
                print(f"{one.name}: {failure}", file=sys.stderr, flush=True)
                continue
            squares, seconds, failed = folds(found, one.of_board)
            lines.append(row(one, found, squares, seconds, failed))
            print(" | ".join(lines[-1]), file=sys.stderr, flush=True)
            if one.path.endswith(".mp4"):
                films.append(by_motion(one, found, squares, failed))
            if one.truth:
                true.append(beside_truth(one, found))
    if lines:
        head = ["set", "cameras", *PROGRAMS, "camviz against the best of the others", f"corners beyond {WILD:g} px"]
        print(table(head, lines))
    if films:
        print(table(["film", f"frames below / from {FAST:g} px", *PROGRAMS], films))
    if true:
        print(table(["set", *PROGRAMS, "within 3 / 1.96 ±", "RMS in ±"], true))


if __name__ == "__main__":
    main(sys.argv[1:])
