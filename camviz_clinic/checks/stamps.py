"""What a calibration holds for, in words, and in what new pictures contradict it: their size, camera, focus, zoom."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.stamp import FAR, Stamp
from camviz_clinic.calibration.types import Calibration

SAME_FOCAL_LENGTH = 0.005  # EXIF rounds to a tenth of a millimetre, or worse
SAME_DISTANCE = 0.1  # lenses tell their focus in steps
HARMLESS = 0.002  # of the focal length: 2 px at the border of a picture of 2000
LARGEST_BIN = 8
Size = tuple[int, int]


@dataclass(frozen=True)
class SizeChange:
    """What leads from pictures of one size to those of another.

    `kind` is "binning", "resizing", "crop", "binning and crop", "turn" or "unknown". `words` follow "which": "fits
    binning 2×2 or resizing by 1/2".
    """

    kind: str
    words: str


@dataclass(frozen=True)
class Contradiction:
    """One thing in which pictures were taken otherwise than those of the calibration; `value` is the number of it."""

    what: str
    sentence: str
    value: float | None = None
    unit: str = ""
    harmless: bool = False


def size_change(was: Size, now: Size) -> SizeChange:
    """By aspect and factor: what made pictures of the size `now` where the calibration is for `was`; both differ.

    >>> size_change((1280, 960), (640, 480)).words
    'fits binning 2×2 or resizing by 1/2'
    >>> size_change((1280, 960), (1280, 720)).words
    'fits a crop to 1280×720 and no resizing, for the aspect changes'
    """
    if now == was[::-1]:
        return SizeChange("turn", "fits pictures turned by a quarter")
    if _same_aspect(was, now):
        return _resized(was, now)
    (smaller, larger), turned = ((now, was), False) if now[0] * now[1] < was[0] * was[1] else ((was, now), True)
    of = "a calibration from " * turned
    shown = "{}×{}".format(*smaller)
    if factor := _binned(larger, smaller):
        words = f"fits {of}binning {factor}×{factor} and then a crop to {shown}, for the aspect changes"
        return SizeChange("binning and crop", words)
    if smaller[0] <= larger[0] and smaller[1] <= larger[1]:
        return SizeChange("crop", f"fits {of}a crop to {shown} and no resizing, for the aspect changes")
    return SizeChange("unknown", "neither a factor nor a crop explains: another mode, or another camera")


def _same_aspect(was: Size, now: Size) -> bool:
    return abs(now[0] / was[0] * was[1] - now[1]) <= 1


def _resized(was: Size, now: Size) -> SizeChange:
    """The same aspect: sensors bin by whole numbers, programs resize by any."""
    down = now[0] < was[0]
    factor = max(was[0] / now[0], now[0] / was[0])
    whole = round(factor)
    if whole <= LARGEST_BIN and abs(whole * min(was[0], now[0]) - max(was[0], now[0])) < whole:
        made = f"binning {whole}×{whole} or resizing by 1/{whole}"
        return SizeChange("binning", f"fits {made}" if down else f"fits a calibration from pictures after {made}")
    return SizeChange("resizing", f"fits resizing by {now[0] / was[0]:.4g}, for the aspect is the same")


def _binned(larger: Size, smaller: Size) -> int | None:
    """The whole factor that takes one side of a picture to that of another, and leaves the other one too long."""
    for factor in range(2, LARGEST_BIN + 1):
        left = [side - factor * part for side, part in zip(larger, smaller, strict=True)]
        if min(map(abs, left)) < factor <= max(left) and min(left) > -factor:
            return factor
    return None


def contradictions(calibrated: Stamp, new: Stamp) -> Iterator[Contradiction]:
    """In what the pictures of `new` were taken otherwise than those of the calibration, as far as both tell."""
    for what, ours, theirs in (
        ("camera", calibrated.cameras, new.cameras),
        ("lens", calibrated.lenses, new.lenses),
    ):
        if ours and (other := [each for each in theirs if each not in ours]):
            here, there = (enumerated(each, most=2) for each in (ours, other))
            yield Contradiction(what, f"they were taken with another {what}, {there}; the calibration is of {here}")
    yield from _other_focal_length(calibrated, new)
    yield from _other_focus(calibrated, new)
    if beyond := _beyond(calibrated.digital_zooms, new.digital_zooms, SAME_FOCAL_LENGTH):
        zoom, before = beyond
        sentence = f"their digital zoom is {zoom:g}, the calibration's {before:g}: f in pixels changes by that factor"
        yield Contradiction("digital zoom", sentence, zoom / before, "times")


def _other_focal_length(calibrated: Stamp, new: Stamp) -> Iterator[Contradiction]:
    if other := _beyond(calibrated.focal_lengths, new.focal_lengths, SAME_FOCAL_LENGTH):
        length, ours = other
        sentence = (
            f"their focal length is {length:g} mm, the calibration's {ours:g} mm: f in pixels is about "
            f"{length / ours:.3g} times the calibrated one"
        )
        yield Contradiction("focal length", sentence, length / ours, "times")


def _other_focus(calibrated: Stamp, new: Stamp) -> Iterator[Contradiction]:
    """A thin lens of focal length F that is focused at d has its image at F d / (d - F), to which f is proportional."""
    if not (other := _beyond(calibrated.focus_distances, new.focus_distances, SAME_DISTANCE)):
        return
    distance, ours = other
    sentence = f"they are focused at {_metres(distance)}, the calibration's pictures at {_metres(ours)}"
    F = max((*calibrated.focal_lengths, 0.0)) / 1000
    if not 0 < F < min(distance, ours):
        yield Contradiction("focus", f"{sentence}, and focus changes the focal length")
        return
    factor = (distance / (distance - F)) / (ours / (ours - F))
    said = f"{sentence}: with a thin lens f would be {factor:.4g} times the calibrated one"
    yield Contradiction("focus", said, factor, "times", harmless=abs(factor - 1) < HARMLESS)


def _beyond(ours: tuple[float, ...], theirs: tuple[float, ...], share: float) -> tuple[float, float] | None:
    """The one of theirs that is furthest out of the range of ours, and the end of the range that it is beyond."""
    if not ours or not theirs:
        return None
    pairs = [(each, min(max(each, ours[0]), ours[-1])) for each in theirs]
    value, end = max(pairs, key=lambda pair: abs(pair[0] / pair[1] - 1))
    return (value, end) if abs(value / end - 1) > share else None


def settings_differ(stamp: Stamp) -> tuple[str, ...]:
    """What changed among the pictures of one calibration, which one camera model cannot describe; in sentences."""
    said = []
    if len(stamp.cameras) > 1:
        said.append(f"The pictures were taken with {len(stamp.cameras)} cameras, {enumerated(stamp.cameras, most=2)}.")
    if (lengths := stamp.focal_lengths) and lengths[-1] / lengths[0] - 1 > SAME_FOCAL_LENGTH:
        said.append(f"The zoom moved between the pictures, from {lengths[0]:g} to {lengths[-1]:g} mm (EXIF).")
    return tuple(said)


def holds_for(calibration: Calibration, name: str) -> str:
    """What a camera's calibration holds for and what makes it void, in a sentence or three; empty without a stamp."""
    stamp = calibration.stamps.get(name)
    if stamp is None or not stamp.known().keys() - {"made"}:
        return ""
    grid = calibration.cameras[name].intrinsics
    by = [*stamp.cameras[:2], *stamp.lenses[:2]]
    set_so = [f"by {', '.join(by)}"] if by else []
    set_so += [f"at {_range(stamp.focal_lengths, '{:g}'.format)} mm"] if stamp.focal_lengths else []
    set_so += [f"focused at {_range(stamp.focus_distances, _metres)}"] if stamp.focus_distances else []
    set_so += [f"digital zoom {_range(stamp.digital_zooms, '{:g}'.format)}"] if set(stamp.digital_zooms) - {1.0} else []
    told = f", taken {', '.join(set_so)}" if set_so else ""
    unknown = "" if set_so else " Its pictures do not tell camera, lens, focal length or focus."
    said = f" Conditions: {stamp.conditions.rstrip('.')}." if stamp.conditions else ""
    return (
        f"{name}: holds for pictures of {grid.width} × {grid.height} px{told}. Another crop, binning, focus or zoom "
        f"makes it void.{unknown}{said}"
    )


def _range(values: tuple[float, ...], shown: Callable[[float], str]) -> str:
    first, last = shown(values[0]), shown(values[-1])
    return first if first == last else f"{first} to {last}"


def _metres(distance: float) -> str:
    return "infinity" if distance >= FAR else f"{distance:g} m"
