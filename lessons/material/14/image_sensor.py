"""The image sensor visualizer: which photons become electrons, how many a pixel holds, and what becomes of a shot.

A reader's own count of electrons in green light can stand beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from scipy import constants

from camviz.cameras import Camera, Intrinsics
from camviz.colour.spectra import ILLUMINANTS, WAVELENGTHS_NM, illuminant, sensitivities
from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, bars, between, curve, grid, legend, logarithmic, plot_panel
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.scenes import render, textured_scene
from camviz.sensors import DigitalCamera, Sensor, decibel
from camviz.sensors.digital_camera import Shot
from camviz.sensors.published import CMV4000, IMX174, KAF_0400, PublishedSensor
from camviz.views.base import View, answered, choice, positive, slider
from camviz.views.yours import placeholder
from camviz_school.views.readout import in_rows

SMALL, LARGE = 160, 320  # pixels across a draft and a fine picture
SCENE_LUX = 1000.0
F_NUMBER = 4.0
GREEN_NM = 555.0
PHOTONS_PER_LUX = GREEN_NM * 1e-9 / (683 * constants.h * constants.c) * 1e-12  # of green light, per second and µm²
CHANNELS = (("red", "red"), ("green", "green"), ("blue", "blue"))
_MODELS: dict[str, PublishedSensor] = {
    "IMX174: 77 % at 525 nm": IMX174,
    "KAF-0400: a curve": KAF_0400,
    "CMV4000: 60 % at 550 nm": CMV4000,
}
_MOST_E = 100_000.0
_BESIDE = {"electrons": (420, 296), "sensor": (270, 240), "numbers": (270, 240)}
_SIZES = {"photograph": (460, 374), "efficiency": (500, 374)} | _BESIDE
"""The panels in their order, and how wide and high each is in picture units."""


@dataclass(frozen=True)
class ImageSensorView(View):
    """A sensor behind the filters of a Nikon D5100 photographs the garden, a white wall under 1000 lux, at f/4.

    The quantum efficiency is a published one. Where only one figure was published, it is drawn dashed at all
    wavelengths, for want of others. `fill_factor` is the share of the pixel that catches light, beyond what the
    published figure includes. Pitch and read noise are the published sensor's too. The gain is such that the converter
    ends just where the well is full, so the full well is the saturation capacity here. It opens as the IMX174 does.

    `panels` names what is drawn: any of photograph, efficiency, electrons, sensor and numbers. With `yours`, a
    reader's function of lux on the wall, f-number, pitch in µm, exposure in s and efficiency, there are two more bars:
    an unfiltered pixel under green light of 555 nm, and the same by that function.
    """

    title: ClassVar[str] = "Image sensor"
    openable: ClassVar[Mapping[str, str]] = {name: name for name in _SIZES}

    model: str = choice(*_MODELS, label="efficiency", help="a published quantum efficiency, pitch and read noise")
    light: str = choice("D65", *(one for one in ILLUMINANTS if one != "D65"), help="a CIE illuminant")
    exposure_ms: float = slider(10.0, 0.1, 100.0, 0.1, label="exposure", unit="ms", help="how long light is gathered")
    fill_factor: float = slider(
        1.0, 0.1, 1.0, 0.01, label="fill factor", help="the share of the pixel that catches light"
    )
    full_well: float = slider(
        32_700.0, 300.0, _MOST_E, 100.0, label="full well", unit="e⁻", help="what a pixel can hold"
    )
    bits: float = slider(16.0, 2.0, 16.0, 1.0, unit="bits", help="of the converter")
    panels: str = "photograph efficiency electrons sensor numbers"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "exposure_ms")
        if not set(self.panels.split()) <= {*_SIZES}:
            raise ValueError(f"panels must be any of {', '.join(_SIZES)}, got {self.panels!r}")

    # What is true ----------------------------------------------------------------------------------------------------

    @cached_property
    def sensor(self) -> Sensor:
        """The sensor of this state."""
        bits = round(self.bits)
        return replace(
            _MODELS[self.model].sensor, fill_factor=self.fill_factor, full_well_e=self.full_well, bits=bits,
            gain_dn_per_e=(2**bits - 1) / self.full_well, offset_dn=0.0, dsnu_e=0.0, prnu=0.0,
        )  # fmt: skip

    def camera(self, width: int) -> DigitalCamera:
        """The camera of this state, its picture `width` pixels wide."""
        camera = Camera(Intrinsics.from_fov(width, width * 3 // 4, 60))
        pitch_um = _MODELS[self.model].pitch_um
        return DigitalCamera(camera, self.sensor, pitch_um, illuminant=self.light, scene_lux=SCENE_LUX)

    def shot(self, width: int) -> Shot:
        """The photograph of the garden, every step of it."""
        camera = self.camera(width)
        return camera.take(_light(width), self.exposure_ms / 1000, np.random.Generator(np.random.SFC64(4)))

    @cached_property
    def white_e(self) -> Array:
        """Electrons (4,) that a white wall frees in red, green, blue and unfiltered pixels on the axis."""
        camera = self.camera(4)
        lux = camera.scene_lux * camera.transmittance / (4 * camera.f_number**2)
        return camera.channels.electrons * lux * camera.pitch_um**2 * self.exposure_ms / 1000

    @property
    def _in_green(self) -> tuple[float, ...]:
        """What a reader's function is given, all in green light of 555 nm."""
        efficiency = float(self.sensor.efficiency(GREEN_NM))
        return SCENE_LUX, F_NUMBER, _MODELS[self.model].pitch_um, self.exposure_ms / 1000, efficiency

    @cached_property
    def green_e(self) -> float:
        """Electrons that the same white wall frees in an unfiltered pixel under green light of 555 nm."""
        lux, f_number, pitch_um, exposure_s, efficiency = self._in_green
        return efficiency * PHOTONS_PER_LUX * lux / (4 * f_number**2) * pitch_um**2 * exposure_s

    @cached_property
    def your_e(self) -> tuple[float, str]:
        """The same by the reader's function, NaN without an answer, and what is wrong with it."""
        answer, problem = answered(self.yours, self._in_green, 0.0)
        return float(answer), problem

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        sensor, ratio = self.sensor, self.sensor.dynamic_range()
        red, green, blue, _ = self.white_e
        return {
            "efficiency with fill factor": f"{100 * float(sensor.efficiency()):.1f} % at {sensor.measured_at_nm:g} nm",
            "electrons of a white wall": f"R {red:,.0f}, G {green:,.0f}, B {blue:,.0f}",
            "full well": f"{self.full_well:,.0f} e⁻",
            "threshold, SNR = 1": f"{sensor.threshold_photons():.1f} photons",
            "dynamic range": f"{float(decibel(ratio)):.1f} dB = {np.log2(ratio):.1f} stops",
            "converter": f"{round(self.bits)} bits, {1 / sensor.gain_dn_per_e:.3g} e⁻ a step",
            "greatest SNR": f"{float(decibel(self.full_well**0.5)):.1f} dB",
        }

    def description(self) -> str:
        figures = listed(self.numbers())
        full = " and ".join(name for (name, _), e in zip(CHANNELS, self.white_e, strict=False) if e > self.full_well)
        return (
            f"{_MODELS[self.model].name} under {self.light}, {self.exposure_ms:g} ms, fill factor "
            f"{self.fill_factor:g}: {figures}. A white wall overfills {full or 'no'} pixels."
        )

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        width, photographs = SMALL if draft else LARGE, dict[str, bytes]()
        draw: dict[str, Callable[[], svg.Marks]] = {
            "photograph": lambda: self._photograph(width, photographs),
            "efficiency": self._spectra,
            "electrons": self._electrons,
            "sensor": lambda: self._figures("sensor"),
            "numbers": lambda: self._figures("numbers"),
        }
        return self.tiled(self._layout, {name: draw[name]() for name in self._layout}, photographs)

    def _photograph(self, width: int, photographs: dict[str, bytes]) -> svg.Marks:
        photographs["photograph"] = jpeg(self.shot(width).picture, 92)
        panel = image_in(self._layout["photograph"], "photograph", width, width * 3 // 4)
        return panel.show(placed_image(panel, panel.name, width, width * 3 // 4), title="What becomes of it")

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        return in_rows(_SIZES, self._has)

    def _spectra(self) -> svg.Marks:
        left, top, *_ = self._layout["efficiency"]
        panel = plot_panel("efficiency", left + 64, top + 34, 426, 290, (380, 780), (0, 100))
        unfiltered = 100 * np.asarray(self.sensor.efficiency(WAVELENGTHS_NM))
        per_photon = sensitivities("Nikon D5100") / WAVELENGTHS_NM[:, None]
        passed = per_photon / per_photon.max(axis=0)
        spectrum = illuminant(self.light)
        known = "thick" if self.model == "KAF-0400: a curve" else "thick dashed"
        lines = [(f"ink {known}", "no filter"), *((c, name) for name, c in CHANNELS), ("muted thick", "light")]
        content = (
            between(panel, WAVELENGTHS_NM, np.zeros(len(spectrum)), 96 * spectrum / spectrum.max(), "fill-muted")
            + grid(panel)
            + curve(panel, WAVELENGTHS_NM, unfiltered, f"ink {known}")
            + svg.join(curve(panel, WAVELENGTHS_NM, unfiltered * passed[:, i], c) for i, (_, c) in enumerate(CHANNELS))
            + svg.dots([panel.place((self.sensor.measured_at_nm, 100 * float(self.sensor.efficiency())))], "ink", 8)
            + legend(panel, lines, "bottom right")
        )
        return axes(panel, "wavelength [nm]", "electrons per 100 photons") + panel.show(
            content, title="Quantum efficiency", note=_MODELS[self.model].camera
        )

    def _electrons(self) -> svg.Marks:
        """Electrons of each channel beside the full well and the threshold, on a logarithmic scale."""
        low, high = 0.0, float(np.log10(3 * _MOST_E))
        freed = dict(zip(("red", "green", "blue", "ink"), self.white_e, strict=True))
        names = ["red", "green", "blue", "clear"]
        if self.yours:
            freed |= {"muted": self.green_e, "orange": self.your_e[0]}
            names += ["555 nm", "yours"]
        x, y, *_ = self._layout["electrons"]
        panel = plot_panel("electrons", x + 66, y + 34, 344, 156, (0.4, len(names) + 1.55), (low, high))
        yticks = logarithmic(low, high)
        xticks = [(i + 1.0, name) for i, name in enumerate(names)]
        content = grid(panel, xticks=[], yticks=yticks)
        for i, (class_, electrons) in enumerate(freed.items()):
            top = np.log10(np.maximum(np.array([electrons, min(electrons, self.full_well)]), 1))
            left, right = np.array([i + 0.68]), np.array([i + 1.32])
            if np.isnan(electrons):
                continue
            content += bars(panel, left, right, top[:1], f"{class_} dotted")
            content += svg.join(bars(panel, left, right, top[1:], c) for c in (f"wash fill-{class_}", class_))
        content += self._in_words(panel, len(names)) if self.yours else svg.NOTHING
        floor_e = self.sensor.threshold_photons() * float(self.sensor.efficiency())
        ends = (("full well", ",.0f", self.full_well, "orange"), ("threshold", ".1f", floor_e, "purple"))
        for name, form, electrons, class_ in ends:
            y = float(panel.place((0, np.log10(max(electrons, 1))))[1])
            content += svg.line([(0, y), (panel.width, y)], f"{class_} dashed")
            content += svg.text((panel.width - 6, y - 6), f"{name} {electrons:{form}} e⁻", f"{class_} halo end")
        problem = svg.paragraph((x + 66, y + 270), placeholder(self.your_e[1]), 344) if self.yours else svg.NOTHING
        return (
            problem
            + axes(panel, "pixels of a white wall", "electrons", xticks, yticks, aside=54)
            + panel.show(content, title="Electrons in a pixel", note=f"{self.exposure_ms:g} ms, f/4, {SCENE_LUX:g} lux")
        )

    def _in_words(self, panel: Panel, bar: int) -> svg.Marks:
        """The two counts in green light in their bars."""
        electrons, words = self.your_e[0], svg.NOTHING
        for i, (one, class_) in enumerate(((self.green_e, "tick"), (electrons, "orange"))):
            if np.isfinite(one):
                below = panel.place((bar - 1 + i, np.log10(np.clip(min(one, self.full_well), 4, 1e6)))) + (0, 18)
                words += svg.text(below, f"{float(f'{one:.3g}'):,.0f}", f"{class_} halo middle")
        return words

    def _figures(self, tile: str) -> svg.Marks:
        """The numbers of the sensor, with where they are from, or those of what it takes."""
        (x, y, *_), figures = self._layout[tile], self.numbers()
        of_sensor = {name: figures.pop(name) for name in ("efficiency with fill factor", "full well", "converter")}
        title, told = ("This sensor", of_sensor) if tile == "sensor" else ("Its picture", figures)
        source = svg.paragraph((x + 10, y + 166), _MODELS[self.model].source, 250) if tile == "sensor" else svg.NOTHING
        return svg.text((x + 10, y + 26), title, "title") + readout(told, (x + 10, y + 50), (0, 38), (0, 17)) + source


@lru_cache(maxsize=2)
def _light(width: int) -> np.ndarray:
    """The garden's linear light (height, width, 3)."""
    light = render(textured_scene(), Camera(Intrinsics.from_fov(width, width * 3 // 4, 60)))
    light.flags.writeable = False
    return light
