"""The colour visualizer: light × surface × sensor, and what white balance and a matrix make of it.

A reader's own balance, matrix or development can make a second chart and a second photograph below the first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np

from camviz.colour import balance, spectra
from camviz.colour.developing import CameraInLight, developed, errors, in_daylight, xyz_from_raw
from camviz.colour.spaces import chromaticity, to_srgb, tristimulus
from camviz.colour.temperature import temperature, xy_of_temperature
from camviz.draw import plot, svg
from camviz.draw.flow import rows, shortened
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, true_minus
from camviz.scenes.light import to_display, to_linear
from camviz.scenes.photographs import photograph
from camviz.views.base import Control, View, answered, choice, one_of, slider, switch, without
from camviz.views.yours import tried
from camviz_school.views import swatches

LAMPS = {"fluorescent, white": "FL2", "fluorescent, three bands": "FL11", "white LED": "LED-B3"}
_CHART = (334, {"chart": 410, "photograph": 330, "numbers": 220})
_STEPS = ("counted (raw)", "× gains", "× matrix", "what the eye sees")
LAYOUTS = {
    "chart photograph": shortened(rows(_CHART), numbers=220, photograph=300),
    "spectra chart photograph steps": shortened(
        rows(_CHART, (220, {"light": 320, "surface": 320, "sensor": 320}), (74, dict.fromkeys(_STEPS, 240))),
        photograph=300,
    ),
    "chart photograph yours": shortened(
        rows(_CHART, (300, {"your chart": 410, "your photograph": 330, "your numbers": 220})),
        **{"numbers": 220, "photograph": 300, "your numbers": 80},
    ),
}
"""What is drawn, and where."""
PARTS = ("develop", "gains", "matrix")
_DRAFT, _FINE = 208, 416  # pixels on the photograph's longer side
_COLUMN = 750  # where the numbers begin


@dataclass(frozen=True)
class ColourView(View):
    """A colour chart and a photograph as a camera counts them in a light, and as they are developed.

    `patch` (0 … 23) is the one chosen on the chart. The photograph's surfaces are the smoothest that look like it in
    daylight; with `picture` (height, width, 3) uint8 sRGB it is the reader's own. The automatic balances judge by the
    photograph, as a camera does. `panels` is one of LAYOUTS.

    `yours` is a reader's function, and `part` says which part of the development it takes over: "develop", from raw
    colours (..., 3), gains (3,) and matrix (3, 3) to colours encoded by the power 1/2.2; "gains", from the photograph's
    raw colours (height, width, 3) to gains (3,); "matrix", from balanced raw colours (24, 3) and their targets (24, 3)
    in linear sRGB to a matrix (3, 3).
    """

    title: ClassVar[str] = "White balance and colour"
    layouts = LAYOUTS

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
    metamer: bool = switch(False, help="a second surface that the sensor cannot tell from the chosen patch")
    scene: str = choice(
        "coffee", "astronaut", "chelsea", "rocket", label="photograph", help="what stands beside the chart"
    )
    patch: int = 13
    panels: str = "spectra chart photograph steps"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    part: str = "develop"
    picture: np.ndarray | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.patch, bool) or self.patch not in range(24):
            raise ValueError(f"patch must be a whole number 0 … 23, got {self.patch!r}")
        one_of("part", self.part, PARTS)

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
        counted, eye = (self.power[:, None] * s for s in (self.shot.sensitivity, spectra.observer()))
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

    def _your_row(self, draft: bool) -> tuple[dict[str, str], dict[str, bytes]]:
        """The chart and the photograph by the reader's function, below those above."""
        rgb, problem = self.your_chart
        panel = replace(self._chart_panel, name="your chart", y=_CHART[0] + 34)
        if problem:
            return {"your chart": without(panel, problem, "With your function", (16, 30))}, {}
        shown = swatches.chart(panel, rgb, self.shot.true_chart, self._off(rgb), self.patch)
        surfaces = self._surfaces(_DRAFT if draft else _FINE)
        image = to_display(self.your_way(surfaces @ self.shot.raw_from_srgb.T)[0])
        figure = {"mean ΔE2000, yours": f"{self._off(rgb).mean():.2f}"}
        parts = {
            "your chart": panel.show(shown, title="With your function"),
            "your photograph": self._photograph_panel(image, "your photograph"),
            "your numbers": readout(figure, (_COLUMN, panel.y + 14), (0, 0), (0, 18)),
        }
        return parts, {"your photograph": jpeg(image)}

    def _off(self, rgb: np.ndarray) -> np.ndarray:
        """ΔE2000 (24,) of a chart; no number where there is no colour."""
        return errors(np.nan_to_num(rgb), self.shot.true_chart)

    # Words and numbers ------------------------------------------------------------------------------------------------

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        kelvin, duv = temperature(chromaticity(tristimulus(self.power)))
        unlike = true_minus(f"{kelvin:.0f} K, Duv {duv:+.4f}") if np.isfinite(kelvin) else "no temperature"
        return {
            "light": unlike,
            "gains": " ".join(f"{name} {gain:.2f}" for name, gain in zip("RGB", self.gains, strict=True)),
            "mean ΔE2000": f"{self.errors.mean():.2f}",
            "largest ΔE2000": f"{self.errors.max():.2f}, {spectra.patch_names()[self.errors.argmax()]}",
            "chosen patch": f"{spectra.patch_names()[self.patch]}, ΔE {self.errors[self.patch]:.2f}",
        } | self._metamer_in_words()

    def _told(self) -> dict[str, str]:
        figures = self.numbers()
        if "steps" in self.panels:
            return figures
        return {name: figures[name] for name in ("light", "gains", "mean ΔE2000", "largest ΔE2000")}

    def _metamer_in_words(self) -> dict[str, str]:
        if not self.metamer:
            return {}
        one, other = (balance.seen(self.power, each) for each in self.reflectances)
        apart = float(errors(to_srgb(one), other))
        return {"its metamer": f"eye ΔE {apart:.1f}, sensor 0" if apart > 1e-6 else "none: it is an eye"}

    def description(self) -> str:
        figures = listed(self._told())
        words = f"{self.camera} in {self._light_in_words()}, white balance {self.method}, matrix {self.matrix}"
        return f"{words}, gamma {self.gamma}: {figures}."

    def _light_in_words(self) -> str:
        kind = f"{self.light} light" if self.light == "Planckian" else self.light
        return true_minus(f"{kind} with tint {self.tint:+.2f}") if self.tint else kind

    # The picture ------------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        image = self.image(draft=draft)
        parts = {"chart": self._chart(), "photograph": self._photograph_panel(image), "numbers": self._numbers_column()}
        photographs = {"photograph": jpeg(image)}
        if self._has("spectra"):
            parts |= {"light": self._light_panel(), "surface": self._surface_panel(), "sensor": self._sensor_panel()}
        if self._has("yours"):
            below, attached = self._your_row(draft)
            parts |= below
            photographs |= attached
        if self._has("steps"):
            parts |= self._steps()
        return self.tiled(LAYOUTS[self.panels], parts, photographs)

    def image(self, *, draft: bool) -> np.ndarray:
        """The photograph as developed, uint8 sRGB."""
        surfaces = self._surfaces(_DRAFT if draft else _FINE)
        if self.gamma == "at the end":
            return to_display(surfaces @ (self.correction @ (self.gains[:, None] * self.shot.raw_from_srgb)).T)
        encoded = to_display(surfaces @ self.shot.raw_from_srgb.T) @ (self.correction * self.gains).T
        return np.clip(encoded + 0.5, 0, 255).astype(np.uint8)

    def _light_panel(self) -> str:
        panel = _spectrum_panel("light", 60, 108)
        lines = plot.grid(panel) + plot.curve(panel, spectra.WAVELENGTHS_NM, self.power, "ink")
        strip = swatches.rainbow(panel, self.power)
        note = self.light if self.light in LAMPS else ""
        return plot.axes(panel, "wavelength in nm", "power") + panel.show(strip + lines, title="The light", note=note)

    def _surface_panel(self) -> str:
        panel = _spectrum_panel("surface", 380, 1.05)
        curves = zip(self.reflectances, ("blue", "orange dashed"), strict=False)
        lines = [plot.curve(panel, spectra.WAVELENGTHS_NM, one, class_) for one, class_ in curves]
        note = "dashed: its metamer" if self.metamer else spectra.patch_names()[self.patch]
        title = "× two surfaces" if self.metamer else "× a surface"
        content = plot.grid(panel) + "".join(lines)
        return plot.axes(panel, "wavelength in nm", "reflected") + panel.show(content, title=title, note=note)

    def _sensor_panel(self) -> str:
        tall = 1.9 if self.camera == "CIE observer" else 1.1
        panel = _spectrum_panel("sensor", 700, tall)
        lines = [
            plot.curve(panel, spectra.WAVELENGTHS_NM, channel, class_)
            for channel, class_ in zip(self.shot.sensitivity.T, ("red thick", "green dashed", "blue"), strict=True)
        ]
        content = plot.grid(panel) + "".join(lines)
        return plot.axes(panel, "wavelength in nm", "sensitivity") + panel.show(
            content, title="× a sensor", note=self.camera
        )

    @property
    def _chart_panel(self) -> Panel:
        return Panel("chart", 10, 34, 390, 252, 0, 6, 0, 4)

    def _chart(self) -> str:
        panel = self._chart_panel
        shown = panel.show(
            swatches.chart(panel, self.chart, self.shot.true_chart, self.errors, self.patch),
            title="The chart",
            hint="click a patch",
            drag="chart",
            label="Choose a patch of the chart: click it or press the arrow keys",
        )
        key = "Upper left: the camera; lower right: the truth.\nNumber: ΔE2000"
        return shown + svg.paragraph((panel.x, panel.y + panel.height + 18), key, panel.width)

    def _photograph_panel(self, image: np.ndarray, name: str = "photograph") -> str:
        height, width = image.shape[:2]
        panel = image_in(LAYOUTS[self.panels][name], name, width, height)
        return panel.show(placed_image(panel, name, width, height), title="Developed in the same way")

    def _numbers_column(self) -> str:
        figures = readout(self._told(), (_COLUMN, 52), (0, 46), (0, 18))
        return svg.text((_COLUMN, 26), "In numbers", "title") + figures

    def _steps(self) -> dict[str, str]:
        """The chosen patch on its way through: a colour and its numbers for each step."""
        raw = self.shot.raw(self.reflectances)
        seen = to_srgb(balance.seen(self.power, self.reflectances))
        if self.gamma == "at the end":
            balanced = raw * self.gains
        else:
            balanced = developed(raw, self.gains, np.eye(3), encoded=True)
        steps = dict(zip(_STEPS, (raw, balanced, self.develop(raw), seen), strict=True))
        return swatches.steps(LAYOUTS[self.panels], steps)

    # The hand ---------------------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> ColourView:
        if handle != "chart":
            return self
        panel = self._chart_panel
        if np.isnan(x):
            return self._moved(int(np.sign(dx)), int(np.sign(dy)))
        column, row = np.clip(np.floor(panel.data((x - panel.x, y - panel.y))), 0, (5, 3)).astype(int)
        return self.but(patch=int(6 * row + column))

    def _moved(self, right: int, down: int) -> ColourView:
        row, column = divmod(self.patch, 6)
        return self.but(patch=6 * min(max(row + down, 0), 3) + min(max(column + right, 0), 5))


def _spectrum_panel(name: str, x: float, top: float) -> Panel:
    return plot.plot_panel(name, x, 368, 250, 136, (380, 780), (0, top))


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
