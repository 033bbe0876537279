"""The frames of a film, as the sensor recorded them, with the time of each; and where a damaged film ends."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Self

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.colour.picture_files import most_megapixels

_CONTAINERS = re.compile(
    rb"....(ftyp|moov|mdat|wide|free|skip)|RIFF....AVI |\x1aE\xdf\xa3|\0\0\x01[\xb3\xba]|G|....G|0&\xb2u", re.DOTALL
)  # MP4 and QuickTime, AVI, Matroska, MPEG's program and transport streams, Windows Media
_BOXED = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")
_CHUNK = re.compile(rb"LIST|RIFF|JUNK|idx1|ix\d\d|\d\d(dc|db|wb|pc|tx)")
_MOST_BOXES = 10_000
MOST_LOST = 100  # frames one after the other that cannot be read: then the film is at its end
OFTEN = 0.02  # of the gaps between frames, from which on they vary and are no sign of damage
EVEN = 0.25  # of the usual time between two frames: what a clock may be off by without having left one out


class FilmError(ValueError):
    """A film that cannot be read.

    Args:
        path: The film.
        why: In words without its name; the message is with it.

    >>> Film("none.mp4")
    Traceback (most recent call last):
    camviz_clinic.films.reading.FilmError: none.mp4: there is no such film
    """

    def __init__(self, path: str | PathLike[str], why: str) -> None:
        super().__init__(f"{path}: {why}")
        self.why = why


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a film.

    Args:
        number: How many frames come before it.
        time_s: From the first frame on, in seconds, as the film tells it.
        gray: (height, width) of uint8, grey levels.

    >>> Frame(0, 0.0, np.zeros((480, 640), np.uint8)).number
    0
    """

    number: int
    time_s: float
    gray: NDArray[np.uint8]


class Film:
    """A film that is read once, from its first frame to the last that can be read.

    Its frames are not turned as the film may ask for (phones write such a flag, `turned_deg`): so all films of one
    camera have the sensor's rows and columns, however it was held, as photographs have in `detect`.

    Args:
        path: The film.
        label: What its frames are called by; the name of the film unless given.

    Attributes:
        width, height: Of the sensor's frames, in pixels.
        rate: Frames a second on average, as the film says.
        count: How many frames it says to have; 0 where it does not say.
        turned_deg: By how much it asks to be turned clockwise when it is shown.
        notes: Sentences on how the film was read and what of it is missing, complete when all frames were read.

    Raises: FilmError for a file that is missing, no film, without an index, or with frames too large.

    >>> from camviz_clinic.films.virtual import example
    >>> example("film.avi")  # a board, carried before a virtual camera
    >>> with Film("film.avi") as film:
    ...     print(film.width, film.height, len(list(film.frames())), film.notes)
    160 120 18 []
    """

    width: int
    height: int
    rate: float
    count: int
    turned_deg: int
    notes: list[str]

    def __init__(self, path: str | PathLike[str], label: str = "") -> None:
        self.path = Path(path)
        self.label = label or self.path.stem
        _refuse_no_film(self.path)
        self._capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
        self._capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        told = self._capture.get
        self.width, self.height = (int(told(each)) for each in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
        if not self._capture.isOpened() or min(self.width, self.height) < 1:
            raise FilmError(path, "the film is damaged, or of a kind that OpenCV does not read: no frame can be read")
        if self.width * self.height > 1e6 * most_megapixels():
            raise FilmError(
                path,
                f"its frames have {self.width} × {self.height} pixels, expected at most {most_megapixels():g} "
                "megapixels (--megapixels allows more)",
            )
        rate, count = told(cv2.CAP_PROP_FPS), told(cv2.CAP_PROP_FRAME_COUNT)
        self.rate = rate if 0 < rate < 1e5 else 30.0
        self.count = int(count) if 0 < count < 1e8 else 0
        self.turned_deg = int(told(cv2.CAP_PROP_ORIENTATION_META)) % 360
        self.notes = []
        self._cut = False
        self._began = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._capture.release()

    def frames(self) -> Iterator[Frame]:
        """All that can be read, in their order.

        Yields: One `Frame` after the other; of a film that breaks off without the last one, which may be half a
            picture.
        Raises: FilmError where there is none.
        """
        times: list[float] = []
        held = None
        while (frame := self._next(len(times))) is not None:
            times.append(frame.time_s)
            if held is not None:
                yield held
            held = frame
        if held is None:
            raise FilmError(self.path, "the film is damaged: not one of its frames can be read")
        self.notes += self._told(np.array(times))
        if not self._cut:
            yield held

    def _next(self, number: int) -> Frame | None:
        """The next frame that can be read, beyond some that cannot; None at the end."""
        for _ in range(MOST_LOST):
            try:
                read, picture = self._capture.read()
            except cv2.error:
                return None
            if read and picture.shape[:2] == (self.height, self.width):
                gray = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)
                time_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1000
                self._began = time_s if number == 0 else self._began
                return Frame(number, time_s - self._began, np.asarray(gray, np.uint8))
        return None

    def _breaks_off(self, times: list[float]) -> bool:
        """Whether both the number of frames and their times end before those that the film speaks of."""
        return len(times) < self.count and times[-1] < (self.count - 1.5) / self.rate

    def _told(self, times: NDArray[np.float64]) -> list[str]:
        """How it is turned, whether its rate varies, and what of it is missing."""
        told = []
        if self.turned_deg:
            told.append(
                f"the film asks to be shown turned by {self.turned_deg}°; it is not turned here, and the camera is "
                f"that of the sensor's own {self.width}×{self.height} pixels: undistort its frames before they are "
                "turned."
            )
        gaps = np.diff(times)
        usual = float(np.median(gaps)) if len(gaps) else 0.0
        lost = self._lost_after(times, gaps, usual)
        if lost is not None:
            missing = self.count - len(times)
            told.append(
                f"{missing} of its {self.count} frames cannot be read, the first after frame {lost} "
                f"({times[min(lost, len(times) - 1)]:.2f} s), where the film is damaged; the others were used."
            )
        elif self._breaks_off(list(times)) and _whole(self.path):
            told.append(
                f"frame {len(times) - 1} of {self.count} ({times[-1]:.2f} s) is the last that can be read: the film "
                "was trimmed, or is damaged behind it."
            )
        elif self._breaks_off(list(times)):
            self._cut = True
            told.append(
                f"the film ends at frame {len(times) - 1} of {self.count} ({times[-1]:.2f} s), where it is damaged or "
                "was interrupted; what comes before was used."
            )
        if (np.abs(gaps - usual) > EVEN * usual).sum() > _few(gaps):
            told.append(
                f"its frames are {1000 * gaps.min():.0f} to {1000 * gaps.max():.0f} ms apart (a variable rate): they "
                "are taken at their own times."
            )
        return told

    def _lost_after(self, times: NDArray[np.float64], gaps: NDArray[np.float64], usual: float) -> int | None:
        """After which frame others are missing within the film: where its clock jumps, or an AVI's chunks break off."""
        missing = self.count - len(times)
        wide = np.flatnonzero(gaps > (1 + EVEN) * usual)
        if missing > 0 and 0 < len(wide) <= min(missing, _few(gaps)):
            return int(wide[0])
        return broken_chunk(self.path) if missing > 0 else None


def _few(gaps: NDArray[np.float64]) -> float:
    """How many of the gaps may be uneven in a film whose rate does not vary: one in a short film, too."""
    return max(OFTEN * len(gaps), 1)


def _refuse_no_film(path: Path) -> None:
    """Raises FilmError for what is no film by its first bytes, and for one whose recorder never wrote its index."""
    try:
        if not path.exists():
            raise FilmError(path, "there is no such film")
        if not path.is_file():
            raise FilmError(path, "expected a film, this is no regular file")
        with path.open("rb") as file:
            head = file.read(16)
    except OSError as error:
        raise FilmError(path, f"it cannot be read ({error.strerror or error})") from error
    if not head:
        raise FilmError(path, "it is empty, expected a film")
    if not _CONTAINERS.match(head):
        raise FilmError(path, f"it is not a film that can be read, it begins with {head[:8].hex(' ')}")
    if head[4:8] in _BOXED and b"moov" not in boxes(path)[0]:
        raise FilmError(
            path,
            "the recording was interrupted before the camera wrote the film's index (moov), so that not one frame can "
            "be read: the camera or a program such as untrunc may mend it with another film of the same camera",
        )


def _whole(path: Path) -> bool:
    """Whether a film is an MP4 or QuickTime whose boxes all end within it: nothing was cut off."""
    names, end = boxes(path)
    return names[:1] != [] and names[0] in _BOXED and end <= path.stat().st_size


def boxes(path: Path) -> tuple[list[bytes], int]:
    """The outermost boxes of an MP4 or QuickTime film (ISO/IEC 14496-12, section 4.2).

    Args:
        path: The film.

    Returns:
        names: In the order of the file, as far as they begin within it.
        end: Where the last one ends, in bytes, which may be behind the file's end.

    >>> _ = Path("cut.mp4").write_bytes(b"\\0\\0\\0\\x10ftypisom\\0\\0\\0\\0" + b"\\0\\0\\xff\\xffmdat")
    >>> boxes(Path("cut.mp4"))
    ([b'ftyp', b'mdat'], 65551)
    """
    found: list[bytes] = []
    with path.open("rb") as file:
        end = file.seek(0, 2)
        at = 0
        while at + 8 <= end and len(found) < _MOST_BOXES:
            file.seek(at)
            head = file.read(16)
            length = int.from_bytes(head[:4], "big")
            found.append(head[4:8])
            if length == 1:
                length = int.from_bytes(head[8:], "big")
            if length < 8:  # 0: as far as the file goes
                break
            at += length
    return found, at


def broken_chunk(path: Path) -> int | None:
    """After which frame an AVI is damaged, by the chunks that hold its frames (Microsoft, "AVI RIFF File Reference").

    Args:
        path: The film.

    Returns: Of the last frame before a chunk that cannot be one; None for other films, and for one that is whole or
        only cut off.

    >>> from camviz_clinic.films.virtual import example
    >>> example("film.avi")
    >>> broken_chunk(Path("film.avi")) is None
    True
    """
    with path.open("rb") as file:
        end = file.seek(0, 2)
        file.seek(0)
        if not re.match(rb"RIFF....AVI ", file.read(12), re.DOTALL):
            return None
        at, frames = 12, 0
        while at + 12 <= end:
            file.seek(at)
            head = file.read(12)
            if not _CHUNK.match(head):
                return max(frames - 1, 0)
            frames += head[2:4] in (b"dc", b"db")
            inside = head[:4] in (b"RIFF", b"LIST") and head[8:] in (b"movi", b"rec ", b"AVIX")
            length = int.from_bytes(head[4:8], "little")
            at += 12 if inside else 8 + length + length % 2
    return None
