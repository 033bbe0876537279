"""The colour visualizer: light × surface × sensor, and what white balance and a matrix make of it.

A reader's own balance, matrix or development can make a second chart and a second photograph below the first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz.colour import balance, spectra
from camviz.colour.developing import CameraInLight, developed, errors, in_daylight, xyz_from_raw
from camviz.colour.spaces import chromaticity, to_srgb, tristimulus
from camviz.colour.temperature import temperature, xy_of_temperature
from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.scenes.light import to_display, to_linear
from camviz.scenes.photographs import photograph
from camviz.views.base import Control, View, answered, choice, one_of, slider, switch, without
from camviz.views.yours import faded, is_unwritten, tried
from camviz_school.views import swatches

LAMPS = {"fluorescent, white": "FL2", "fluorescent, three bands": "FL11", "white LED": "LED-B3"}
_STEPS = ("counted (raw)", "× gains", "× matrix", "what the eye sees")
_SPECTRA = ("light", "surface", "sensor")
_SIZES = {
    **{"chart": (410, 332), "photograph": (330, 256), "your chart": (410, 332), "your photograph": (330, 256)},
    **dict.fromkeys(_SPECTRA, (320, 220)),
    **{"steps": (300, 304), "figures": (220, 256)},
}
"""The tiles in their order, and how wide and how tall each is in picture units."""
PARTS = ("develop", "gains", "matrix")
_DRAFT, _FINE = 208, 416  # pixels on the photograph's longer side
_TWIN_OF_K = 5000.0  # the daylight in which the metamer counts what its patch counts


@dataclass(frozen=True)
class ColourView(View):
    """A colour chart and a photograph as a camera counts them in a light, and as they are developed.

    `patch` (0 … 23) is the one chosen on the chart. The photograph's surfaces are the smoothest that look like it in
    daylight; with `picture` (height, width, 3) uint8 sRGB it is the reader's own. The automatic balances judge by the
    photograph, as a camera does. `panels` names what is drawn: any of chart, photograph, yours (a second one of each),
    spectra or the surface's alone, steps, and figures.

    `yours` is a reader's function, and `part` says which part of the development it takes over: "develop", from raw
    colours (..., 3), gains (3,) and matrix (3, 3) to colours encoded by the power 1/2.2; "gains", from the photograph's
    raw colours (height, width, 3) to gains (3,); "matrix", from balanced raw colours (24, 3) and their targets (24, 3)
    in linear sRGB to a matrix (3, 3).
    """

    title: ClassVar[str] = "White balance and colour"
    openable: ClassVar[Mapping[str, str]] = {
        **{"chart": "chart", "photograph": "photograph", "spectra": "spectra", "steps": "steps", "figures": "numbers"}
    }

    light: str = choice("Planckian", "daylight", *LAMPS, help="what shines: a glowing body, the sky, or a lamp")
    kelvin: float = slider(
        2850, 2000, 12000, 50, label="temperature", unit="K", help="of the Planckian or daylight, not of a lamp"
    )
    tint: float = slider(0.0, -1, 1, 0.05, help="a filter in front of the light: green above zero, magenta below")
    camera: str = choice(*spectra.CAMERAS, help="the last sees exactly as the eye")
    method: str = choice(
        "none", "grey world", "white patch", "chosen patch", "by hand", label="white balance", help="what is made grey"
    )
    set_kelvin: float = slider(6500, 2000, 12000, 50, label="set temperature", unit="K", help="for balance by hand")
    set_tint: float = slider(0.0, -0.03, 0.03, 0.001, label="set tint (Duv)", help="for balance by hand")
    matrix: str = choice("for this light", "for daylight", "off", help="3 × 3, fitted to the chart")
    gamma: str = choice("at the end", "before the balance", help="where the screen's curve is applied")
    metamer: bool = switch(False, help="a second surface, which daylight of 5000 K does not tell from the patch")
    scene: str = choice(
        "coffee", "astronaut", "chelsea", "rocket", label="photograph", help="what stands beside the chart"
    )
    patch: int = 13
    panels: str = "chart photograph spectra steps figures"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    part: str = "develop"
    picture: np.ndarray | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.patch, bool) or self.patch not in range(24):
            raise ValueError(f"patch must be a whole number 0 … 23, got {self.patch!r}")
        one_of("part", self.part, PARTS)
        for name in self.panels.split() or [""]:
            one_of("panels", name, ("chart", "photograph", "yours", "spectra", "surface", "steps", "figures"))

    def offered(self) -> dict[str, Control]:
        """Daylight begins at 4000 K."""
        controls = self.controls()
        if self.light == "daylight":
            controls["kelvin"] = replace(controls["kelvin"], low=spectra.COLDEST_DAYLIGHT)
        return controls

    # The physics ------------------------------------------------------------------------------------------------------

    @cached_property
    def power(self) -> np.ndarray:
        """The light's relative power (81,), 100 at its strongest."""
        if self.light in LAMPS:
            bare = spectra.illuminant(LAMPS[self.light])
        elif self.light == "daylight":
            bare = spectra.daylight(max(self.kelvin, spectra.COLDEST_DAYLIGHT))
        else:
            bare = spectra.planckian(self.kelvin)
        power = bare * spectra.gel(self.tint)
        return 100 * power / power.max()

    @cached_property
    def shot(self) -> CameraInLight:
        """The camera in the light."""
        return CameraInLight(self.camera, self.power)

    @cached_property
    def gains(self) -> np.ndarray:
        """The white balance (3,), green's gain 1."""
        if self.method == "chosen patch":
            return balance.neutral(self.shot.raw_chart[self.patch])
        if self.method == "by hand":
            return balance.from_white_xy(xy_of_temperature(self.set_kelvin, self.set_tint), xyz_from_raw(self.camera))
        if self.method == "none":
            return np.ones(3)
        raw = self._surfaces(_DRAFT) @ self.shot.raw_from_srgb.T
        return balance.grey_world(raw) if self.method == "grey world" else balance.white_patch(raw, 99)

    @cached_property
    def correction(self) -> np.ndarray:
        """The matrix (3, 3) from balanced raw to linear sRGB."""
        if self.matrix == "off":
            return np.eye(3)
        return (self.shot if self.matrix == "for this light" else in_daylight(self.camera)).matrix

    def develop(self, raw: np.ndarray) -> np.ndarray:
        """Linear sRGB (..., 3) of raw colours (..., 3), as this state develops them."""
        return developed(raw, self.gains, self.correction, encoded=self.gamma != "at the end")

    @cached_property
    def chart(self) -> np.ndarray:
        """The chart's developed colours (24, 3), linear sRGB."""
        return self.develop(self.shot.raw_chart)

    @cached_property
    def errors(self) -> np.ndarray:
        """ΔE2000 (24,) of the developed chart from what an eye used to the light sees."""
        return errors(self.chart, self.shot.true_chart)

    @cached_property
    def reflectances(self) -> np.ndarray:
        """The chosen patch's reflectance and, with the switch on, its metamer's: (1 or 2, 81)."""
        chosen = spectra.reflectances()[self.patch]
        if not self.metamer:
            return chosen[None]
        daylight = spectra.daylight(_TWIN_OF_K)[:, None]
        counted, eye = (daylight * s for s in (self.shot.sensitivity, spectra.observer()))
        return np.stack([chosen, balance.metamer(chosen, counted, eye)])

    def _surfaces(self, side: int) -> np.ndarray:
        """The photograph in linear sRGB (height, width, 3), `side` pixels on its longer side."""
        if self.picture is None:
            return _surfaces(self.scene, side)
        return to_linear(_within(self.picture, side))

    # The reader's own function ----------------------------------------------------------------------------------------

    @cached_property
    def your_chart(self) -> tuple[np.ndarray, str]:
        """The chart (24, 3) in linear sRGB as the reader's function makes it, and what is wrong with that."""
        return self.your_way(self.shot.raw_chart)

    def your_way(self, raw: np.ndarray) -> tuple[np.ndarray, str]:
        """Linear sRGB (..., 3) of raw colours (..., 3) with the reader's part in it; NaN and a sentence without."""
        if self.yours is None:
            return answered(None, (), raw)
        gains, matrix = self.gains, self.correction
        if self.part == "develop":
            encoded, problem = tried(self.yours, (raw, gains, matrix), raw)
            return np.clip(encoded, 0, 1) ** 2.2, problem
        if self.part == "gains":
            gains, problem = tried(self.yours, (self._surfaces(_DRAFT) @ self.shot.raw_from_srgb.T,), gains)
        else:
            balanced, target = self.shot.raw_chart * gains, to_srgb(self.shot.true_chart)
            matrix, problem = tried(self.yours, (balanced, target), matrix)
        return developed(raw, gains, matrix, encoded=self.gamma != "at the end"), problem

    def _your_chart(self) -> svg.Marks:
        """The chart by the reader's function, or the right one, greyed, or what is wrong."""
        (rgb, problem), panel, title = self.your_chart, self._chart_panel("your chart"), "With your function"
        if problem:
            awaited = swatches.chart(panel, self.chart, self.shot.true_chart, None, self.patch)
            return without(panel, problem, title, (16, 30), awaited)
        shown = swatches.chart(panel, rgb, self.shot.true_chart, self._off(rgb), self.patch)
        return panel.show(shown, title=title) + self._key(panel, self._off(rgb))

    def _off(self, rgb: np.ndarray) -> np.ndarray:
        """ΔE2000 (24,) of a chart; no number where there is no colour."""
        return errors(np.nan_to_num(rgb), self.shot.true_chart)

    # Words and numbers ------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        kelvin, duv = temperature(chromaticity(tristimulus(self.power)))
        return {
            "light": true_minus(f"{kelvin:.0f} K, Duv {duv:+.4f}") if np.isfinite(kelvin) else "no temperature",
            "gains": " ".join(f"{name} {gain:.2f}" for name, gain in zip("RGB", self.gains, strict=True)),
            "mean ΔE2000": f"{self.errors.mean():.2f}",
            "largest ΔE2000": f"{self.errors.max():.2f}, {spectra.patch_names()[self.errors.argmax()]}",
            "chosen patch": f"{spectra.patch_names()[self.patch]}, ΔE {self.errors[self.patch]:.2f}",
        } | self._metamer_in_words()

    def _told(self) -> dict[str, str]:
        figures = self.numbers()
        return figures if self._has("steps") else {name: figures[name] for name in list(figures)[:4]}

    def _metamer_in_words(self) -> dict[str, str]:
        if not self.metamer:
            return {}
        one, other = (balance.seen(self.power, each) for each in self.reflectances)
        apart, counted = float(errors(to_srgb(one), other)), np.ptp(self.shot.raw(self.reflectances), axis=0).max()
        unlike = f"{counted:.3f}" if counted > 1e-9 else "0"
        return {"its metamer": f"eye ΔE {apart:.1f}, sensor {unlike}" if apart > 1e-6 else "none: it is an eye"}

    def description(self) -> str:
        kind = f"{self.light} light" if self.light == "Planckian" else self.light
        lit = true_minus(f"{kind} with tint {self.tint:+.2f}") if self.tint else kind
        words = f"{self.camera} in {lit}, white balance {self.method}, matrix {self.matrix}, gamma {self.gamma}"
        return f"{words}: {listed(self._told())}."

    # The picture ------------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        photographs: dict[str, bytes] = {}
        photograph = partial(self._photograph_panel, photographs, draft)
        draw: dict[str, Callable[[], svg.Marks]] = {
            "chart": self._chart, "your chart": self._your_chart, "steps": self._steps, "figures": self._figures,
            "light": self._light_panel, "surface": self._surface_panel, "sensor": self._sensor_panel,
            "photograph": partial(photograph, "photograph"), "your photograph": partial(photograph, "your photograph"),
        }  # fmt: skip
        return self.tiled(self._layout, {name: draw[name]() for name in self._layout}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """As many tiles in a row as it has room for, in their order; a reader's own below those above them."""
        wanted = set(self.panels.split())
        if "yours" in wanted:
            wanted |= {f"your {name}" for name in ("chart", "photograph") if name in wanted}
        if "spectra" in wanted:
            wanted |= {*_SPECTRA}
        lines: list[dict[str, float]] = [{}]
        for name, (width, _) in _SIZES.items():
            if name in wanted:
                if sum(lines[-1].values()) + width > WIDTH:
                    lines.append({})
                lines[-1][name] = width
        heights = {name: tall for name, (_, tall) in _SIZES.items()}
        return shortened(rows(*((max(heights[name] for name in line), line) for line in lines)), **heights)

    def image(self, *, draft: bool) -> np.ndarray:
        """The photograph as developed, uint8 sRGB."""
        surfaces = self._surfaces(_DRAFT if draft else _FINE)
        if self.gamma == "at the end":
            return to_display(surfaces @ (self.correction @ (self.gains[:, None] * self.shot.raw_from_srgb)).T)
        encoded = to_display(surfaces @ self.shot.raw_from_srgb.T) @ (self.correction * self.gains).T
        return np.clip(encoded + 0.5, 0, 255).astype(np.uint8)

    def _light_panel(self) -> svg.Marks:
        panel = self._spectrum_panel("light", 108)
        lines = plot.grid(panel) + plot.curve(panel, spectra.WAVELENGTHS_NM, self.power, "ink")
        strip = swatches.rainbow(panel, self.power)
        note = self.light if self.light in LAMPS else ""
        return plot.axes(panel, "wavelength in nm", "power") + panel.show(strip + lines, title="The light", note=note)

    def _surface_panel(self) -> svg.Marks:
        panel = self._spectrum_panel("surface", 1.05)
        curves = zip(self.reflectances, ("blue", "orange dashed"), strict=False)
        lines = [plot.curve(panel, spectra.WAVELENGTHS_NM, one, class_) for one, class_ in curves]
        note = "dashed: its metamer" if self.metamer else spectra.patch_names()[self.patch]
        title = "× two surfaces" if self.metamer else "× a surface"
        content = plot.grid(panel) + svg.join(lines)
        return plot.axes(panel, "wavelength in nm", "reflected") + panel.show(content, title=title, note=note)

    def _sensor_panel(self) -> svg.Marks:
        panel = self._spectrum_panel("sensor", 1.9 if self.camera == "CIE observer" else 1.1)
        channels = zip(self.shot.sensitivity.T, ("red thick", "green dashed", "blue"), strict=True)
        content = svg.join(plot.curve(panel, spectra.WAVELENGTHS_NM, one, class_) for one, class_ in channels)
        shown = panel.show(plot.grid(panel) + content, title="× a sensor", note=self.camera)
        return plot.axes(panel, "wavelength in nm", "sensitivity") + shown

    def _spectrum_panel(self, name: str, top: float) -> Panel:
        x, y, *_ = self._layout[name]
        return plot.plot_panel(name, x + 60, y + 34, 250, 136, (380, 780), (0, top))

    def _chart_panel(self, name: str = "chart") -> Panel:
        x, y, *_ = self._layout[name]
        return Panel(name, x + 10, y + 34, 390, 252, 0, 6, 0, 4)

    def _chart(self) -> svg.Marks:
        panel, label = self._chart_panel(), "Choose a patch of the chart: click it or press the arrow keys"
        shown = swatches.chart(panel, self.chart, self.shot.true_chart, self.errors, self.patch)
        heading = {"title": "The chart", "hint": "click a patch", "drag": "chart", "label": label}
        return panel.show(shown, **heading) + self._key(panel, self.errors)

    def _key(self, panel: Panel, off: np.ndarray) -> svg.Marks:
        key = f"Above: camera. Below: your eye.\nNumber: ΔE2000, {off.mean():.2f} on average"
        return svg.paragraph((panel.x, panel.y + panel.height + 18), key, panel.width)

    def _photograph_panel(self, photographs: dict[str, bytes], draft: bool, name: str) -> svg.Marks:
        """A photograph, which goes to those attached: the reader's own, or the right one, greyed, where it waits."""
        image, title = self.image(draft=draft), "Developed in the same way"
        if name != "photograph":
            raw = self._surfaces(_DRAFT if draft else _FINE) @ self.shot.raw_from_srgb.T
            (rgb, problem), title = self.your_way(raw), "With your function"
            if problem and not is_unwritten(problem):
                return svg.NOTHING
            image = faded(image) if problem else to_display(rgb)
        photographs[name] = jpeg(image)
        height, width = image.shape[:2]
        panel = image_in(self._layout[name], name, width, height)
        return panel.show(placed_image(panel, name, width, height), title=title)

    def _figures(self) -> svg.Marks:
        x, y = self._layout["figures"][0] + 10, self._layout["figures"][1]
        return svg.text((x, y + 26), "In numbers", "title") + readout(self._told(), (x, y + 48), (0, 36), (0, 17))

    def _steps(self) -> svg.Marks:
        """The chosen patch on its way through: a colour and its numbers for each step."""
        raw = self.shot.raw(self.reflectances)
        seen = to_srgb(balance.seen(self.power, self.reflectances))
        balanced = developed(raw, self.gains, np.eye(3), encoded=self.gamma != "at the end")
        steps = dict(zip(_STEPS, (raw, balanced, self.develop(raw), seen), strict=True))
        return swatches.steps(self._layout["steps"], steps)

    # The hand ---------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> ColourView:
        if handle != "chart":
            return self
        panel = self._chart_panel()
        if np.isnan(x):
            return self._moved(int(np.sign(dx)), int(np.sign(dy)))
        column, row = np.clip(np.floor(panel.data((x - panel.x, y - panel.y))), 0, (5, 3)).astype(int)
        return self.but(patch=int(6 * row + column))

    def _moved(self, right: int, down: int) -> ColourView:
        row, column = divmod(self.patch, 6)
        return self.but(patch=6 * min(max(row + down, 0), 3) + min(max(column + right, 0), 5))


@lru_cache(maxsize=2)  # a draft and a fine one
def _surfaces(name: str, side: int) -> np.ndarray:
    linear = to_linear(_within(photograph(name), side))
    linear.flags.writeable = False
    return linear


def _within(picture: np.ndarray, side: int) -> np.ndarray:
    """The picture made smaller, `side` pixels on its longer side."""
    scale = side / max(picture.shape[:2])
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else picture
    return np.asarray(small, dtype=np.uint8)
