"""Stills of phones in HEIC, as PNG that everything else reads: not turned, with their EXIF."""

from __future__ import annotations

import warnings
from os import PathLike
from pathlib import Path
from typing import Any

from camviz.colour.picture_files import PictureError, most_megapixels

MISSING = 'reading HEIC needs pillow-heif, which is not installed: pip install "camviz[heic]"'
_UNDONE = {2: "FLIP_LEFT_RIGHT", 3: "ROTATE_180", 4: "FLIP_TOP_BOTTOM", 5: "TRANSPOSE", 6: "ROTATE_90",
           7: "TRANSVERSE", 8: "ROTATE_270"}  # fmt: skip
_ORIENTATION = 0x0112


class HeicMissing(ImportError):  # noqa: N818 - it says what is the case
    """pillow-heif, which reads HEIC, is not installed; the message is one sentence.

    >>> str(HeicMissing(MISSING)).split(",")[0]
    'reading HEIC needs pillow-heif'
    """


def as_png(path: str | PathLike[str], folder: str | PathLike[str]) -> Path:
    """A HEIC still as a PNG of the same name in a folder.

    A phone's still asks to be turned as the phone was held. It is turned back here, as JPEG is left by `read_gray`: the
    rows and columns are the sensor's in every still.

    Args:
        path: The still.
        folder: Where the PNG goes.

    Returns: The PNG, which has the still's EXIF.
    Raises:
        HeicMissing: Without pillow-heif.
        PictureError: For a file that is no such still, is damaged, or too large.
    """
    turned = _opened(path)
    exif = turned.getexif()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            turned.load()
    except Exception as error:  # of many kinds, from OSError to ValueError
        raise PictureError(path, "the HEIC picture is cut off or damaged") from error
    orientation = turned.info.get("original_orientation") or 1
    picture = turned.transpose(_transposition(orientation)) if orientation in _UNDONE else turned
    exif[_ORIENTATION] = orientation
    written = Path(folder) / f"{Path(path).stem}.png"
    picture.convert("RGB").save(written, exif=exif, compress_level=1)
    return written


def _opened(path: str | PathLike[str]) -> Any:
    """Pillow's picture of the file, of which nothing is decoded yet."""
    from PIL import UnidentifiedImageError

    try:
        from pillow_heif import HeifImagePlugin
    except ImportError as error:
        raise HeicMissing(MISSING) from error
    try:
        picture = HeifImagePlugin.HeifImageFile(str(path))
    except (UnidentifiedImageError, SyntaxError, ValueError, EOFError, RuntimeError) as error:
        raise PictureError(path, "it is not a HEIC picture, or cut off") from error
    except OSError as error:
        raise PictureError(path, f"it cannot be read ({error.strerror or error})") from error
    megapixels = picture.width * picture.height / 1e6
    if megapixels > most_megapixels():
        raise PictureError(
            path,
            f"it has {megapixels:.4g} megapixels, expected at most {most_megapixels():g} (--megapixels allows more)",
        )
    return picture


def _transposition(orientation: int) -> Any:
    from PIL import Image

    return Image.Transpose[_UNDONE[orientation]]
