"""Light fields from folders of pictures, as archives publish them and as a telephone on a ruler takes them."""

from __future__ import annotations

import re
from configparser import ConfigParser
from configparser import Error as ConfigError
from math import inf, isqrt, nan
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.picture_files import read_picture
from camviz.lightfields.field import LightField

_HCI = re.compile(r"input_Cam(\d+)\.png")
_STANFORD = re.compile(r"out_(\d+)_(\d+)_(-?[\d.]+?)_(-?[\d.]+?)_?\.png")
_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp")

Place = tuple[int, int]


def read_folder(
    path: str | Path,
    rows: int | None = None,
    *,
    width: int | None = None,
    baseline: float = nan,
    focal_length: float = nan,
    focus_distance: float = inf,
) -> LightField:
    """The light field in a folder of pictures, as sRGB bytes.

    Three layouts are known. The 4D Light Field Benchmark: `input_Cam000.png` … row by row, and parameters.cfg, which
    gives baseline, focal length and focus distance. The Stanford Light Field Archive: `out_ROW_COLUMN_y_x_.png`; the
    places in the names have no unit that holds for all, and in some sets x falls from left to right, which turns the
    sign of every disparity. Any other pictures are taken in the order of their names, row by row.

    Args:
        path: The folder.
        rows: How many rows of views the other pictures make, 1 for a camera moved along a ruler; by default they make a
            square.
        width: Makes the views smaller: so many pixels wide.
        baseline, focal_length, focus_distance: As of `LightField`, the focal length in pixels of the views as returned:
            what the folder does not tell itself.

    Returns: LightField with uint8 views.

    Raises:
        ValueError: For a folder that is not there or empty, a view that is missing or cannot be read, views of
            different sizes, or a number of views that makes no grid.

    Source: K. Honauer et al., A dataset and evaluation methodology for depth estimation on 4D light fields, ACCV 2016.

    Three pictures from along a ruler, made up:

    >>> import cv2
    >>> for place in range(3):
    ...     assert cv2.imwrite(f"IMG_{place}.png", np.zeros((48, 64, 3), np.uint8))
    >>> field = read_folder(".", rows=1, baseline=0.01)
    >>> field.rows, field.columns, field.width, field.height
    (1, 3, 64, 48)
    """
    folder = Path(path)
    if not folder.is_dir():
        raise ValueError(f"{folder} is not a folder")
    places = _places(folder, rows)
    views, shrunk = _read(places, width)
    if not (folder / "parameters.cfg").is_file():
        return LightField(views, baseline, focal_length, focus_distance)
    told = _parameters(folder / "parameters.cfg")
    return LightField(views, told[0], told[1] * shrunk, told[2])


def _places(folder: Path, rows: int | None) -> dict[Place, Path]:
    """Which file holds the view in which row and column, complete."""
    names = sorted((file for file in folder.iterdir() if file.suffix.lower() in _PICTURES), key=_natural)
    if stanford := {(int(m[1]), int(m[2])): file for file in names if (m := _STANFORD.fullmatch(file.name))}:
        return _complete(stanford, folder)
    if hci := {int(m[1]): file for file in names if (m := _HCI.fullmatch(file.name))}:
        return _in_rows(hci, rows, folder)
    return _in_rows(dict(enumerate(names)), rows, folder)


def _natural(file: Path) -> list[tuple[int, str]]:
    """Names in the order in which a person counts: IMG_9 before IMG_10."""
    return [(int(part), "") if part.isdigit() else (0, part) for part in re.split(r"(\d+)", file.name)]


def _in_rows(numbered: dict[int, Path], rows: int | None, folder: Path) -> dict[Place, Path]:
    """Numbered views in a grid of so many rows, or in a square."""
    if not numbered:
        raise ValueError(f"{folder} holds no pictures ({', '.join(_PICTURES)})")
    missing = sorted(set(range(max(numbered) + 1)) - set(numbered))
    if missing:
        raise ValueError(f"{folder} lacks view {missing[0]:03d}, and has views up to {max(numbered):03d}")
    count = len(numbered)
    tall = isqrt(count) if rows is None else rows
    if rows is None and tall * tall != count:
        raise ValueError(f"{folder} holds {count} pictures, which make no square: give rows, 1 for a single row")
    if tall < 1 or count % tall:
        raise ValueError(f"{folder} holds {count} pictures, which do not make {tall} equal rows")
    return {divmod(number, count // tall): file for number, file in numbered.items()}


def _complete(places: dict[Place, Path], folder: Path) -> dict[Place, Path]:
    wide, tall = max(column for _, column in places) + 1, max(row for row, _ in places) + 1
    for row in range(tall):
        for column in range(wide):
            if (row, column) not in places:
                raise ValueError(f"{folder} lacks the view out_{row:02d}_{column:02d}_…, of {tall} × {wide}")
    return places


def _read(places: dict[Place, Path], width: int | None) -> tuple[NDArray[np.uint8], float]:
    """The views (v, u, height, width, 3), and how much smaller than their files they are."""
    views: NDArray[np.uint8] | None = None
    first, scale = next(iter(places.values())), 1.0
    taken: tuple[int, ...] = ()
    for (v, u), file in places.items():
        picture = _picture(file)
        taken = taken or picture.shape
        if picture.shape != taken:
            sizes = f"{picture.shape[1]} × {picture.shape[0]} pixels and {first.name} {taken[1]} × {taken[0]}"
            raise ValueError(f"views must have one size, but in {file.parent} {file.name} has {sizes}")
        if width is not None:
            scale = width / taken[1]
            size = width, max(1, round(scale * taken[0]))
            picture = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA))
        if views is None:
            v_most, u_most = (max(axis) + 1 for axis in zip(*places, strict=True))
            views = np.empty((v_most, u_most, *picture.shape), np.uint8)
        views[v, u] = picture
    assert views is not None  # there is at least one place
    return views, scale


def _picture(file: Path) -> NDArray[np.uint8]:
    return np.ascontiguousarray(read_picture(file, cv2.IMREAD_COLOR)[..., ::-1])


def _parameters(file: Path) -> tuple[float, float, float]:
    """Baseline in metres, focal length in pixels of the files, focus distance in metres."""
    told = ConfigParser()
    try:
        told.read_string(file.read_text(encoding="utf-8"))
        inner, outer = told["intrinsics"], told["extrinsics"]
        pixels = max(float(inner["image_resolution_x_px"]), float(inner["image_resolution_y_px"]))
        focal = float(inner["focal_length_mm"]) / float(inner["sensor_size_mm"]) * pixels
        return float(outer["baseline_mm"]) / 1000, focal, float(outer["focus_distance_m"])
    except (ConfigError, KeyError, ValueError, ZeroDivisionError, UnicodeDecodeError) as error:
        what = f"it lacks {error.args[0]}" if isinstance(error, KeyError) else str(error).splitlines()[0]
        raise ValueError(f"{file} does not tell focal length, baseline and focus distance: {what}") from error
