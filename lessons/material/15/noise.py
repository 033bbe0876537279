"""The photon-transfer visualizer: where a picture's noise comes from, and the gain that its frames alone tell.

A reader's own function can draw the curve beside the right one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import isfinite, log10
from typing import Any, ClassVar

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.marks import Inset
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout, seconds
from camviz.scenes import render, textured_scene, to_display
from camviz.sensors import Sensor
from camviz.sensors.common_random_numbers import Draw, exposed
from camviz.views import garden
from camviz.views.base import View, slider, step_of, switch
from camviz.views.yours import placeholder, tried

FULL_WELL_E = 15_000.0
WHITE_E_PER_S = 10_000.0  # electrons that a white surface frees in a second
CARD = 0.4  # of white: the even grey card that the noise is measured on
LEVELS = np.geomspace(2.0**-12, 8.0, 32)  # seconds: half a stop apart, and as many
_WIDTH, _HEIGHT = 640, 480
_CARD = (0.70, 0.60, 0.96, 0.95)  # left, top, right, bottom, as shares of the picture
_WIDE = {"picture": 336, "curve": 624, "histogram": 620, "figures": 240}
"""The panels in their order, and how wide each is in picture units."""
_CURVE = {"curve": 404, "key": 220}
"""The curve's two tiles: on a telephone the names of its lines stand below it."""


@dataclass(frozen=True)
class PhotonTransferView(View):
    """A camera in the garden with a grey card, and the noise on that card at every exposure.

    `exposure` is in stops: 0 is one second, each step halves or doubles. At `gain` 1 the converter reaches its end as
    the well does, at 15 000 electrons; more gain gives more DN per electron, and less room. With `difference` the
    noise is that of the difference of two frames over √2, else what varies over the pixels of one. With `fit` it is
    told which gain the points of the curve give. `panels` names what is drawn: any of picture, curve, histogram and
    figures. `yours` is a reader's function of (electrons, read_noise, prnu) to the noise of one frame, in electrons
    (...) and a fraction; its curve is orange.
    """

    title: ClassVar[str] = "Photon transfer"
    openable: ClassVar[Mapping[str, str]] = {name: name.replace("figures", "numbers") for name in _WIDE}

    exposure: float = slider(-3.0, -10.0, 3.0, 0.25, unit="stops", help="0 is one second; −1 half of it")
    gain: float = slider(1.0, 1.0, 16.0, 0.5, unit="×", help="more numbers for each electron, as ISO does")
    read_noise_e: float = slider(8.0, 0.0, 40.0, 0.5, label="read noise", unit="e⁻", help="each time a pixel is read")
    prnu: float = slider(1.5, 0.0, 6.0, 0.1, label="PRNU", unit="%", help="pixels answer light differently")
    dsnu_e: float = slider(5.0, 0.0, 40.0, 0.5, label="DSNU", unit="e⁻", help="pixels begin from different offsets")
    dark_current: float = slider(20.0, 0.0, 500.0, 5.0, label="dark current", unit="e⁻/s", help="at 20 °C")
    temperature_c: float = slider(20.0, -30.0, 60.0, 1.0, label="temperature", unit="°C", help="of the sensor")
    bits: int = slider(12, 4, 14, 1, label="bit depth", unit="bits", help="of the converter")
    frames: int = slider(1, 1, 64, 1, label="frames averaged", help="each picture is the mean of so many")
    photon_noise: bool = switch(True, label="photon noise", help="light comes in photons, at random")
    difference: bool = switch(False, label="difference of two frames", help="take the fixed pattern out")
    brighten: bool = switch(True, help="show dim pictures as bright as others")
    fit: bool = switch(True, label="fit K", help="read the gain K off the points: variance over signal")
    panels: str = " ".join(_WIDE)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be one or more of {', '.join(_WIDE)}, got {self.panels!r}")
        for name in ("gain", "frames", "bits"):
            if not getattr(self, name) >= 1:
                raise ValueError(f"{name} must be at least 1, got {getattr(self, name)}")
        object.__setattr__(self, "bits", int(self.bits))
        object.__setattr__(self, "frames", int(self.frames))

    # What is true -----------------------------------------------------------------------------------------------------

    @cached_property
    def sensor(self) -> Sensor:
        """The sensor of these settings."""
        steps = 2**self.bits - 1
        offset = 0.03 * steps
        return Sensor(
            quantum_efficiency=1.0,  # everything here is told in electrons
            full_well_e=FULL_WELL_E,
            read_noise_e=self.read_noise_e,
            gain_dn_per_e=self.gain * (steps - offset) / FULL_WELL_E,
            offset_dn=offset,
            bits=self.bits,
            dark_current_e_per_s=self.dark_current,
            dsnu_e=self.dsnu_e,
            prnu=self.prnu / 100,
        )

    @property
    def exposure_s(self) -> float:
        return float(2.0**self.exposure)

    @property
    def card_e(self) -> float:
        """The electrons that light frees in a pixel of the card, on average."""
        return CARD * WHITE_E_PER_S * self.exposure_s

    def forget(self) -> None:
        """Free what this view has worked out, and the random numbers."""
        super().forget()
        _draw.cache_clear()

    def parts(self, electrons: np.ndarray) -> dict[str, np.ndarray]:
        """The deviation of each kind of noise, in DN, on a card that frees so many electrons (n,).

        The fixed patterns are not in the difference of two frames.
        """
        K, even = self.sensor.gain_dn_per_e, np.ones_like(electrons)
        heat = self.sensor.dark_current(self.temperature_c) * electrons / (CARD * WHITE_E_PER_S)
        root = self.frames**-0.5
        found = {
            "read noise": K * self.read_noise_e * root * even,
            "photons": K * np.sqrt(electrons) * root * self.photon_noise,
            "dark current": K * np.sqrt(heat) * root,
            "rounding": (1 / 12) ** 0.5 * root * even,
        }
        if not self.difference:
            found |= {"PRNU": K * self.prnu / 100 * electrons, "DSNU": K * self.dsnu_e * even}
        return found

    def measured(self, pixels: int = 6000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Signal above the dark (DN), its noise and that of the dark (DN), each (n,), from frames of the card."""
        return _measured(self, pixels)

    def _frames(self, electrons: np.ndarray, pixels: int, seed: int) -> np.ndarray:
        """Two frames of the card at each level (n, 2, pixels), in DN."""
        draw = _draw((len(LEVELS), 2, pixels), (pixels,), seed)
        return self._exposed(electrons[:, None, None], LEVELS[:, None, None], draw)

    def _exposed(self, electrons: np.ndarray, exposure_s: np.ndarray | float, draw: Draw) -> np.ndarray:
        how = self.sensor, electrons, exposure_s, self.temperature_c, draw
        return exposed(*how, averaged=self.frames, photon_noise=self.photon_noise)

    def _noise(self, frames: np.ndarray) -> np.ndarray:
        if self.difference:
            return (frames[:, 0] - frames[:, 1]).std(axis=-1).astype(float) / 2**0.5
        return frames[:, 0].std(axis=-1).astype(float)

    def fitted_gain(self, signal: np.ndarray, noise: np.ndarray, dark: np.ndarray) -> float:
        """K in DN/e⁻ as EMVA 1288 fits it, variance over signal up to 70 % of saturation; NaN if rounding hides it.

        The mean of n frames has 1/n of their variance.
        """
        top = int(np.argmax(noise))
        used = (signal <= 0.7 * signal[top]) & (np.arange(len(signal)) <= top)
        x, y = signal[used], self.frames * (noise**2 - dark**2)[used]
        slope = float(x @ y / (x @ x)) if x.any() else 0.0  # of the least-squares line y = K x
        return slope if slope > 0 and noise[top] > 0.5 else float("nan")

    def numbers(self, pixels: int = 3000) -> dict[str, str]:
        """The state's key figures, as text."""
        parts = self.parts(np.array([self.card_e]))
        K = self.sensor.gain_dn_per_e
        whole = float(np.sqrt(sum(part[0] ** 2 for part in parts.values()))) / K
        full, seen = self._saturated_share, f"{_electrons(self.card_e)} e⁻ ± {_electrons(whole)}"
        return {
            "exposure": seconds(self.exposure_s),
            "gain K": f"{K:.4g} DN/e⁻",
            **self._fitted(pixels),
            "on the card": seen if full < 0.5 else f"full, {FULL_WELL_E:,.0f} e⁻",
            "signal / noise": f"{self.card_e / max(whole, 1e-9):.3g}" if full < 0.5 else "saturated",
            "mostly from": max(parts, key=lambda name: float(parts[name][0])),
            "card saturated": f"{100 * full:.0f} %",
        }

    def _fitted(self, pixels: int) -> dict[str, str]:
        """The gain that the points give, beside the true one."""
        if not self.fit:
            return {}
        fitted, K = self.fitted_gain(*self.measured(pixels)), self.sensor.gain_dn_per_e
        return {"K from the curve": f"{fitted:.4g} DN/e⁻, {fitted / K:.3g} × K" if isfinite(fitted) else "none"}

    @property
    def _saturated_share(self) -> float:
        """The share of the card's pixels that are full."""
        card = self._exposed(np.full(2000, self.card_e), self.exposure_s, _draw((2000,), (2000,), 23))
        return float(np.mean(card >= self._top_dn))

    @property
    def _top_dn(self) -> float:
        """The largest number there is, less what a full well may vary by."""
        well = self.sensor.gain_dn_per_e * (FULL_WELL_E - 4 * (self.read_noise_e + self.dsnu_e)) + self.sensor.offset_dn
        return min(2**self.bits - 1.0, well)

    def description(self, pixels: int = 3000) -> str:
        figures = f": {listed(told)}" if (told := self._told(pixels)) else f": exposure {seconds(self.exposure_s)}"
        how = "the difference of two frames" if self.difference else "one frame"
        return f"Noise of {how}, {self.bits} bits, {self.temperature_c:g} °C, {self.frames} averaged{figures}."

    def _told(self, pixels: int = 3000) -> dict[str, str]:
        """The figures that stand beside the panels."""
        if not self._has("figures"):
            return {}
        figures = self.numbers(pixels)
        later = () if self._has("histogram") else ("mostly from", "card saturated")
        return {name: told for name, told in figures.items() if name not in (*later, "" if self.fit else "gain K")}

    # What it looks like -----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        pixels = 1500 if draft else 3000
        dn = self.image(draft=draft) if self._has("picture") or self._has("histogram") else np.zeros((1, 1))
        draw: dict[str, Callable[[], svg.Marks]] = {
            "picture": self._picture_panel,
            "curve": lambda: self._transfer_panel(pixels),
            "key": self._legend,
            "histogram": lambda: self._histogram_panel(dn),
            "figures": lambda: readout(self._told(pixels), self._corner("figures", 10, 26), (0, 37), (0, 17)),
        }
        photographs = {"camera": jpeg(self._developed(dn))} if self._has("picture") else {}
        parts = {name: draw[name]() for name in self._layout}
        return self.tiled(self._layout, parts, photographs, self.description(pixels))

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """As many panels in a row as it has room for, in their order."""
        lines: list[dict[str, float]] = [{}]
        for name in filter(self._has, _WIDE):
            if sum(lines[-1].values()) + _WIDE[name] > WIDTH:
                lines.append({})
            lines[-1] |= _CURVE if name == "curve" else {name: _WIDE[name]}
        figures = 37 * (3 + 2 * self.fit + 2 * self._has("histogram")) + 12
        return shortened(rows(*((310, line) for line in lines)), figures=figures, picture=284, key=220)

    def _corner(self, tile: str, right: float, down: float) -> tuple[float, float]:
        """A place in a tile, from its upper left corner."""
        x, y, *_ = self._layout[tile]
        return x + right, y + down

    def image(self, *, draft: bool) -> np.ndarray:
        """What the camera records of the garden with the card in it, DN (height, width)."""
        light = _garden(garden.DRAFT if draft else garden.FINE)
        draw = _draw(light.shape, light.shape, 24)
        return self._exposed(WHITE_E_PER_S * self.exposure_s * light, self.exposure_s, draw)

    def _developed(self, dn: np.ndarray) -> np.ndarray:
        """The picture for the screen: white at the converter's end or, brightened, where white things are."""
        white = self.sensor.gain_dn_per_e * min(WHITE_E_PER_S * self.exposure_s, FULL_WELL_E)
        scale = white if self.brighten else 2**self.bits - 1 - self.sensor.offset_dn
        return to_display((dn - self.sensor.offset_dn) / max(scale, 1e-9))

    def _picture_panel(self) -> svg.Marks:
        panel = image_panel("picture", *self._corner("picture", 10, 34), _WIDE["picture"] - 20, _WIDTH, _HEIGHT)
        left, top, right, bottom = (s * n for s, n in zip(_CARD, (_WIDTH, _HEIGHT) * 2, strict=True))
        shown = placed_image(panel, "camera", _WIDTH, _HEIGHT, image_rendering="pixelated")
        shown += svg.polygon(panel.place([(left, top), (right, top), (right, bottom), (left, bottom)]), "yellow")
        note = "brightened" if self.brighten else "as recorded"
        return panel.show(shown, title=f"The garden in {seconds(self.exposure_s)}", note=note)

    def _histogram_panel(self, dn: np.ndarray) -> svg.Marks:
        """How many pixels have which number: the whole picture, and the card alone."""
        top = min(2**self.bits, 2 ** int(np.ceil(np.log2(max(float(dn.max()) + 1, 16)))))
        edges = np.linspace(-0.5, top - 0.5, min(top, 128) + 1)
        rows, columns = _card_slices(*dn.shape)
        place = self._corner("histogram", 64, 34)
        panel = plot.plot_panel("histogram", *place, 500, 226, (-0.02 * top, 1.02 * top), (0, 1.08))
        content = plot.legend(panel, [("muted thick", "picture"), ("blue thick", "card")], "top right")
        for values, class_ in ((dn, "fill-muted half"), (dn[rows, columns], "fill-blue half")):
            counts = np.histogram(values, edges)[0]
            content += plot.bars(panel, edges[:-1], edges[1:], np.sqrt(counts / counts.max()), class_)
        yticks = [(0.0, "0"), (1.0, "most")]
        return plot.plotted(panel, content, "digital number (DN)", "√ pixels", None, yticks, title="Histogram")

    @cached_property
    def _plot(self) -> Panel:
        """Logarithmic axes that do not move with the gain: an electron at gain 1 is always in the same place."""
        one = 0.97 * 2**self.bits / FULL_WELL_E
        across, up = (log10(0.6 * one), log10(1.3 * 2**self.bits)), (log10(0.4 * one), log10(0.12 * 2**self.bits))
        return plot.plot_panel("transfer", *self._corner("curve", 64, 34), 338, 226, across, up)

    def _transfer_panel(self, pixels: int) -> svg.Marks:
        panel = self._plot
        ticks = plot.logarithmic(panel.left, panel.right), plot.logarithmic(panel.bottom, panel.top)
        content = self._curves(panel) + self._points(panel, pixels)
        how = "the difference of two" if self.difference else "one frame"
        label = "Noise over signal; drag or press the arrow keys to change the exposure"
        heading: dict[str, Any] = {"hint": "drag to change the exposure", "drag": "exposure", "label": label}
        names = "signal above the dark (DN)", "noise, σ (DN)"
        return plot.plotted(panel, content, *names, *ticks, title=f"Noise of {how}", **heading)

    def _curves(self, panel: Panel) -> svg.Marks:
        """Every kind of noise as a line of its own slope, and all together."""
        K = self.sensor.gain_dn_per_e
        signal = np.logspace(panel.left, panel.right, 40)
        parts = self.parts(signal / K)
        lines = [
            plot.curve(panel, np.log10(signal), np.log10(parts[name]), class_)
            for name, (class_, _) in self._styles().items()
            if name in parts and parts[name].max() > 0
        ]
        whole = np.sqrt(sum(part**2 for part in parts.values()))
        curves = svg.join(lines) + plot.curve(panel, np.log10(signal), np.log10(whole), "ink")
        return curves + self._your_curve(panel, signal / K)

    def _your_curve(self, panel: Panel, electrons: np.ndarray) -> svg.Marks:
        """The reader's own noise over the signal, or what is wrong with the function."""
        if self.yours is None:
            return svg.NOTHING
        answer, problem = tried(self.yours, (electrons, self.read_noise_e, self.prnu / 100), electrons)
        if problem:
            return svg.paragraph((14, 24), placeholder(problem), panel.width - 28, "note halo")
        K = self.sensor.gain_dn_per_e
        with np.errstate(divide="ignore", invalid="ignore"):
            return plot.curve(panel, np.log10(K * electrons), np.log10(K * answer), "orange thick")

    def _styles(self) -> dict[str, tuple[str, str]]:
        """How each kind of noise is drawn; orange is the reader's where there is a function of theirs."""
        return _STYLES if self.yours is None else {**_STYLES, "photons": ("yellow dashed", "½")}

    def _legend(self) -> svg.Marks:
        """Beside the curves: wherever it stood among them, some gain would lead one through it."""
        parts = self.parts(np.array([self.card_e]))
        styles = self._styles()
        drawn = [(styles[name], name) for name in styles if name in parts and parts[name].max() > 0]
        named = [(class_, f"{name} (slope {slope})") for (class_, slope), name in drawn]
        named += [("orange thick", "yours")] if self.yours else []
        lines = plot.legend(self._plot, [("ink", "all together"), *named])
        x, y = self._corner("key", 2, 34)
        return svg.Marks([Inset("", x, y, 214, 226, lines)])

    def _points(self, panel: Panel, pixels: int) -> svg.Marks:
        """What frames of the card say, and the exposure of the picture."""
        signal, noise, _ = self.measured(pixels)
        with np.errstate(divide="ignore", invalid="ignore"):
            points = panel.place(np.log10(np.stack([signal, noise], axis=-1)))
            whole = np.sqrt(sum(part[0] ** 2 for part in self.parts(np.array([self.card_e])).values()))
        points[~np.isfinite(points).all(axis=-1)] = np.nan
        at = log10(self.sensor.gain_dn_per_e * self.card_e)
        here = svg.dots([panel.place((at, log10(max(whole, 1e-9))))], "yellow", 13)
        return plot.upright(panel, at, "yellow dashed") + here + svg.dots(points, "blue", 6)

    # The exposure is dragged along the curve --------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> PhotonTransferView:
        if handle != "exposure":
            return self
        return self._exposed_by(dx / self._plot.scale[0] / log10(2))

    def pressed(self, handle: str, key: str) -> PhotonTransferView:
        return self._exposed_by(0.5 * step_of(key))

    def _exposed_by(self, stops: float) -> PhotonTransferView:
        """The view with so many stops more."""
        return self.but(exposure=self.controls()["exposure"].held("exposure", self.exposure + stops))


_STYLES = {
    "read noise": ("green dashed", "0"),
    "DSNU": ("sky dashed", "0"),
    "rounding": ("muted dotted", "0"),
    "photons": ("orange dashed", "½"),
    "dark current": ("red dotted", "½"),
    "PRNU": ("purple dashed", "1"),
}


@lru_cache(maxsize=2)
def _measured(view: PhotonTransferView, pixels: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What `view.measured` gives, kept for the curve, the numbers and the description of one state."""
    lit, unlit = (view._frames(e * LEVELS, pixels, seed) for e, seed in ((CARD * WHITE_E_PER_S, 21), (0.0, 22)))
    signal = (lit.mean(axis=(1, 2)) - unlit.mean(axis=(1, 2))).astype(float)
    return signal, view._noise(lit), view._noise(unlit)


@lru_cache(maxsize=12)
def _draw(frames: tuple[int, ...], pattern: tuple[int, ...], seed: int) -> Draw:
    return Draw.of(frames, pattern, seed)


@lru_cache(maxsize=2)
def _garden(side: int) -> np.ndarray:
    """The light (height, width) of the garden with the card in it; 1 is white."""
    camera = Camera(Intrinsics.from_fov(_WIDTH, _HEIGHT, 70).within(side))
    light = render(textured_scene(), camera).mean(axis=-1)
    rows, columns = _card_slices(*light.shape)
    light[rows, columns] = CARD
    light.flags.writeable = False
    return light


def _card_slices(height: int, width: int) -> tuple[slice, slice]:
    left, top, right, bottom = _CARD
    return slice(round(top * height), round(bottom * height)), slice(round(left * width), round(right * width))


def _electrons(count: float) -> str:
    return f"{count:,.0f}" if count >= 1000 else f"{count:.3g}"
