"""Pictures from files, the one place where they are read.

A file is taken for what its header says before anything of it is decoded: a few kilobytes can announce gigabytes, and
OpenCV would make room for them. Imports little, because every process that looks for boards reads pictures.
"""

from __future__ import annotations

import os
import re
import stat
import struct
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from io import BytesIO
from os import PathLike
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

import cv2
import numpy as np
from numpy.typing import NDArray

MEGAPIXELS = 64.0  # what is decoded unless the reader asks for more; finders take 10 bytes for each pixel
VARIABLE = "CAMVIZ_MEGAPIXELS"
MOST_MEGAPIXELS = 1000.0
BYTES_A_PIXEL = 16  # four channels of 32 bits, uncompressed
BESIDE = 64 * 2**20  # bytes for what cameras put beside the pixels: thumbnails, profiles, maker's notes
HEAD = 2**16

_FORMATS = ("JPEG", "PNG", "BMP", "GIF", "PPM", "WEBP", "JPEG2000", "SUN", "AVIF", "TIFF")  # that OpenCV reads, too
_NAMES = {"MPO": "JPEG", "PPM": "PNM", "WEBP": "WebP", "JPEG2000": "JPEG 2000", "SUN": "Sun raster"}
_EXIF = 0x8769  # the tag of EXIF's own directory
_WIDTH, _HEIGHT = 256, 257  # TIFF's tags
_HDR_SIZE = re.compile(rb"\n\n[-+]Y (\d{1,9}) [-+]X (\d{1,9})\n")
_EXR_WINDOW = re.compile(rb"dataWindow\0box2i\0\x10\0\0\0(.{16})", re.DOTALL)
_END_OF_JPEG = b"\xff\xd9"
_PILLOW = Lock()  # held while its bound is lifted


class PictureError(ValueError):
    """A file that is no picture which can be used; `why` in words without its name, the message with it."""

    def __init__(self, path: str | PathLike[str], why: str) -> None:
        super().__init__(f"{os.fspath(path)}: {why}")
        self.why = why


def read_picture(path: str | PathLike[str], flags: int = cv2.IMREAD_UNCHANGED) -> NDArray[Any]:
    """The picture in a file, as cv2.imdecode gives it with `flags`: (height, width) or (height, width, channels), BGR.

    Raises PictureError, in one sentence, for a file that is missing, empty, no picture, cut off, damaged, or has more
    pixels than `most_megapixels()`.
    """
    with _opened(path) as file:
        kind, (width, height) = _header(path, file)
        _refuse_large(path, width, height, os.fstat(file.fileno()).st_size)
        file.seek(0)
        content = file.read()
    if _cut_off(kind, content):
        raise PictureError(path, f"the {kind} picture is cut off: it ends after {len(content):,} bytes, before its end")
    picture = _decoded(content, flags)
    if picture is None:
        raise PictureError(path, f"the {kind} picture is cut off, damaged, or of a kind that OpenCV does not read")
    return picture


def read_gray(path: str | PathLike[str]) -> NDArray[np.uint8]:
    """A picture's brightness (height, width) not turned as its file may ask.

    More than 8 bits are scaled to the brightest pixel. Raises PictureError as `read_picture` does.
    """
    gray = read_picture(path, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION)
    if gray.dtype == np.uint8:
        return gray
    if gray.dtype.kind == "f":
        gray = np.nan_to_num(gray, posinf=0, neginf=0)
    scale = 255 / max(float(gray.max()), 1e-9)
    return np.stack([np.clip(row.astype(np.float64) * scale, 0, 255).astype(np.uint8) for row in gray])


def picture_size(path: str | PathLike[str]) -> tuple[int, int]:
    """(width, height) in pixels as the header says, not turned as the file may ask; nothing is decoded.

    Raises PictureError for a file that is missing, empty or no picture.
    """
    with _opened(path) as file:
        return _header(path, file)[1]


def picture_kind(path: str | PathLike[str]) -> str:
    """ "PNG", "JPEG", "TIFF" …: what the file is, whatever its name ends in. Raises PictureError as `picture_size`."""
    with _opened(path) as file:
        return _header(path, file)[0]


def picture_exif(path: str | PathLike[str]) -> Mapping[int, Any]:
    """The EXIF tags of a picture by their numbers, as Pillow reads them; empty where it has none, or damaged ones.

    Raises PictureError as `picture_size`.
    """
    with _opened(path) as file:
        _header(path, file)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                exif = _lazily_opened(file).getexif()
                return {**exif, **exif.get_ifd(_EXIF)}
        except Exception:  # of many kinds, from SyntaxError to struct.error
            return {}


def most_megapixels() -> float:
    """How many megapixels a picture may have: what CAMVIZ_MEGAPIXELS says, else 64. PictureError for nonsense."""
    said = os.environ.get(VARIABLE, "")
    try:
        most = float(said or MEGAPIXELS)
    except ValueError:
        most = np.nan
    if not 0 < most <= MOST_MEGAPIXELS:
        raise PictureError(VARIABLE, f"expected megapixels, above 0 and at most {MOST_MEGAPIXELS:g}, got {said!r}")
    return most


@contextmanager
def allowing(megapixels: float | None) -> Iterator[None]:
    """Pictures of so many megapixels, here and in the processes that are started; None leaves things as they are."""
    before = os.environ.get(VARIABLE)
    if megapixels is not None:
        os.environ[VARIABLE] = f"{megapixels:g}"
    try:
        yield
    finally:
        if megapixels is not None:
            os.environ.pop(VARIABLE)
            os.environ.update({} if before is None else {VARIABLE: before})


# What a file is -------------------------------------------------------------------------------------------------------


@contextmanager
def _opened(path: str | PathLike[str]) -> Iterator[BinaryIO]:
    """A regular file that holds something: a pipe would be waited for, and a device might never end."""
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            what = "a folder" if stat.S_ISDIR(status.st_mode) else "no regular file"
            raise PictureError(path, f"expected a picture, this is {what}")
        if status.st_size == 0:
            raise PictureError(path, "it is empty, expected a picture")
        with Path(path).open("rb") as file:
            yield file
    except OSError as error:
        raise PictureError(path, f"it cannot be read ({error.strerror or error})") from error
    except ValueError as error:
        if isinstance(error, PictureError):
            raise
        raise PictureError(repr(path), "this is not a file name") from error  # a NUL in it


def _header(path: str | PathLike[str], file: BinaryIO) -> tuple[str, tuple[int, int]]:
    """What kind of picture a file is, and its width and height: as Pillow says where it knows the kind."""
    head = file.read(HEAD)
    try:
        if head.startswith((b"#?RADIANCE", b"#?RGBE")):
            kind, size = "HDR", _of_hdr(head)
        elif head.startswith(b"v/1\x01"):
            kind, size = "EXR", _of_exr(head)
        elif head.startswith((b"II*\0", b"II+\0", b"MM\0*", b"MM\0+")):
            kind, size = "TIFF", _of_tiff(file)
        else:
            picture = _lazily_opened(file)
            kind, size = _NAMES.get(picture.format, picture.format), picture.size
    except Exception as error:  # of many kinds, from SyntaxError to struct.error
        raise PictureError(path, f"it is not a picture that can be read, it begins with {_shown(head)}") from error
    if min(size) < 1:
        raise PictureError(path, f"the header of the {kind} picture is damaged: it says {size[0]} × {size[1]} pixels")
    return kind, size


def _shown(head: bytes) -> str:
    """How a file begins: as words where it is text, else as hexadecimal bytes, which may be those of a picture."""
    words = head[:12].decode("ascii", "replace")
    return repr(words) if words.isascii() and words.isprintable() else f"{head[:8].hex(' ')} and may be cut off"


def _lazily_opened(file: BinaryIO) -> Any:
    """Pillow's picture of a file, of which nothing is decoded. Raises an exception of many kinds where it has none.

    Its bound on pixels is lifted for that moment: it would refuse a large picture and not say how large it is.
    """
    from PIL import Image

    with _PILLOW, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # damaged EXIF and the like
        bound, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            return Image.open(file, formats=_FORMATS)
        finally:
            Image.MAX_IMAGE_PIXELS = bound


def _of_tiff(file: BinaryIO) -> tuple[int, int]:
    """From the first directory: Pillow refuses pixels of 64 bits and others that OpenCV reads."""
    from PIL.TiffImagePlugin import ImageFileDirectory_v2

    file.seek(0)
    big = b"+" in file.read(4)
    file.seek(0)
    directory = ImageFileDirectory_v2(file.read(16 if big else 8))
    file.seek(directory.next)
    directory.load(file)
    return int(directory[_WIDTH]), int(directory[_HEIGHT])


def _of_hdr(head: bytes) -> tuple[int, int]:
    height, width = map(int, _HDR_SIZE.findall(head)[0])
    return width, height


def _of_exr(head: bytes) -> tuple[int, int]:
    left, top, right, bottom = struct.unpack("<4i", _EXR_WINDOW.findall(head)[0])
    return right - left + 1, bottom - top + 1


def _refuse_large(path: str | PathLike[str], width: int, height: int, size: int) -> None:
    megapixels, most = width * height / 1e6, most_megapixels()
    if megapixels > most:
        raise PictureError(
            path,
            f"it has {width} × {height} pixels, {megapixels:.4g} megapixels, expected at most {most:g} "
            f"(--megapixels and {VARIABLE} allow more)",
        )
    if size > BYTES_A_PIXEL * width * height + BESIDE:
        raise PictureError(path, f"it has {size / 1e6:.0f} MB for {width} × {height} pixels, which no picture needs")


# What is in it --------------------------------------------------------------------------------------------------------


def _cut_off(kind: str, content: bytes) -> bool:
    """Whether a picture surely ends before its end: older versions of OpenCV fill it up with grey."""
    if kind == "PNG":
        return b"IEND" not in content[-BESIDE:]
    return kind == "JPEG" and content.find(_END_OF_JPEG, _first_scan(content)) < 0


def _first_scan(jpeg: bytes) -> int:
    """Where the pixels begin, behind the segments, one of which may hold a thumbnail with an end of its own."""
    from PIL.JpegImagePlugin import JpegImageFile

    file = BytesIO(jpeg)
    JpegImageFile(file)
    return file.tell()


def _decoded(content: bytes, flags: int) -> NDArray[Any] | None:
    """The pixels; None where OpenCV gives none. What it logs is not shown: the caller says it in one sentence."""
    log = cv2.utils.logging
    level = log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        picture = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:
        return None
    finally:
        log.setLogLevel(level)
    return None if picture is None else np.asarray(picture)
