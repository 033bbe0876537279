"""`load_corners`: which program wrote these corners, and what do they show?"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np

from camviz.colour.picture_files import PictureError, picture_size
from camviz_clinic.calibration.boards.charuco import FEWEST
from camviz_clinic.calibration.detection import Detections, seen
from camviz_clinic.calibration.types import Board, CalibrationError, Mask
from camviz_clinic.files.corners.format import CornerFile, CornerFormat, Corners, Given
from camviz_clinic.files.corners.registry import corner_formats, corner_titles
from camviz_clinic.files.section import LARGEST_SIDE, Size
from camviz_clinic.files.text import refuse_no_file
from camviz_clinic.files.trees import shown

OUTSIDE = 1.0  # pixels beyond the border of the picture that a corner may lie, by the noise of its finder
ROUGH = 0.6  # of the steps along a row, how much they may change from one to the next; a lens changes them by less
ENDINGS = (".orpc", ".dsc")  # of a folder's files


@dataclass(frozen=True, eq=False)
class LoadedCorners:
    r"""Corners as if they had been found in pictures, the board they are of, and what a reader should know.

    Attributes:
        detections: For `calibrate`.
        board: For `calibrate`.
        notes: What a reader should know of the files.

    >>> from pathlib import Path
    >>> rows = [f"a.png {100 + 40 * column} {90 + 40 * row}" for row in range(3) for column in range(4)]
    >>> _ = Path("corners.vnl").write_text("\n".join(["# filename x y", *rows, "b.png - -"]))
    >>> load_corners(["corners.vnl"], shape=(4, 3), square_size=0.025, size=(640, 480)).detections.skipped
    (('b.png', 'none of its corners are known, 6 are needed'),)
    """

    detections: Detections
    board: Board
    notes: tuple[str, ...] = ()


def load_corners(
    paths: Sequence[str | PathLike[str]],
    *,
    shape: tuple[int, int] | None = None,
    square_size: float | None = None,
    size: Size | None = None,
    pictures: Sequence[str | PathLike[str]] = (),
    otherwise: Size | None = None,
) -> LoadedCorners:
    r"""Read the corners of one camera's pictures from one of the files that docs/formats.md lists.

    Shape, side of a square and size are each needed where the files do not hold them; what they hold must agree. A
    picture with fewer than six corners, or with corners on one line of the board, is skipped.

    Args:
        paths: The files, or a folder of them.
        shape: The board's inner corners as (columns, rows).
        square_size: Side of a square in metres.
        size: tuple of int, width and height of the pictures in pixels. It is also taken from `pictures`, or from a
            picture that the file names and that is there.
        pictures: Pictures of that size.
        otherwise: tuple of int, the size where nothing tells it.

    Returns: Pixels count from the centre of the first one, (0, 0).
    Raises: CalibrationError for everything else: one sentence with the file and, where there is one, the line.

    >>> from pathlib import Path
    >>> rows = [f"a.png {100 + 40 * column} {90 + 40 * row}" for row in range(3) for column in range(4)]
    >>> _ = Path("corners.vnl").write_text("\n".join(["# filename x y", *rows]))  # as mrcal has them
    >>> found = load_corners(["corners.vnl"], shape=(4, 3), square_size=0.025, size=(640, 480)).detections
    >>> found.corners[0, 5]  # the second row's second corner
    array([140., 130.])
    """
    if not paths:
        raise CalibrationError("paths: expected at least one file of corners, got none")
    files = [CornerFile(path) for path in _files([Path(path) for path in paths])]
    chosen = _format(files)
    if len(files) > 1 and not chosen.several:
        raise CalibrationError(f"{files[1].path}: expected one file of {chosen.title}, {files[0].path} is another")
    try:
        found = chosen.read(files, Given(shape, square_size))
    except CalibrationError as error:
        known = any(str(error).startswith(f"{file.path}: ") for file in files)
        raise error if known else CalibrationError(f"{files[0].path}: {error}") from error
    return _loaded(found, _size(found, files[0].path, size, [Path(picture) for picture in pictures], otherwise))


def _files(paths: Sequence[Path]) -> Iterator[Path]:
    """The files themselves; of a folder those that have one of the endings."""
    for path in paths:
        refuse_no_file(path)
        inside = sorted(each for each in path.iterdir() if each.suffix in ENDINGS) if path.is_dir() else [path]
        if not inside:
            raise CalibrationError(f"{path}: there are no {' or '.join(ENDINGS)} files in this folder")
        yield from inside


def _format(files: Sequence[CornerFile]) -> CornerFormat:
    """The one format that all the files are of."""
    formats = []
    for file in files:
        try:
            known = [each for each in corner_formats().values() if each.recognise(file)]
        except CalibrationError as error:
            raise CalibrationError(f"{file.path}: {error}") from error
        if not known:
            raise CalibrationError(
                f"{file.path}: line 1: expected {corner_titles()}, got {shown(file.head[0] if file.head else '')}"
            )
        formats.append(known[0])
    for file, each in zip(files, formats, strict=True):
        if each is not formats[0]:
            raise CalibrationError(
                f"{file.path}: expected {formats[0].title} as {files[0].path} is, this is {each.title}"
            )
    return formats[0]


def _size(found: Corners, path: Path, given: Size | None, pictures: Sequence[Path], otherwise: Size | None) -> Size:
    """(width, height) of the pictures: the file's, the caller's, or that of a picture; all that is said must agree."""
    if given is not None and not all(1 <= side <= LARGEST_SIDE for side in given):
        raise CalibrationError(f"size: expected (width, height), each from 1 to {LARGEST_SIDE} pixels, got {given}")
    if found.size and given and found.size != given:
        raise CalibrationError(
            f"{path}: its pictures have {_times(found.size)} pixels, and --size says {_times(given)}"
        )
    size = found.size or given
    if size:
        return size
    beside = [folder / name for name in found.pictures for folder in (path.parent, Path()) if "\0" not in name]
    for each in [*pictures, *beside]:
        with suppress(PictureError):
            return picture_size(each)
    if otherwise:
        return otherwise
    raise CalibrationError(
        f"{path}: it does not hold the size of the pictures, and none of them is at hand: give --size WxH"
    )


def _loaded(found: Corners, size: Size) -> LoadedCorners:
    """What can be calibrated from, and what is skipped and why."""
    _refuse_other_rows(found)
    kept, skipped = {}, []
    for name, corners in found.pictures.items():
        _refuse_outside(found, name, size)
        there = seen(corners)
        if there.sum() < FEWEST:
            count = int(there.sum())
            skipped.append(
                (name, f"{count or 'none'} of its corners {'is' if count == 1 else 'are'} known, {FEWEST} are needed")
            )
        elif _on_one_line(found.board, there):
            skipped.append((name, "its corners lie on one line of the board"))
        else:
            kept[name] = corners
    if not kept:
        raise CalibrationError(
            f"{next(iter(found.files.values()))}: expected pictures with {FEWEST} corners and more, got none"
        )
    places = tuple(place for place, name in enumerate(found.pictures) if name in kept)
    detections = Detections(tuple(kept), np.stack(list(kept.values())), *size, tuple(skipped), places)
    return LoadedCorners(detections, found.board, found.notes)


def _refuse_outside(found: Corners, name: str, size: Size) -> None:
    """CalibrationError for a corner outside of the picture."""
    corners = found.pictures[name]
    with np.errstate(invalid="ignore"):
        outside = ((corners < -0.5 - OUTSIDE) | (corners > np.array(size) - 0.5 + OUTSIDE)).any(axis=-1)
    if outside.any():
        first = int(np.flatnonzero(outside)[0])
        u, v = corners[first]
        raise CalibrationError(
            f"{found.files[name]}: line {found.lines[name][first]}: expected a corner inside a picture of "
            f"{_times(size)} pixels, got ({u:g}, {v:g})"
        )


def _refuse_other_rows(found: Corners) -> None:
    """CalibrationError where the corners lie in rows of another length than the board has.

    Along a row the steps from corner to corner change little; where a row ends in the middle of another, they jump.
    """
    board = found.board
    views = np.stack(list(found.pictures.values()))

    def roughness(columns: int) -> float:
        steps = np.diff(views.reshape(len(views), -1, columns, 2), axis=2)
        jumps = np.linalg.norm(np.diff(steps, axis=2), axis=-1)
        known = np.isfinite(jumps)
        typical = np.nanmean(np.linalg.norm(steps, axis=-1)) if np.isfinite(steps).any() else 0.0
        return float(jumps[known].mean() / typical) if known.any() and typical else np.inf

    if not ROUGH < roughness(board.columns) < np.inf:
        return
    count = board.columns * board.rows
    best = min((columns for columns in range(3, count // 2 + 1) if count % columns == 0), key=roughness, default=0)
    if best and roughness(best) < ROUGH:
        path = next(iter(found.files.values()))
        raise CalibrationError(
            f"{path}: expected corners in rows of {board.columns}, they lie in rows of {best}: give --board "
            f"{best}x{count // best}"
        )


def _on_one_line(board: Board, there: Mask) -> bool:
    """Whether the corners that were seen (columns * rows,) lie on one line of the board."""
    places = board.corners[there, :2] / board.square_size
    return bool(np.linalg.matrix_rank(places - places[0], tol=1e-6) < 2)


def _times(size: Size) -> str:
    return f"{size[0]}×{size[1]}"
