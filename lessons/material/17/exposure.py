"""The exposure visualizer: scene, aperture, shutter and ISO become numbers, and the corners become darker.

A reader's own function can draw its fall-off towards the corners beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw import plot, svg
from camviz.draw.flow import Cell, rows
from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, seconds, signed
from camviz.optics import exposure_value, relative_illumination, unvignetted_share
from camviz.scenes import render, textured_scene, to_display
from camviz.sensors import Sensor
from camviz.sensors.common_random_numbers import Draw, exposed
from camviz.views import garden
from camviz.views.base import View, choice, positive, slider
from camviz.views.yours import placeholder, tried

FULL_WELL_E = 30_000.0
READ_NOISE_E = 3.0
BITS = 12
GREY = 0.18  # of white: what a meter takes the mean of every scene for
FOCAL_MM, SENSOR_MM = 35.0, (36.0, 24.0)
RIM_MM, RIM_DISTANCE_MM = 32.0, 20.0  # of the barrel, in front of the aperture
SUBJECTS = {"garden": (0.0, 1.0), "snow": (0.72, 0.22), "coal": (0.015, 0.05)}  # reflectance: offset, and of the garden
_WIDTH, _HEIGHT = 600, 400
_ROWS = (324, {"picture": 440, "corner": 300, "signal": 220, "numbers": 220}), (226, {"histogram": 520, "stops": 440})
"""The panels in their rows, and how high a row and how wide each panel is in picture units."""
_SIGNAL = ("shutter", "ISO", "18 % grey", "its signal / noise")
_STOPS = (-9.0, 1.0)  # of the histogram, below and above white


@dataclass(frozen=True)
class ExposureView(View):
    """The garden, or the same under snow or of coal, through a 35 mm lens onto a full-frame sensor.

    `shutter` is the exposure time in stops, 0 is one second; `iso` is in stops above 100. `light_ev` is the scene's
    light as the EV that a hand-held meter reads at ISO 100: 15 in full sun. With `metering` "average", the camera
    chooses the shutter so that the picture's mean becomes 18 % of white, and `compensation` stops more. `vignetting`
    darkens the corners; `yours` is a reader's function of (r_mm, v_mm), heights (n,) on the sensor and its distance
    from the lens, to the light (n,) there, 1 on the axis. `panels` names what is drawn: the picture, and any of corner,
    signal (those numbers that say it, without the others), numbers, histogram and stops.
    """

    title: ClassVar[str] = "Exposure"
    openable: ClassVar[Mapping[str, str]] = {"corner": "corner", "histogram": "histogram", "stops": "stops"}

    f_number: float = slider(8.0, 1.4, 22.0, 0.1, label="f-number N", help="focal length / diameter of the aperture")
    shutter: float = slider(-9.0, -13.0, 0.0, 1 / 3, unit="stops", help="exposure time: 0 is 1 s, −1 half of it")
    iso: float = slider(0.0, 0.0, 8.0, 1 / 3, label="ISO", unit="stops", help="gain: 0 is ISO 100, each stop doubles")
    light_ev: float = slider(15.0, 3.0, 16.0, 1 / 3, label="light", unit="EV", help="15 is full sun, 5 a lit room")
    metering: str = choice("manual", "average", help="who chooses the shutter: you, or the mean of the picture")
    compensation: float = slider(0.0, -3.0, 3.0, 1 / 3, unit="stops", help="brighter or darker than the meter says")
    subject: str = choice("garden", *list(SUBJECTS)[1:], help="the same scene, covered with snow or made of coal")
    vignetting: str = choice("none", "cos⁴", "cos⁴ and rim", help="what darkens the corners")
    panels: str = "picture corner numbers histogram stops"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "f_number")
        known = [name for _, line in _ROWS for name in line]
        if "picture" not in (wanted := self.panels.split()) or not {*wanted} <= {*known}:
            raise ValueError(f"panels must be picture and any of {', '.join(known[1:])}, got {self.panels!r}")

    # What is true -----------------------------------------------------------------------------------------------------

    def falloff(self, r_mm: np.ndarray, *, rim: bool | None = None, cos4: bool | None = None) -> np.ndarray:
        """The light (...) at heights r on the sensor (...), 1 on the axis, by what `vignetting` says or as told."""
        angle = np.arctan(np.asarray(r_mm, dtype=float) / FOCAL_MM)
        light = np.ones_like(angle)
        if cos4 if cos4 is not None else self.vignetting != "none":
            light = light * relative_illumination(angle)
        if rim if rim is not None else self.vignetting == "cos⁴ and rim":
            light = light * unvignetted_share(angle, FOCAL_MM / self.f_number, RIM_MM, RIM_DISTANCE_MM)
        return light

    @cached_property
    def shutter_stops(self) -> float:
        """The exposure time in stops: the one set, or the one that brings the mean to 18 % and the compensation."""
        if self.metering == "manual":
            return self.shutter
        mean = float(np.mean(_light(self.subject, garden.DRAFT) * self._falloff_at(garden.DRAFT)[..., None]))
        return float(np.log2(GREY / mean)) + self.compensation - self._stops_but_shutter

    @property
    def _stops_but_shutter(self) -> float:
        """Light, aperture and gain in stops: at a sum of 0 with the shutter, white becomes white."""
        return self.light_ev - float(exposure_value(self.f_number, 1.0)) + self.iso

    @property
    def electrons_of_white(self) -> float:
        """Electrons in a pixel on the axis that sees white, if the well were deep enough for them."""
        return float(FULL_WELL_E * 2 ** (self.shutter_stops + self._stops_but_shutter - self.iso))

    @cached_property
    def sensor(self) -> Sensor:
        offset = 64.0
        return Sensor(
            quantum_efficiency=1.0,  # everything here is told in electrons
            full_well_e=FULL_WELL_E,
            read_noise_e=READ_NOISE_E,
            gain_dn_per_e=2**self.iso * (2**BITS - 1 - offset) / FULL_WELL_E,
            offset_dn=offset,
            bits=BITS,
            dark_current_e_per_s=0.0,
            dsnu_e=0.0,
            prnu=0.0,
        )

    def recorded(self, *, draft: bool) -> np.ndarray:
        """What the sensor records (height, width, 3), 0 to 1 of its largest number."""
        return self._draft if draft else self._recorded(garden.FINE)

    @cached_property
    def _draft(self) -> np.ndarray:
        """The coarse picture, which the figures are read from."""
        return self._recorded(garden.DRAFT)

    def _recorded(self, side: int) -> np.ndarray:
        light = _light(self.subject, side) * self._falloff_at(side)[..., None]
        dn = exposed(self.sensor, self.electrons_of_white * light, 1.0, 20.0, _draw(light.shape))
        return (dn - self.sensor.offset_dn) / (2**BITS - 1 - self.sensor.offset_dn)

    def _falloff_at(self, side: int) -> np.ndarray:
        """The fall-off (height, width) at a picture's pixels."""
        if self.vignetting == "none":
            return np.ones(_light(self.subject, side).shape[:2])
        return self.falloff(_heights_mm(side))

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        recorded = self.recorded(draft=True)
        grey = GREY * self.electrons_of_white
        corner = float(np.log2(self.falloff(np.array(_CORNER_MM))))
        return {
            "aperture": f"f/{self.f_number:.3g}, {FOCAL_MM / self.f_number:.1f} mm wide",
            "shutter": seconds(2.0**self.shutter_stops),
            "ISO": f"{100 * 2**self.iso:.0f}",
            "EV of the settings": f"{float(exposure_value(self.f_number, 2.0**self.shutter_stops)):.1f}",
            "18 % grey": f"{grey:,.0f} electrons" if grey < FULL_WELL_E else "more than a full well",
            "its signal / noise": f"{grey / (grey + READ_NOISE_E**2) ** 0.5:.0f}" if grey < FULL_WELL_E else "full",
            "mean of the picture": f"{100 * float(recorded.mean()):.0f} % of white",
            "cut off at white": f"{100 * float((recorded.max(axis=-1) >= 0.999).mean()):.0f} %",
            "corner": f"{signed(corner, 1)} stops" if corner < -0.05 else "as bright",
        }

    def description(self) -> str:
        figures = listed(self.numbers())
        who = "metered by the average" if self.metering == "average" else "set by hand"
        return f"The {self.subject} at EV {self.light_ev:.3g}, {who}, vignetting {self.vignetting}: {figures}."

    # What it looks like -----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        recorded = self.recorded(draft=draft)
        figures = self.numbers()
        draw: dict[str, Callable[[float], svg.Marks]] = {
            "picture": self._picture_panel,
            "corner": self._corner_panel,
            "signal": lambda x: readout({name: figures[name] for name in _SIGNAL}, (x + 10, 48), (0, 42), (0, 18)),
            "numbers": lambda x: readout(figures, (x + 10, 36), (0, 31), (0, 15)),
            "histogram": lambda x: self._histogram_panel(x, recorded),
            "stops": self._stops_panel,
        }
        layout = self._layout
        parts = {name: draw[name](x) for name, (x, *_) in layout.items()}
        return self.tiled(layout, parts, {"camera": jpeg(to_display(recorded))})

    @property
    def _layout(self) -> dict[str, Cell]:
        return rows(*((high, {name: w for name, w in line.items() if self._has(name)}) for high, line in _ROWS))

    def _picture_panel(self, left: float) -> svg.Marks:
        panel = image_panel("picture", left + 10, 34, 420, _WIDTH, _HEIGHT)
        shown = placed_image(panel, "camera", _WIDTH, _HEIGHT, image_rendering="pixelated")
        note = f"f/{self.f_number:.3g}, {seconds(2.0**self.shutter_stops)}, ISO {100 * 2**self.iso:.0f}"
        return panel.show(shown, title="The picture", note=note)

    def _histogram_panel(self, left: float, recorded: np.ndarray) -> svg.Marks:
        """How many pixels are how many stops below white."""
        panel = plot.plot_panel("histogram", left + 66, 358, 444, 144, _STOPS, (0, 1.1))
        with np.errstate(divide="ignore", invalid="ignore"):
            stops = np.log2(np.maximum(recorded.mean(axis=-1), 2.0**-9)).ravel()
        counts, borders = np.histogram(stops, np.linspace(-9.1, 1, 80))
        shares = np.sqrt(counts / counts.max())
        marks = plot.upright(panel, float(np.log2(GREY)), "yellow dashed") + plot.upright(panel, 0, "red dotted")
        words = svg.text(panel.place((float(np.log2(GREY)), 1.1)) + (-5, 14), "18 %", "note end halo")
        words += svg.text(panel.place((0.0, 1.1)) + (-5, 14), "white", "note end halo")
        content = plot.grid(panel, None, []) + plot.bars(panel, borders[:-1], borders[1:], shares, "fill-blue half")
        shown = panel.show(content + marks + words, title="Histogram")
        return shown + plot.axes(panel, "stops from white", "√ pixels", None, [(1.0, "most")])

    def _stops_panel(self, left: float) -> svg.Marks:
        """Light, aperture, shutter and gain as bars of stops that add up; all are 0 by the rule of the sunny 16."""
        aperture = 8 - float(exposure_value(self.f_number, 1.0))
        parts = {
            "light": (self.light_ev - 15, "fill-yellow"),
            "aperture": (aperture, "fill-blue"),
            "shutter": (self.shutter_stops + 7, "fill-green"),
            "ISO gain": (self.iso, "fill-purple"),
        }
        whole = sum(value for value, _ in parts.values())
        panel = plot.plot_panel("stops", left + 112, 358, 318, 144, (-14, 20), (0, 5))
        rows = [*((name, *one) for name, one in parts.items()), ("together", whole, "fill-muted")]
        drawn = [
            svg.polygon(panel.place([(0, 4.2 - i), (value, 4.2 - i), (value, 4.8 - i), (0, 4.8 - i)]), class_)
            for i, (_, value, class_) in enumerate(rows)
        ]
        ticks = [(-10.0, "−10"), (0.0, "0"), (10.0, "+10")]
        names = [(4.5 - i - 0.05, name) for i, (name, _, _) in enumerate(rows)]
        values = [
            svg.text(
                (panel.x + panel.width - 6, panel.y + panel.place((0, 4.5 - i))[1] + 4), signed(v, 1), "note end halo"
            )
            for i, (_, v, _) in enumerate(rows)
        ]
        shown = panel.show(plot.grid(panel, ticks, []) + svg.join(drawn), title="Stops that add up")
        return shown + plot.axes(panel, "stops from the sunny 16 rule", "", ticks, names) + svg.join(values)

    def _corner_panel(self, left: float) -> svg.Marks:
        """The light towards the corner, by each cause and by the reader's function, or what is to be said of that."""
        panel = plot.plot_panel("corners", left + 62, 34, 226, 240, (0, _CORNER_MM), (0, 1.08))
        r = np.linspace(0, _CORNER_MM, 60)
        curves = plot.curve(panel, r, self.falloff(r, cos4=True, rim=False), "blue dashed")
        curves += plot.curve(panel, r, self.falloff(r, cos4=False, rim=True), "purple dashed")
        curves += plot.curve(panel, r, self.falloff(r), "ink thick")
        points = svg.NOTHING
        if self.yours is not None:
            values, problem = tried(self.yours, (r[::3], FOCAL_MM), r[::3])
            places = panel.place(np.stack([r[::3], np.clip(values, -1, 3)], axis=-1))
            points = svg.line(places, "orange") + svg.dots(places, "orange", 6)
            words = panel.place((0.4 * _CORNER_MM, 0.42))
            points += svg.paragraph(words, placeholder(problem), 0.58 * panel.width, "note halo")
        entries = [("ink thick", "now"), ("blue dashed", "cos⁴"), ("purple dashed", "rim")]
        entries += [("orange thick", "yours")] if self.yours else []
        content = curves + points + plot.legend(panel, entries, "bottom left")
        names = "height on the sensor (mm)", "light, 1 on the axis"
        return plot.plotted(panel, content, *names, title="Light towards the corner")


_CORNER_MM = float(np.hypot(*SENSOR_MM)) / 2


@lru_cache(maxsize=6)
def _light(subject: str, side: int) -> np.ndarray:
    """The light (height, width, 3) of a subject, `side` pixels across; 1 is white."""
    camera = Camera(Intrinsics.from_fov(_WIDTH, _HEIGHT, float(np.degrees(2 * np.arctan(18 / FOCAL_MM)))).within(side))
    offset, scale = SUBJECTS[subject]
    light = offset + scale * render(textured_scene(), camera)
    light.flags.writeable = False
    return light


@lru_cache(maxsize=2)
def _heights_mm(side: int) -> np.ndarray:
    """How far (height, width) each pixel of such a picture is from the axis, on the sensor."""
    height, width = _light("garden", side).shape[:2]
    v, u = np.indices((height, width))
    return np.hypot(u - (width - 1) / 2, v - (height - 1) / 2) * SENSOR_MM[0] / width


@lru_cache(maxsize=2)
def _draw(shape: tuple[int, ...]) -> Draw:
    return Draw.of(shape, (1,), 27)  # this sensor has no pattern
