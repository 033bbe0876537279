"""Two kinds of error of an estimated camera, and what it says of each board, as bars and as numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from camviz.cameras import Camera, transform
from camviz.draw import svg
from camviz.draw.readout import signed, true_minus
from camviz.poses import RigidTransform
from camviz_school.views.board_pictures import BoardPictures, middle_of

_LONGEST = 225  # units, of a bar
_LOW, _HIGH = 0.05, 50.0  # pixels at the ends of the bars
PIXELS = ("fx", "fy", "cx", "cy")
NOTHING = "No board is seen: nothing to estimate from"
_ERRORS = 630  # where the column of errors begins


@dataclass(frozen=True)
class ErrorBars(BoardPictures):
    """The errors of the estimate from the boards' corners, drawn in the third column of the calibration visualizer."""

    def _bar(self, x: float, y: float, words: str, value: float, class_: str) -> str:
        """An error in pixels as a bar, with its name above it and its number at its end."""
        return (
            svg.text((x, y + 10), words, "note halo")
            + svg.rectangle(x, y + 16, _LONGEST * _share(value), 14, class_, rx=2)
            + svg.text((x + 6 + _LONGEST * _share(value), y + 28), f"{_digits(value)} px", "number halo")
        )

    def _errors(self) -> str:
        if self.adjustment is None:
            return svg.paragraph((_ERRORS, 402), NOTHING, 320, "label")
        bars = [("on the boards it was fitted to", self.adjustment.rms, "fill-blue")]
        bars += [("on boards it has not seen", self.held_out, "fill-red")] if np.isfinite(self.held_out) else []
        parts = [svg.text((_ERRORS, 402), "Two kinds of error", "title")]
        parts += [self._bar(_ERRORS, 412 + 48 * i, *bar) for i, bar in enumerate(bars)]
        return self._noise_mark() + "".join(parts) + self._per_board() + self._facts()

    def _noise_mark(self) -> str:
        """What the noise alone would leave: √2 times its standard deviation in u and v."""
        if self.seen is not None or self.noise < _LOW:
            return ""
        x = _ERRORS + _LONGEST * _share(np.sqrt(2) * self.noise)
        return svg.segments([(x, 426), (x, 474)], [(x, 444), (x, 492)], "ink") + svg.text(
            (x, 508), "noise alone", "tick middle"
        )

    def _per_board(self) -> str:
        errors = self.per_board
        top = max(np.nanmax(errors, initial=0), 1e-9)
        step = min(26.0, 320 / len(errors))
        parts = [svg.text((_ERRORS, 534), "RMS of each board", "note")]
        for i, error in enumerate(errors):
            x, picked = _ERRORS + step * i, i == self.index
            if np.isfinite(error):
                height = 42 * error / top
                class_ = "fill-orange" if picked else "fill-blue" if self.used[i] else "fill-muted"
                parts.append(svg.rectangle(x, 586 - height, 0.72 * step, height, class_))
            parts.append(
                svg.text((x + 0.36 * step, 602), str(i + 1), "tick middle orange" if picked else "tick middle")
            )
        chosen = errors[self.index]
        if np.isfinite(chosen):
            parts.append(svg.text((950, 534), f"board {self.index + 1}: {_digits(chosen)} px", "note end"))
        return "".join(parts)

    def levers(self) -> list[str]:
        """fx over the picked board's distance Z, which is all that a board held flat shows: true and estimated."""
        rows = [("true", self.truth, self.cam_from_board)] if self.truth else []
        rows += [("found", self.camera, self.estimated_poses)] if self.camera else []
        return [f"{name:6}{self._lever(camera, poses)}" for name, camera, poses in rows]

    def _lever(self, camera: Camera, poses: RigidTransform) -> str:
        f, z = camera.intrinsics.fx, transform(poses[self.index], middle_of(self.board))[2]
        return f"{number('fx', f)} / {z:.3f} m = {f / z:.0f}"

    def _facts(self) -> str:
        lines = [svg.text((_ERRORS, 640 + 19 * i), words, "number") for i, words in enumerate(self.levers())]
        words = f"correlation of fx with Z: {signed(self.correlation, 4)}"
        title = svg.text((_ERRORS, 622), f"fx / Z of board {self.index + 1}, px/m", "note")
        return title + "".join(lines) + svg.text((_ERRORS, 680), words if self.used[self.index] else "", "note")


def _share(pixels: float) -> float:
    """0 … 1 for pixels from _LOW to _HIGH, on a logarithmic scale."""
    return float(np.clip(np.log(max(pixels, 1e-9) / _LOW) / np.log(_HIGH / _LOW), 0.01, 1))


def number(name: str, value: float) -> str:
    """A parameter's value as text: of pixels one digit, of coefficients four."""
    return true_minus(f"{value:.1f}" if name in PIXELS else f"{value:.4f}")


def _digits(value: float) -> str:
    return f"{value:.3f}" if value < 1 else f"{value:.3g}"
