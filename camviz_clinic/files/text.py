"""From a path to text. Large files, binary files and what is no regular file are refused."""

from __future__ import annotations

import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from camviz_clinic.calibration.types import CalibrationError

MAX_BYTES = 16 * 2**20
CALIBRATION = "calibration file"
HEAD = 2**16  # characters that must tell which format this is

_SIGNATURES = {
    b"\x89PNG": "a PNG picture",
    b"\xff\xd8\xff": "a JPEG picture",
    b"GIF8": "a GIF picture",
    b"II*\0": "a TIFF picture",
    b"MM\0*": "a TIFF picture",
    b"\0\0\0\x0cjP": "a JPEG 2000 picture",
    b"%PDF": "a PDF document",
    b"PK\x03\x04": "a zip archive",
    b"\x1f\x8b": "a gzip archive",
    b"\x93NUMPY": "a NumPy array",
    b"\x89HDF": "an HDF5 file",
    b"MATLAB 7.3": "a MATLAB file of version 7.3; in MATLAB, save('camera.mat', 's', '-v7') makes one that is read",
}


def refuse_no_file(path: Path) -> None:
    """CalibrationError for a name under which there is nothing, or can be nothing."""
    try:
        path.stat()
    except FileNotFoundError:
        raise CalibrationError(f"{path}: there is no such file") from None
    except OSError as error:  # more characters than the system takes, a file where a folder must be …
        raise CalibrationError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError:  # a NUL in the name
        raise CalibrationError(f"{str(path)!r} is not a file name") from None


def read_bytes(path: Path, most: int = MAX_BYTES, what: str = CALIBRATION) -> bytes:
    """The bytes of a file that is small enough to be a calibration, or `what` else; CalibrationError for the rest."""
    with open_bounded(path, most, what) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise CalibrationError(_too_large(len(content), most, what))
    return content


@contextmanager
def open_bounded(path: Path, most: int, what: str = CALIBRATION) -> Iterator[BinaryIO]:
    """A file of at most so many bytes, to be read piece by piece; CalibrationError for anything else."""
    try:
        status = path.stat()
        if stat.S_ISDIR(status.st_mode):
            raise CalibrationError(f"expected a {what}, this is a directory")
        if not stat.S_ISREG(status.st_mode):
            raise CalibrationError(f"expected a {what}, this is not a regular file")
        if status.st_size > most:
            raise CalibrationError(_too_large(status.st_size, most, what))
        with path.open("rb") as file:
            yield file
    except FileNotFoundError:
        raise CalibrationError("there is no such file") from None
    except OSError as error:
        raise CalibrationError(f"cannot be read ({error.strerror})") from error


def _too_large(size: int, most: int, what: str) -> str:
    return f"a {what} has at most {most // 2**20} MB, this one has {size / 2**20:.0f} MB"


def text_of(content: bytes, what: str = "a calibration", kinds: str = " (YAML, XML, JSON)") -> str:
    """The bytes of a file as text; CalibrationError where they are something else."""
    for signature, found in _SIGNATURES.items():
        if content.startswith(signature):
            raise CalibrationError(f"expected {what} as text{kinds}, this is {found}")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CalibrationError(f"expected text in UTF-8, byte {error.start} is not") from None
    if not text.strip():
        raise CalibrationError(f"expected {what}, the file is empty")
    if "\0" in text:
        raise CalibrationError("expected text, this is binary data")
    return text
