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
    opened = _plugin()
    try:
        with Path(path).open("rb") as file:
            turned = opened(file)
            _refuse_large(path, turned)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                turned.load()
    except PictureError:
        raise
    except Exception as error:  # of many kinds, from SyntaxError to OSError
        raise PictureError(path, "it is not a HEIC picture, or it is cut off or damaged") from error
    orientation, exif = turned.info.get("original_orientation") or 1, turned.getexif()
    picture = turned.transpose(_transposition(orientation)) if orientation in _UNDONE else turned
    exif[_ORIENTATION] = orientation
    written = Path(folder) / f"{Path(path).stem}.png"
    picture.convert("RGB").save(written, exif=exif, compress_level=1)
    return written


def _plugin() -> Any:
    """Pillow's reader of HEIC, which decodes nothing until it is asked to."""
    try:
        from pillow_heif import HeifImageFile
    except ImportError as error:
        raise HeicMissing(MISSING) from error
    return HeifImageFile


def _refuse_large(path: str | PathLike[str], picture: Any) -> None:
    megapixels, most = picture.width * picture.height / 1e6, most_megapixels()
    if megapixels > most:
        raise PictureError(
            path, f"it has {megapixels:.4g} megapixels, expected at most {most:g} (--megapixels allows more)"
        )


def _transposition(orientation: int) -> Any:
    from PIL import Image

    return Image.Transpose[_UNDONE[orientation]]
