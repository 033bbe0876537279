"""What an estimated camera is worth, as bars: how well it fits, how far off it is, and its errors on other boards.

A reader's own function can find the RMS errors beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.readout import true_minus
from camviz.poses import RigidTransform
from camviz.views.yours import YOURS_HERE, is_unwritten, tried
from camviz_school.views.board_pictures import BoardPictures, middle_of

_LOW, _HIGH = 0.05, 50.0  # pixels at the ends of the bars of two kinds of error
_FULL_PX, _FULL_PERCENT = 3.0, 50.0  # at the ends of the bars of the fit
_NUMBER = 88  # units beyond the longest bar, for the number at its end
PIXELS = ("fx", "fy", "cx", "cy")
NO_BOARD = "No board is seen: nothing to estimate from"


@dataclass(frozen=True)
class ErrorBars(BoardPictures):
    """The errors of the estimate from the boards' corners, drawn beside the picture of the calibration visualizer.

    `your_rms` is a reader's function of (found, projected), corners (..., 2) in pixels, to their RMS error.
    """

    your_rms: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    # The fit, and the truth -------------------------------------------------------------------------------------------

    @property
    def off_percent(self) -> float:
        """How far the estimated fx is from the true one, in percent of it; NaN without estimate or truth."""
        if self.camera is None or self.truth is None:
            return float("nan")
        return 100 * abs(self.camera.intrinsics.fx / self.truth.intrinsics.fx - 1)

    def _fit(self, cell: Cell) -> svg.Marks:
        """What a report of a calibration says, and how far its focal length is off."""
        x, y, width = cell[0] + 14, cell[1], cell[2] - 28
        parts = [svg.text((x, y + 26), "What the program reports", "title")]
        if self.adjustment is None:
            return svg.join(parts) + svg.paragraph((x, y + 56), NO_BOARD, width, "label")
        rms = self.adjustment.rms
        parts.append(_large_bar(x, y + 44, width, "its fit: the RMS error of all corners", rms / _FULL_PX, "fill-blue"))
        parts.append(_large_number(x, y + 44, width, rms / _FULL_PX, f"{_digits(rms)} px"))
        y += 118
        if self.your_rms is not None:
            parts.append(self._your_bar(x, y, width))
            y += 74
        if self.truth is not None:
            share, fx = self.off_percent / _FULL_PERCENT, number("fx", self.estimates["fx"][0])
            parts.append(svg.text((x, y + 22), "What it does not know", "title"))
            parts.append(_large_bar(x, y + 40, width, "its focal length is off by", share, "fill-red"))
            parts.append(_large_number(x, y + 40, width, share, f"{percent(self.off_percent)} %"))
            true = number("fx", self.true["fx"])
            parts.append(svg.text((x, y + 118), f"fx = {fx} px in place of {true}", "number"))
        return svg.join(parts)

    def _your_bar(self, x: float, y: float, width: float) -> svg.Marks:
        assert self.adjustment
        value, problem = self._by_your_rms(slice(None))
        waits = is_unwritten(problem)
        if problem and not waits:
            return svg.paragraph((x, y + 16), problem, width, "note")
        shown = self.adjustment.rms if waits else value
        bar = _large_bar(x, y, width, "" if waits else "the same by your function", shown / _FULL_PX, "fill-orange")
        if not waits:
            bar += _large_number(x, y, width, shown / _FULL_PX, f"{_digits(shown)} px", "orange")
        words = svg.text((x, y + 14), f"the same: {YOURS_HERE}", "title")
        return svg.group(bar, "awaited") + words if waits else bar

    def _by_your_rms(self, boards: Any) -> tuple[float, str]:
        """The reader's RMS error of some of the boards, and what is wrong with the function."""
        assert self.your_rms
        found = np.where(self.used[:, None, None], self.corners, np.nan) if isinstance(boards, slice) else self.corners
        value, problem = tried(self.your_rms, (found[boards], (self.corners - self.residuals)[boards]), 0.0)
        return float(value), problem

    # Two kinds of error -----------------------------------------------------------------------------------------------

    def _errors(self, cell: Cell) -> svg.Marks:
        x, y, longest = cell[0] + 14, cell[1], cell[2] - 28 - _NUMBER
        title = svg.text((x, y + 26), "Two kinds of error", "title")
        if self.adjustment is None:
            return title + svg.paragraph((x, y + 56), NO_BOARD, cell[2] - 28, "label")
        bars = [("on the boards it was fitted to", self.adjustment.rms, "fill-blue")]
        bars += [("on boards it has not seen", self.held_out, "fill-red")] if np.isfinite(self.held_out) else []
        mark = 0.0 if self.seen is not None or self.noise < _LOW else longest * _share(np.sqrt(2) * self.noise)
        parts = [_bar(x, y + 40 + 64 * i, longest, *bar, mark) for i, bar in enumerate(bars)]
        return title + (self._noise_mark(x + mark, y) if mark else svg.NOTHING) + svg.join(parts)

    def _noise_mark(self, x: float, y: float) -> svg.Marks:
        """What the noise alone would leave: √2 times its standard deviation in u and v."""
        mark = svg.segments([(x, y + 60), (x, y + 124)], [(x, y + 84), (x, y + 148)], "ink")
        return mark + svg.text((x, y + 166), "noise alone", "tick middle")

    # Each board -------------------------------------------------------------------------------------------------------

    def _each_board(self, cell: Cell) -> svg.Marks:
        x, y, width, height = cell[0] + 14, cell[1], cell[2] - 28, min(cell[3], 250)
        title = svg.text((x, y + 26), "RMS error of each board", "title")
        if self.adjustment is None:
            return title + svg.paragraph((x, y + 56), NO_BOARD, width, "label")
        errors, foot, full = self.per_board, y + height - 26, height - 90
        top, step = max(np.nanmax(errors, initial=0), 1e-9), min(40.0, width / len(errors))
        parts = [title]
        for i, error in enumerate(errors):
            left, picked = x + step * i, i == self.index
            if np.isfinite(error):
                high = full * error / top
                class_ = "fill-orange" if picked else "fill-blue" if self.used[i] else "fill-muted"
                parts.append(svg.rectangle(left, foot - high, 0.72 * step, high, class_))
            middle = (left + 0.36 * step, foot + 17)
            parts.append(svg.text(middle, str(i + 1), "label middle orange" if picked else "tick middle"))
        if np.isfinite(errors[self.index]):
            words = f"board {self.index + 1}: {_digits(errors[self.index])} px"
            parts.append(svg.text((x + width, y + 52), words, "number end halo"))
        return svg.join(parts) + self._your_marks(x, foot, step, full / top, width)

    def _your_marks(self, x: float, foot: float, step: float, scale: float, width: float) -> svg.Marks:
        """The reader's RMS errors as lines across the bars; where the function is not written, the right ones."""
        if self.your_rms is None:
            return svg.NOTHING
        found = [self._by_your_rms(i) for i in range(self.count)]
        problem = next((problem for _, problem in found if problem), "")
        if problem and not is_unwritten(problem):
            return svg.paragraph((x, foot - 150), problem, width, "note halo")
        values = self.per_board if problem else np.array([value for value, _ in found])
        y = np.clip(foot - scale * values, foot - 1.09 * scale * np.nanmax(self.per_board), foot)
        left = x + step * np.arange(self.count) - 0.1 * step
        ends = np.stack([left, y], -1), np.stack([left + 0.92 * step, y], -1)
        lines = svg.segments(*ends, "paper-line") + svg.segments(*ends, "orange thick")
        name = svg.text((x, foot - scale * np.nanmax(self.per_board) - 8), "lines: your function", "note orange")
        words = svg.text((x + width / 2, foot - 60), YOURS_HERE, "title halo middle")
        return svg.group(lines, "awaited") + words if problem else lines + name

    # fx over Z --------------------------------------------------------------------------------------------------------

    def levers(self) -> list[str]:
        """fx over the picked board's distance Z, which is all that a board held flat shows: true and estimated."""
        rows = [("true", self.truth, self.cam_from_board)] if self.truth else []
        rows += [("found", self.camera, self.estimated_poses)] if self.camera else []
        return [f"{name:6}{self._lever(camera, poses)}" for name, camera, poses in rows]

    def _lever(self, camera: Camera, poses: RigidTransform) -> str:
        f, z = camera.intrinsics.fx, transform(poses[self.index], middle_of(self.board))[2]
        return f"{number('fx', f)} / {z:.3f} m = {f / z:.0f}"

    def _facts(self, x: float, y: float) -> svg.Marks:
        """The quotient that the picked board shows."""
        lines = [svg.text((x, y + 28 + 28 * i), words, "number") for i, words in enumerate(self.levers())]
        return svg.text((x, y), f"fx / Z of board {self.index + 1}, px/m", "note") + svg.join(lines)


def _bar(x: float, y: float, longest: float, words: str, value: float, class_: str, mark: float) -> svg.Marks:
    """An error in pixels as a bar, with its name above it and its number at its end, or beyond a mark close to it."""
    length = longest * _share(value)
    end = mark if length < mark < length + _NUMBER else length
    return (
        svg.text((x, y + 12), words, "label")
        + svg.rectangle(x, y + 22, length, 20, class_, radius=2)
        + svg.text((x + 6 + end, y + 37), f"{_digits(value)} px", "number halo")
    )


def _large_bar(x: float, y: float, width: float, words: str, share: float, class_: str) -> svg.Marks:
    """A bar as long as its share of the longest, with its name above it; an arrow where it would be longer."""
    longest = width - _NUMBER
    length = longest * float(np.clip(share, 0.008, 1))
    bar = svg.rectangle(x, y + 22, length, 26, class_, radius=2)
    if share > 1:
        tip = [(x + longest, y + 22), (x + longest + 13, y + 35), (x + longest, y + 48)]
        bar += svg.polygon(tip, class_)
    return (svg.text((x, y + 14), words, "label") if words else svg.NOTHING) + bar


def _large_number(x: float, y: float, width: float, share: float, words: str, colour: str = "") -> svg.Marks:
    at = x + (width - _NUMBER) * float(np.clip(share, 0.008, 1)) + (18 if share > 1 else 8)
    return svg.text((at, y + 42), words, f"title {colour}".strip())


def _share(pixels: float) -> float:
    """0 … 1 for pixels from _LOW to _HIGH, on a logarithmic scale."""
    return float(np.clip(np.log(max(pixels, 1e-9) / _LOW) / np.log(_HIGH / _LOW), 0.01, 1))


def percent(value: float) -> str:
    """A percentage as text: from ten on without decimals."""
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"


def number(name: str, value: float) -> str:
    """A parameter's value as text: of pixels one digit, of coefficients four."""
    return true_minus(f"{value:.1f}" if name in PIXELS else f"{value:.4f}")


def _digits(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.3g}"
