"""Frames on disk for a photon transfer: a folder of pictures named by exposure, or an EMVA 1288 descriptor file.

In a folder: `bright_<exposure ms>_0.png`, `bright_<exposure ms>_1.png`, `dark_<exposure ms>_0.png` and `…_1.png`, of 8
or 16 bits, PNG or TIFF (or of 32 where the values are whole numbers of 16); where an exposure has more than two frames
of a kind, these are also its stack. The descriptor
is that of the emva1288 project (github.com/EMVA1288/emva1288): lines `v RELEASE`, `n BITS WIDTH HEIGHT`,
`b EXPOSURE_NS PHOTONS`, `d EXPOSURE_NS`, each of the last two followed by lines `i FRAME`; two frames are a level's
pair, more a stack.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from math import isfinite, nan
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.statistics import Pair, Stack, pair, stack

Frame = NDArray[Any]

NAME = re.compile(r"(bright|dark)_([0-9]+(?:\.[0-9]+)?)_([0-9]+)\.(\w+)", re.IGNORECASE)
SUFFIXES = ("png", "tif", "tiff")
_LAYOUT = (
    "bright_<exposure ms>_0.png, bright_<exposure ms>_1.png, dark_<exposure ms>_0.png and dark_<exposure ms>_1.png"
)


class RecordingError(ValueError):
    """Frames that cannot be measured; the message is one sentence that says which and why.

    >>> from pathlib import Path
    >>> read_recording(Path("nowhere"))
    Traceback (most recent call last):
    camviz_clinic.measuring.noise.recording.RecordingError: nowhere: there is no such folder or descriptor file.
    """


@dataclass(frozen=True)
class ExposureFrames:
    """The files of one light: exposure, photons per pixel (0 in the dark, NaN where unknown), frames in order."""

    exposure_s: float
    photons: float
    frames: tuple[Path, ...]

    @property
    def dark(self) -> bool:
        return self.photons == 0


@dataclass(frozen=True)
class Recording:
    """All shots of a camera at one setting: pairs for the photon transfer, and at most one stack of either kind.

    Attributes:
        source: The folder or descriptor file.
        pairs: Two frames of one light each.
        bright_stack, dark_stack: Many frames of one light.
        release: Of the standard that the data were taken for.
        size: Width and height in pixels, where they were said.

    >>> from math import nan
    >>> from pathlib import Path
    >>> from camviz_clinic.measuring.noise.recording import ExposureFrames
    >>> shot = ExposureFrames(exposure_s=0.01, photons=nan, frames=(Path("bright_10_0.png"), Path("bright_10_1.png")))
    >>> Recording(Path("."), pairs=(shot,)).with_photons_per_ms(200).pairs[0].photons
    2000.0
    """

    source: Path
    pairs: tuple[ExposureFrames, ...]
    bright_stack: ExposureFrames | None = None
    dark_stack: ExposureFrames | None = None
    release: float = 4.0  # of the standard that the data were taken for
    size: tuple[int, int] | None = field(default=None)  # width, height, where it was said

    def with_photons_per_ms(self, photons_per_ms: float) -> Recording:
        """The same with the light known.

        Args:
            photons_per_ms: Per pixel and millisecond of exposure.

        Returns: Its dark shots stay dark.
        """

        def lit(shot: ExposureFrames) -> ExposureFrames:
            return shot if shot.dark else replace(shot, photons=photons_per_ms * shot.exposure_s * 1000)

        stack = self.bright_stack and lit(self.bright_stack)
        return replace(self, pairs=tuple(map(lit, self.pairs)), bright_stack=stack)


def read_recording(path: str | Path) -> Recording:
    """The recording in a folder, or that a descriptor file lists.

    In a folder: bright_<exposure ms>_0.png, bright_<exposure ms>_1.png, dark_<exposure ms>_0.png and …_1.png, PNG or
    TIFF; where an exposure has more than two frames of a kind, these are also its stack. A descriptor is one of the
    emva1288 project, `.txt`.

    Args:
        path: The folder or the descriptor file.

    Returns: Its frames are not yet read.
    Raises: RecordingError in one sentence, for what is not there, is not complete or has another name.

    >>> from pathlib import Path
    >>> import cv2
    >>> Path("ten_ms").mkdir()
    >>> for name in ("bright_10_0", "bright_10_1", "dark_10_0", "dark_10_1"):
    ...     assert cv2.imwrite(f"ten_ms/{name}.png", np.zeros((8, 8), np.uint16))
    >>> [(shot.exposure_s, shot.dark) for shot in read_recording(Path("ten_ms")).pairs]
    [(0.01, False), (0.01, True)]
    """
    path = Path(path)
    if path.is_file():
        return _described(path)
    if not path.is_dir():
        raise RecordingError(f"{path}: there is no such folder or descriptor file.")
    named = sorted(one for one in path.iterdir() if NAME.fullmatch(one.name))
    if named:
        return _named(path, named)
    descriptors = [one for one in sorted(path.glob("*.txt")) if _is_descriptor(one)]
    if len(descriptors) == 1:
        return _described(descriptors[0])
    raise RecordingError(f"{path}: expected frames named {_LAYOUT} (or .tif), or one EMVA 1288 descriptor file.")


def measure(recording: Recording) -> Measurement:
    """Read all the frames of a recording, one shot at a time, and measure.

    Args:
        recording: As `read_recording` gives it.

    Returns: Measurement of the camera.
    Raises: RecordingError in one sentence, for frames that cannot be read or measured.
    Source: EMVA Standard 1288, release 4.0 linear (2021).

    A simulated camera of 0.4 DN per electron, 1 to 8 ms:

    >>> from pathlib import Path
    >>> import cv2
    >>> from itertools import product
    >>> from camviz.sensors import Sensor
    >>> sensor, rng, folder = Sensor(gain_dn_per_e=0.4), np.random.default_rng(0), Path("one_to_eight_ms")
    >>> folder.mkdir()
    >>> for ms, number, (kind, photons) in product(range(1, 9), (0, 1), (("bright", 1500), ("dark", 0))):
    ...     frame = sensor.expose(np.full((64, 64), photons * ms), ms / 1000, 20, rng).dn
    ...     assert cv2.imwrite(f"{folder}/{kind}_{ms}_{number}.png", frame)
    >>> round(measure(read_recording(folder)).gain_dn_per_e, 1)
    0.4
    """
    reader = _FrameReader(recording.size)
    darks = {shot.exposure_s: _pair(shot, reader) for shot in recording.pairs if shot.dark}
    levels = []
    for shot in recording.pairs:
        if not shot.dark:
            levels.append(Level(shot.exposure_s, _pair(shot, reader), darks[shot.exposure_s], shot.photons))
    bright, dark = (_stack(shot, reader) for shot in (recording.bright_stack, recording.dark_stack))
    try:
        return Measurement(tuple(levels), bright, dark, reader.step, recording.release < 4)
    except ValueError as error:
        raise RecordingError(f"{recording.source}: {error}.") from error


# A folder -------------------------------------------------------------------------------------------------------------


def _named(folder: Path, paths: list[Path]) -> Recording:
    found: dict[tuple[str, float], dict[int, Path]] = {}
    for path in paths:
        match = NAME.fullmatch(path.name)
        assert match
        kind, exposure_ms, number, suffix = match[1].lower(), float(match[2]), int(match[3]), match[4].lower()
        _refuse_suffix(path, suffix)
        frames = found.setdefault((kind, exposure_ms), {})
        if number in frames:
            raise RecordingError(f"{path}: is frame {number} of {exposure_ms:g} ms, and so is {frames[number].name}.")
        frames[number] = path
    for (kind, exposure_ms), frames in found.items():
        _refuse_partnerless(folder, kind, exposure_ms, frames)
    for kind, exposure_ms in found:
        other = "dark" if kind == "bright" else "bright"
        if kind == "bright" and (other, exposure_ms) not in found:
            raise RecordingError(
                f"{folder}: {exposure_ms:g} ms has bright frames but no dark ones; "
                f"cover the lens and take {other}_{exposure_ms:g}_0.png and {other}_{exposure_ms:g}_1.png."
            )
    shots = [
        ExposureFrames(
            exposure_ms / 1000, 0.0 if kind == "dark" else nan, tuple(path for _, path in sorted(frames.items()))
        )
        for (kind, exposure_ms), frames in sorted(found.items())
    ]
    if all(shot.dark for shot in shots):
        raise RecordingError(f"{folder}: holds dark frames only; expected frames named {_LAYOUT}.")
    return _sorted_out(folder, shots)


def _refuse_suffix(path: Path, suffix: str) -> None:
    if suffix in ("jpg", "jpeg"):
        raise RecordingError(
            f"{path}: JPEG changes the noise, up or down, and bends the scale; "
            "expected PNG or TIFF straight from the sensor."
        )
    if suffix not in SUFFIXES:
        raise RecordingError(f"{path}: expected a PNG or TIFF file.")


def _refuse_partnerless(folder: Path, kind: str, exposure_ms: float, frames: dict[int, Path]) -> None:
    if len(frames) == 1:
        only = next(iter(frames.values()))
        raise RecordingError(
            f"{only}: has no partner; noise is the difference of two frames of the same light, "
            f"expected a second {kind} frame of {exposure_ms:g} ms."
        )


def _sorted_out(source: Path, shots: list[ExposureFrames]) -> Recording:
    """A shot's first two frames are its pair; the longest bright one, and the dark one of its time, are the stacks."""
    pairs = tuple(replace(shot, frames=shot.frames[:2]) for shot in shots)
    long = {(shot.exposure_s, shot.dark): shot for shot in shots if len(shot.frames) > 2}
    both = [shot for (t, dark), shot in long.items() if not dark and (t, True) in long]
    if not both:
        return Recording(source, pairs)
    bright = max(both, key=lambda shot: len(shot.frames))
    return Recording(source, pairs, bright, long[bright.exposure_s, True])


# A descriptor ---------------------------------------------------------------------------------------------------------


def _is_descriptor(path: Path) -> bool:
    return any(words[0] == "b" for _, words in _lines(path))


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """The lines that say something, from 1, as words."""
    text = path.read_bytes().decode("utf-8", errors="replace")
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip() and not line.strip().startswith("#"):
            yield number, line.split(maxsplit=1) if line.strip().startswith("i") else line.split()


def _described(path: Path) -> Recording:
    shots: list[ExposureFrames] = []
    release, size = 4.0, None
    for number, (letter, *words) in _lines(path):
        try:
            if letter == "v":
                release = float(words[0])
            elif letter == "n":
                size = (int(words[1]), int(words[2]))
            elif letter in ("b", "d"):
                shots.append(ExposureFrames(_exposure_s(words[0]), 0.0 if letter == "d" else _number(words[1]), ()))
            elif letter == "i":
                shots[-1] = replace(
                    shots[-1], frames=(*shots[-1].frames, path.parent / words[0].replace("\\", "/").strip())
                )
            elif letter != "l":
                raise ValueError
        except (ValueError, IndexError) as error:
            raise RecordingError(
                f"{path}: line {number} is no line of an EMVA 1288 descriptor (v, n, b, d, i or l with their values)."
            ) from error
    return _of_descriptor(path, shots, release, size)


def _of_descriptor(path: Path, shots: list[ExposureFrames], release: float, size: tuple[int, int] | None) -> Recording:
    for shot in shots:
        if len(shot.frames) < 2:
            kind = "dark" if shot.dark else "bright"
            raise RecordingError(
                f"{path}: the {kind} shot of {shot.exposure_s * 1e9:g} ns has {len(shot.frames)} frames, expected two."
            )
    pairs = tuple(shot for shot in shots if len(shot.frames) == 2)
    dark = {shot.exposure_s for shot in pairs if shot.dark}
    if all(shot.dark for shot in pairs):
        raise RecordingError(f"{path}: names no pair of bright frames.")
    for shot in pairs:
        if shot.exposure_s not in dark:
            raise RecordingError(f"{path}: {shot.exposure_s * 1e9:g} ns has bright frames but no pair of dark ones.")
    bright_stack = next((shot for shot in shots if len(shot.frames) > 2 and not shot.dark), None)
    dark_stack = next((shot for shot in shots if len(shot.frames) > 2 and shot.dark), None)
    if not (bright_stack and dark_stack):
        bright_stack = dark_stack = None
    return Recording(path, pairs, bright_stack, dark_stack, release, size)


def _exposure_s(nanoseconds: str) -> float:
    return _number(nanoseconds) * 1e-9


def _number(text: str) -> float:
    """A number of zero or more; some writers of descriptors have a decimal comma."""
    value = float(text.replace(",", "."))
    if not (isfinite(value) and value >= 0):
        raise ValueError(text)
    return value


# Frames ---------------------------------------------------------------------------------------------------------------


class _FrameReader:
    """Reads frames and holds each against the first: one size, one depth. It learns the smallest step in DN."""

    def __init__(self, size: tuple[int, int] | None) -> None:
        self.size, self.first = size, "the descriptor"
        self.depth: np.dtype[Any] | None = None
        self._divisor = 0

    @property
    def step(self) -> float:
        return float(max(self._divisor, 1))

    def __call__(self, path: Path) -> Frame:
        frame = _grey(path)
        size = (frame.shape[1], frame.shape[0])
        if self.size and size != self.size:
            raise RecordingError(
                f"{path}: is {size[0]}x{size[1]} pixels, but {self.first} has {self.size[0]}x{self.size[1]}; "
                "all frames must have one size."
            )
        if self.depth and frame.dtype != self.depth:
            raise RecordingError(
                f"{path}: has {frame.dtype.itemsize * 8} bits, but {self.first} has {self.depth.itemsize * 8}; "
                "all frames must have one depth."
            )
        if self.depth is None:
            self.size, self.first, self.depth = size, path.name, frame.dtype
        if self._divisor != 1:
            self._divisor = int(np.gcd(self._divisor, np.gcd.reduce(frame, axis=None)))
        return frame


def _grey(path: Path) -> Frame:
    """A frame (height, width) of 8 or 16 bits, or one of 32 bits whose values are whole numbers of 16."""
    from camviz.colour.picture_files import PictureError, picture_kind, read_picture

    try:
        if picture_kind(path) == "JPEG":
            _refuse_suffix(path, "jpeg")
        frame = read_picture(path)
    except PictureError as error:
        raise RecordingError(f"{error}.") from error
    if frame.ndim != 2:
        raise RecordingError(
            f"{path}: is in colour ({frame.shape[2]} channels); expected grey values straight from the sensor, "
            "of one colour of its filters."
        )
    if frame.dtype in (np.uint8, np.uint16):
        return frame
    return _narrowed(path, frame)


def _narrowed(path: Path, frame: Frame) -> Frame:
    """A frame of 32 bits as 16 bits; RecordingError where a value would become another one."""
    if frame.dtype not in (np.uint32, np.int32, np.float32):
        raise RecordingError(f"{path}: has values of type {frame.dtype}; expected 8, 16 or 32 bits.")
    other = ~((frame >= 0) & (frame <= 65535) & (frame == np.floor(frame)))
    if other.any():
        raise RecordingError(
            f"{path}: has the value {frame[other][0]:g}; expected whole numbers from 0 to 65535, as of a sensor."
        )
    return frame.astype(np.uint16)


def _pair(shot: ExposureFrames, reader: _FrameReader) -> Pair:
    first, second = map(reader, shot.frames)
    if np.array_equal(first, second) and np.mean(first == first.max()) < 0.5:  # unless it is saturated
        raise RecordingError(f"{shot.frames[1]}: is the same picture as {shot.frames[0].name}, pixel by pixel.")
    return pair(first, second)


def _stack(shot: ExposureFrames | None, reader: _FrameReader) -> Stack | None:
    return stack(map(reader, shot.frames)) if shot else None
