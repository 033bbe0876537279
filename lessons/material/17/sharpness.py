"""The sharpness visualizer: a target through a lens and onto pixels, and how much of a grating's contrast is left.

A reader's own function can draw its curve beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import Cell, rows, shortened
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, png
from camviz.draw.readout import listed, readout
from camviz.optics import (
    airy_radius_um,
    cutoff_per_mm,
    diffraction_transfer,
    disc_transfer,
    lens_transfer,
    pixel_transfer,
)
from camviz.scenes import to_display
from camviz.views.base import View, positive, slider
from camviz.views.yours import placeholder, tried

FIELD_UM = (320, 240)  # of the sensor that the picture shows
TOP_PER_MM = 260.0  # the curves' right end
LEAN_DEG = 5.0  # of the edge
WHITE_NM = (610.0, 540.0, 460.0)  # red, green and blue of white light
_FINE_UM, _DRAFT_UM = 1.0, 2.0  # how finely the target is painted
_STAR = (228.0, 120.0, 78.0)  # centre and radius, µm
_SPOKES = 36
_MARGIN_UM = 40  # painted around the field, because a Fourier transform joins opposite ends
_EDGE_UM = 75.0
_WIDE = {"picture": 400, "curves": 340, "numbers": 180}
"""The panels in their order, and how wide each is in picture units."""
_COLOURS = ("red", "green", "blue")


@dataclass(frozen=True)
class SharpnessView(View):
    """A leaning edge and a star of 36 spokes, in front of a perfect lens of `f_number` and square pixels of `pitch_um`.

    The sensor stands `defocus_um` behind the place where the image is sharp, so that rays make a disc of defocus / N.
    With `axial_um` red light is sharp so much farther away than green, and blue as much nearer; with `lateral_um` their
    images lie as far aside. Then the light is white, else it is of one `wavelength_nm`. The contrast of diffraction and
    defocus together is exact for round openings, not their product. `panels` names
    what is drawn: the picture, and any of curves and numbers. `yours` is a reader's function of (per_mm, f_number,
    wavelength_mm, pitch_mm), frequencies (n,) to the MTF (n,) of lens and pixel in focus.
    """

    title: ClassVar[str] = "Sharpness"
    openable: ClassVar[Mapping[str, str]] = {"curves": "curve", "numbers": "numbers"}

    f_number: float = slider(5.6, 1.4, 32.0, 0.1, label="f-number N", help="focal length / diameter of the aperture")
    defocus_um: float = slider(0.0, 0.0, 100.0, 1.0, label="defocus", unit="µm", help="from sharp image to sensor")
    pitch_um: float = slider(4.0, 1.0, 12.0, 0.1, label="pixel pitch p", unit="µm", help="from pixel to pixel")
    wavelength_nm: float = slider(550.0, 400.0, 700.0, 5.0, label="wavelength λ", unit="nm", help="of the light")
    axial_um: float = slider(0.0, 0.0, 60.0, 1.0, label="axial colour", unit="µm", help="red and blue focus apart")
    lateral_um: float = slider(0.0, 0.0, 12.0, 0.5, label="lateral colour", unit="µm", help="red and blue lie aside")
    panels: str = " ".join(_WIDE)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "f_number", "pitch_um", "wavelength_nm")
        if "picture" not in (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be picture and any of {', '.join([*_WIDE][1:])}, got {self.panels!r}")
        if self.pitch_um < 0.5:
            raise ValueError(f"pitch_um must be at least 0.5, got {self.pitch_um}")

    # What is true -----------------------------------------------------------------------------------------------------

    @property
    def coloured(self) -> bool:
        """True where colours differ, and so the light is white."""
        return self.axial_um > 0 or self.lateral_um > 0

    @property
    def nyquist_per_mm(self) -> float:
        """Half a cycle per pixel."""
        return 500 / self.pitch_um

    def disc_mm(self, channel: int = 1) -> float:
        """The width of the rays' disc: defocus over f-number; red (0) focuses farther than green (1), blue nearer."""
        return abs(self.defocus_um - (1 - channel) * self.axial_um) / self.f_number / 1000

    def wavelength(self, channel: int = 1) -> float:
        return WHITE_NM[channel] if self.coloured else self.wavelength_nm

    def lens(self, per_mm: np.ndarray, channel: int = 1) -> np.ndarray:
        """The lens's transfer function at frequencies (...): diffraction and defocus, of one colour."""
        return lens_transfer(per_mm, self.f_number, self.wavelength(channel), self.disc_mm(channel))

    def system(self, per_mm: np.ndarray, channel: int = 1) -> np.ndarray:
        """The MTF (...) of lens and pixel."""
        return np.abs(self.lens(per_mm, channel) * pixel_transfer(per_mm, self.pitch_um / 1000))

    @cached_property
    def mtf50_per_mm(self) -> float:
        """The lowest frequency at which half of the contrast is left, cycles per mm."""
        end = 1000 / self.pitch_um
        f = np.linspace(0, end, 600)
        values = self.system(f)
        after = int(np.argmax(values < 0.5))
        return float(np.interp(-0.5, -values[after - 1 : after + 1], f[after - 1 : after + 1]))

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        f50 = self.mtf50_per_mm
        return {
            "Airy disc": f"{2 * float(airy_radius_um(self.f_number, self.wavelength())):.1f} µm across",
            "defocus disc": f"{1000 * self.disc_mm():.1f} µm across",
            "pixel": f"{self.pitch_um:g} µm wide",
            "lens passes up to": f"{float(cutoff_per_mm(self.f_number, self.wavelength())):.0f} cycles/mm",
            "Nyquist frequency": f"{self.nyquist_per_mm:.0f} cycles/mm",
            "MTF50 of green" if self.coloured else "MTF50": f"{f50:.1f} cycles/mm",
            "the same": f"{f50 * self.pitch_um / 1000:.3f} cycles/pixel",
            "MTF at Nyquist": f"{float(self.system(np.array(self.nyquist_per_mm))):.2f}",
        }

    def description(self) -> str:
        figures = listed(self.numbers())
        light = f"{self.wavelength_nm:g} nm"
        if self.coloured:
            light = f"white light, axial colour {self.axial_um:g} µm, lateral colour {self.lateral_um:g} µm"
        return f"A lens at f/{self.f_number:g}, {self.defocus_um:g} µm out of focus, {light}: {figures}."

    # What the sensor records ------------------------------------------------------------------------------------------

    def image(self, *, draft: bool = False) -> np.ndarray:
        """The pixels' light (height, width, 3), linear, 0 to 1."""
        step = _DRAFT_UM if draft else _FINE_UM
        spectrum, across, down = _target(step)
        square = pixel_transfer(across, self.pitch_um / 1000) * pixel_transfer(down, self.pitch_um / 1000)
        lights = [self._light(spectrum * square, across, down, channel) for channel in self._channels()]
        u, v = ((_MARGIN_UM + np.arange(self.pitch_um / 2, side, self.pitch_um)) / step - 0.5 for side in FIELD_UM)
        places = np.meshgrid(u.astype(np.float32), v.astype(np.float32))
        sampled = [cv2.remap(light, *places, cv2.INTER_CUBIC, borderMode=cv2.BORDER_WRAP) for light in lights]
        return np.stack(sampled * (3 // len(sampled)), axis=-1)

    def _channels(self) -> tuple[int, ...]:
        return (0, 1, 2) if self.coloured else (1,)

    def _light(self, spectrum: np.ndarray, across: np.ndarray, down: np.ndarray, channel: int) -> np.ndarray:
        """The light of one colour on the sensor, from the spectrum of what would be there without a lens's blur."""
        radius = np.hypot(across, down)
        coarse = np.linspace(0, float(radius.max()), 200)
        passed = spectrum * np.interp(radius, coarse, self.lens(coarse, channel))
        if self.lateral_um:
            passed = passed * np.exp(-2e-3j * np.pi * across * (1 - channel) * self.lateral_um)
        return np.fft.irfft2(passed).astype(np.float32)

    # What it looks like -----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        draw = {"picture": self._picture_panel, "curves": self._curves_panel, "numbers": self._numbers_column}
        parts = {name: draw[name](x) for name, (x, *_) in self._layout.items()}
        return self.tiled(self._layout, parts, {"sensor": png(to_display(self.image(draft=draft)))})

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        high = {"picture": 328, "curves": 406, "numbers": 356}
        return shortened(rows((max(high.values()), {name: w for name, w in _WIDE.items() if self._has(name)})), **high)

    def _picture_panel(self, left: float) -> svg.Marks:
        panel = image_panel("sensor", left + 10, 34, 380, *FIELD_UM)
        shown = placed_image(panel, "sensor", *FIELD_UM, image_rendering="pixelated")
        note = f"{FIELD_UM[0] / 1000:g} × {FIELD_UM[1] / 1000:g} mm of the sensor"
        return panel.show(shown, title="What the pixels record", note=note)

    def _curves_panel(self, left: float) -> svg.Marks:
        """The curves, and below them what is to be said of the reader's function."""
        deep = 198 if self.yours else 252
        panel = plot.plot_panel("curves", left + 60, 34, 270, deep, (0, TOP_PER_MM), (0, 1.08))
        f = np.linspace(0, TOP_PER_MM, 131)
        curves = self._colours(panel, f) if self.coloured else self._causes(panel, f)
        yours, problem = self._your_points(panel)
        nyquist = plot.upright(panel, self.nyquist_per_mm, "muted dotted")
        content = nyquist + curves + self._half(panel) + yours
        names = "frequency (cycles per mm)", "MTF"
        drawn = plot.plotted(panel, content, *names, title="Contrast that is left")
        return drawn + self._legend(left, deep + 94) + svg.paragraph((left + 40, 362), placeholder(problem), 290)

    def _causes(self, panel: Panel, f: np.ndarray) -> svg.Marks:
        """What each cause alone leaves, and all of them."""
        alone = {
            "blue dashed": diffraction_transfer(f, self.f_number, self.wavelength()),
            "purple dashed": np.abs(disc_transfer(f, self.disc_mm())),
            "green dashed": np.abs(pixel_transfer(f, self.pitch_um / 1000)),
        }
        drawn = [plot.curve(panel, f, values, class_) for class_, values in alone.items()]
        return svg.join([*drawn, plot.curve(panel, f, self.system(f), "ink thick")])

    def _colours(self, panel: Panel, f: np.ndarray) -> svg.Marks:
        return svg.join(plot.curve(panel, f, self.system(f, k), f"{_COLOURS[k]} thick") for k in (0, 2, 1))

    def _half(self, panel: Panel) -> svg.Marks:
        f = self.mtf50_per_mm
        at = panel.place([(0, 0.5), (f, 0.5), (f, 0)])
        return svg.line(at, "yellow dashed") + svg.dots(at[1:2], "yellow", 9)

    def _your_points(self, panel: Panel) -> tuple[svg.Marks, str]:
        """The reader's MTF as orange points, or the line that says why there are none."""
        if self.yours is None:
            return svg.NOTHING, ""
        f = np.linspace(0, TOP_PER_MM, 53)
        values, problem = tried(self.yours, (f, self.f_number, 1e-6 * self.wavelength(), self.pitch_um / 1000), f)
        points = panel.place(np.stack([f, np.clip(values, -1, 2)], axis=-1))
        return svg.line(points, "orange") + svg.dots(points, "orange", 6), problem

    def _legend(self, left: float, top: float) -> svg.Marks:
        """Below the curves, where it stands in no curve's way."""
        entries = [("ink thick", "all together"), ("blue dashed", "diffraction")]
        entries += [("purple dashed", "defocus"), ("green dashed", "pixel")]
        if self.coloured:
            entries = [(f"{name} thick", name) for name in _COLOURS]
        entries += [("muted dotted", "Nyquist"), *([("orange thick", "yours")] if self.yours else [])]
        drawn = svg.NOTHING
        for i, (class_, words) in enumerate(entries):
            x, y = left + 40 + 150 * (i % 2), top + 20 * (i // 2)
            drawn += svg.line([(x, y), (x + 20, y)], class_) + svg.text((x + 26, y + 4), words, "note")
        return drawn

    def _numbers_column(self, left: float) -> svg.Marks:
        column = readout(self.numbers(), (left + 10, 54), (0, 40), (0, 17))
        return svg.text((left + 10, 26), "This camera", "title") + column


@lru_cache(maxsize=2)
def _target(step: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The target's spectrum (rows, columns) and its frequencies across and down, cycles per mm, from samples `step` µm
    apart."""
    target = _paint(step)
    height, width = target.shape
    across, down = np.meshgrid(np.fft.rfftfreq(width, step / 1000), np.fft.fftfreq(height, step / 1000))
    box = np.sinc(across * step / 1000) * np.sinc(down * step / 1000)  # each sample is the mean over a step
    return np.fft.rfft2(target) / box, across, down


def _paint(step: float) -> np.ndarray:
    """The target's light (height, width): a leaning edge on the left, a star on the right."""
    u, v = np.meshgrid(*(np.arange(-_MARGIN_UM + step / 8, side + _MARGIN_UM, step / 4) for side in FIELD_UM))
    edge = u - _EDGE_UM < np.tan(np.radians(LEAN_DEG)) * (v - FIELD_UM[1] / 2)
    x, y, radius = _STAR
    spoke = np.sin(_SPOKES * np.arctan2(v - y, u - x)) > 0
    light = np.where(edge | (spoke & (np.hypot(u - x, v - y) < radius)), 0.03, 0.9)
    return light.reshape(light.shape[0] // 4, 4, light.shape[1] // 4, 4).mean(axis=(1, 3))
