"""The image sensor visualizer: which photons become electrons, how many a pixel holds, and what becomes of a shot.

A reader's own count of electrons in green light can stand beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np
from scipy import constants

from camviz.cameras import Camera, Intrinsics
from camviz.colour.spectra import ILLUMINANTS, WAVELENGTHS_NM, illuminant, sensitivities
from camviz.draw import svg
from camviz.draw.flow import rows
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, bars, between, curve, grid, legend, logarithmic, plot_panel
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.scenes import render, textured_scene
from camviz.sensors import DigitalCamera, Sensor, decibel
from camviz.sensors.digital_camera import Shot
from camviz.sensors.published import CMV4000, IMX174, KAF_0400, PublishedSensor
from camviz.views.base import View, answered, choice, positive, slider

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
_LAYOUT = rows(
    (374, {"photograph": 460, "quantum efficiency": 500}), (240, {"electrons": 420, "sensor": 270, "picture": 270})
)


@dataclass(frozen=True)
class ImageSensorView(View):
    """A sensor behind the filters of a Nikon D5100 photographs the garden, a white wall under 1000 lux, at f/4.

    The quantum efficiency is a published one. Where only one figure was published, it is drawn dashed at all
    wavelengths, for want of others. `fill_factor` is the share of the pixel that catches light, beyond what the
    published figure includes. Pitch and read noise are the published sensor's too. The gain is such that the converter
    ends just where the well is full, so the full well is the saturation capacity here. It opens as the IMX174 does.

    With `green` there are two more bars: an unfiltered pixel under green light of 555 nm, and the same by `yours`, a
    reader's function of lux on the wall, f-number, pitch in µm, exposure in s and efficiency.
    """

    title: ClassVar[str] = "Image sensor"

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
    green: bool = False
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "exposure_ms")

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

    @cached_property
    def green_e(self) -> float:
        """Electrons that the same white wall frees in an unfiltered pixel under green light of 555 nm."""
        lux, efficiency, pitch_um = SCENE_LUX / (4 * F_NUMBER**2), self._efficiency, _MODELS[self.model].pitch_um
        return float(efficiency * PHOTONS_PER_LUX * lux * pitch_um**2 * self.exposure_ms / 1000)

    @property
    def _efficiency(self) -> float:
        """Electrons per photon of 555 nm, the fill factor included."""
        return float(self.sensor.efficiency(GREEN_NM))

    @cached_property
    def your_e(self) -> tuple[float, str]:
        """The same by the reader's function, NaN without an answer, and what is wrong with it."""
        pitch_um, exposure_s = _MODELS[self.model].pitch_um, self.exposure_ms / 1000
        answer, problem = answered(self.yours, (SCENE_LUX, F_NUMBER, pitch_um, exposure_s, self._efficiency), 0.0)
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
        width = SMALL if draft else LARGE
        picture = self.shot(width).picture
        panel = image_panel("picture", 10, 34, 440, width, width * 3 // 4)
        shown = panel.show(placed_image(panel, "picture", width, width * 3 // 4), title="What becomes of it")
        parts = {"photograph": shown, "quantum efficiency": self._spectra(), "electrons": self._electrons()}
        return self.tiled(_LAYOUT, parts | self._blocks(), {"picture": jpeg(picture, 92)})

    def _spectra(self) -> str:
        panel = plot_panel("efficiency", 524, 34, 426, 290, (380, 780), (0, 100))
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
            + "".join(curve(panel, WAVELENGTHS_NM, unfiltered * passed[:, i], c) for i, (_, c) in enumerate(CHANNELS))
            + svg.dots([panel.place((self.sensor.measured_at_nm, 100 * float(self.sensor.efficiency())))], "ink", 8)
            + legend(panel, lines, "bottom right")
        )
        return axes(panel, "wavelength [nm]", "electrons per 100 photons") + panel.show(
            content, title="Quantum efficiency", note=_MODELS[self.model].camera
        )

    def _electrons(self) -> str:
        """Electrons of each channel beside the full well and the threshold, on a logarithmic scale."""
        low, high = 0.0, float(np.log10(3 * _MOST_E))
        freed = dict(zip(("red", "green", "blue", "ink"), self.white_e, strict=True))
        names = ["red", "green", "blue", "no filter"]
        if self.green:
            freed |= {"muted": self.green_e, "orange": self.your_e[0]}
            names += ["555 nm", "yours"]
        panel = plot_panel("electrons", 66, 408, 344, 156, (0.4, len(names) + 1.9), (low, high))
        yticks = logarithmic(low, high)
        xticks = [(i + 1.0, name) for i, name in enumerate(names)]
        content = grid(panel, xticks=[], yticks=yticks)
        for i, (class_, electrons) in enumerate(freed.items()):
            top = np.log10(np.maximum(np.array([electrons, min(electrons, self.full_well)]), 1))
            left, right = np.array([i + 0.68]), np.array([i + 1.32])
            if np.isnan(electrons):
                continue
            content += bars(panel, left, right, top[:1], f"{class_} dotted")
            content += "".join(bars(panel, left, right, top[1:], c) for c in (f"wash fill-{class_}", class_))
        content += self._in_words(panel, len(names))
        floor_e = self.sensor.threshold_photons() * float(self.sensor.efficiency())
        content += self._level(panel, self.full_well, f"full well {self.full_well:,.0f} e⁻", "orange", -6)
        content += self._level(panel, floor_e, f"threshold {floor_e:.1f} e⁻", "purple", -6)
        return axes(panel, "pixels of a white wall", "electrons", xticks, yticks, aside=54) + panel.show(
            content, title="Electrons in a pixel", note=f"{self.exposure_ms:g} ms, f/4, {SCENE_LUX:g} lux"
        )

    def _in_words(self, panel: Panel, bar: int) -> str:
        """The two counts in green light above their bars, or what is in the way of the reader's."""
        if not self.green:
            return ""
        electrons, problem = self.your_e
        words = svg.paragraph((14, 46), problem, panel.width - 28, "note halo") if problem else ""
        for i, (one, class_) in enumerate(((self.green_e, "tick"), (electrons, "orange"))):
            if np.isfinite(one):
                below = panel.place((bar - 1 + i, np.log10(np.clip(min(one, self.full_well), 4, 1e6)))) + (0, 18)
                words += svg.text(below, f"{float(f'{one:.3g}'):,.0f}", f"{class_} halo middle")
        return words

    def _level(self, panel: Panel, electrons: float, words: str, class_: str, above: float) -> str:
        y = float(panel.place((0, np.log10(max(electrons, 1))))[1])
        line = svg.line([(0, y), (panel.width, y)], f"{class_} dashed")
        return line + svg.text((panel.width - 6, y + above), words, f"{class_} halo end")

    def _blocks(self) -> dict[str, str]:
        """The numbers in two tiles: those of the sensor, with where they are from, and those of what it takes."""
        figures, step, below = self.numbers(), (0, 38), (0, 17)
        sensor = {name: figures.pop(name) for name in ("efficiency with fill factor", "full well", "converter")}
        source = svg.paragraph((430, 540), _MODELS[self.model].source, 250)
        return {
            "sensor": svg.text((430, 400), "This sensor", "title") + readout(sensor, (430, 424), step, below) + source,
            "picture": svg.text((700, 400), "Its picture", "title") + readout(figures, (700, 424), step, below),
        }


@lru_cache(maxsize=2)
def _light(width: int) -> np.ndarray:
    """The garden's linear light (height, width, 3)."""
    light = render(textured_scene(), Camera(Intrinsics.from_fov(width, width * 3 // 4, 60)))
    light.flags.writeable = False
    return light
