"""The demosaicing visualizer: a mosaic, the picture rebuilt from it, what is false in it, and where that had to be.

A reader's own mosaic, or guess of green, can make a second picture beside the first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz import mosaics
from camviz.draw import plot, svg
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg, png
from camviz.draw.readout import listed, readout, true_minus
from camviz.draw.shades import heat_key, heat_map, heat_panel
from camviz.lenses.base import Array
from camviz.mosaics import ALGORITHMS, ANY_PATTERN, PATTERNS, Carrier, Pattern
from camviz.mosaics.measures import Measures
from camviz.scenes import to_display
from camviz.views.base import View, choice, slider, without
from camviz.views.marks import circle
from camviz.views.yours import tried
from camviz_school.views import mosaic_steps
from camviz_school.views.mosaic_steps import Source

LOUPE = 14  # pixels across
_KEY = 62  # units right of a picture, for the key of its map
_WIDE = {"picture": 366, "yours": 366, "loupe": 110, "figures": 220, "spectrum": 240}
"""The panels in their order, and how wide each is in picture units."""
_HIGH, _SIDE = 330, 76  # of a row, and of what the loupe shows
_WORST = 60.0  # of the map of errors, in units of CIELAB
_FILTERS = {name: one for name, one in PATTERNS.items() if name != "monochrome"}
_FILTERS["quad-Bayer"] = Pattern.spelled("quad-Bayer", "RRGG RRGG GGBB GGBB")
_TICKS = [(-0.5, "−½"), (0.0, "0"), (0.5, "½")]


@dataclass(frozen=True)
class DemosaicingView(View):
    """A picture under a colour filter array, demosaiced. Light is linear in the mosaic, sRGB on the screen.

    The loupe stands on the pixel (u, v). With `photograph` (height, width, 3) uint8, that is the picture. `panels`
    names what is drawn: the picture, and beside it any of yours, loupe, figures and spectrum. `yours` takes windows
    (n, 5, 5) of a Bayer mosaic around its red and blue pixels to a reader's green (n,) in their middles, `your_mosaic`
    takes a picture and a tile of channels to the mosaic; what comes of one of them stands in the panel yours.
    """

    title: ClassVar[str] = "Demosaicing"
    openable: ClassVar[Mapping[str, str]] = {"loupe": "loupe", "figures": "numbers", "spectrum": "spectrum"}

    picture: str = choice("zone plate", "astronaut", "garden", help="grey rings, a photograph, or the virtual garden")
    highest: float = slider(
        0.6, 0.2, 0.7, 0.01, label="finest rings", unit="cycles/px", help="of the zone plate, at its sides"
    )
    pattern: str = choice(*_FILTERS, help="the filters over the pixels, from the upper left")
    algorithm: str = choice("bilinear", *(one for one in ALGORITHMS if one != "bilinear"), help="how to rebuild it")
    spots_px: float = slider(
        0.0, 0.0, 1.5, 0.05, label="blur before sampling", unit="px", help="by quartz: four spots, so far apart"
    )
    show: str = choice("rebuilt", "mosaic", "false colour", help="the large picture")
    u: float = 235.0
    v: float = 128.0
    panels: str = "picture loupe figures spectrum"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    your_mosaic: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    photograph: NDArray[np.uint8] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        own, wanted = self.photograph, self.panels.split()
        if "picture" not in wanted or not set(wanted) <= {*_WIDE}:
            raise ValueError(f"panels must be picture and any of {', '.join([*_WIDE][1:])}, got {self.panels!r}")
        if own is not None and not (own.dtype == np.uint8 and own.shape[2:] == (3,) and min(own.shape[:2]) >= LOUPE):
            takes = f"uint8 (height, width, 3), at least {LOUPE} pixels each way"
            raise ValueError(f"photograph must be {takes}, got {own.dtype} {own.shape}")

    # What is true ----------------------------------------------------------------------------------------------------

    @property
    def filters(self) -> Pattern:
        return _FILTERS[self.pattern]

    @property
    def used(self) -> str:
        """The algorithm, or bilinear interpolation where that one is for Bayer's patterns only."""
        return self.algorithm if self.filters.is_bayer or self.algorithm in ANY_PATTERN else "bilinear"

    @property
    def source(self) -> Source:
        """What the picture is known by."""
        if self.photograph is not None:
            return self.photograph.tobytes(), self.photograph.shape
        return self.picture, self.highest if self.picture == "zone plate" else 0.0

    @cached_property
    def truth(self) -> NDArray[np.uint8]:
        """The picture, not blurred, as sRGB bytes (height, width, 3)."""
        return mosaic_steps.shown(self.source)

    @cached_property
    def measured(self) -> Array:
        """The mosaic (height, width), linear."""
        return mosaic_steps.measured(self.source, self.filters, self.spots_px)

    @cached_property
    def rebuilt(self) -> NDArray[np.uint8]:
        """The demosaiced picture, as sRGB bytes (height, width, 3)."""
        return mosaic_steps.rebuilt(self.source, self.filters, self.spots_px, self.used)

    @cached_property
    def measures(self) -> Measures:
        """How far it is from the picture."""
        return mosaic_steps.compared(self.source, self.filters, self.spots_px, self.used)

    @cached_property
    def your_picture(self) -> tuple[NDArray[np.uint8] | None, str]:
        """The picture by the reader's function, as sRGB bytes (height, width, 3), or None and what is in the way."""
        if self.your_mosaic is not None:
            light = mosaics.low_pass(mosaic_steps.light(self.source), self.spots_px)
            measured, problem = tried(self.your_mosaic, (light, np.array(self.filters.tile)), self.measured)
            return (None, problem) if problem else (self._developed(measured), "")
        if self.yours is None:
            return None, "No function of yours has been given."
        if not self.filters.is_bayer:
            return None, "Your function looks at windows of a Bayer mosaic: choose one of the four Bayer patterns."
        windows = mosaics.green_windows(self.measured, self.filters)
        green, problem = tried(self.yours, (windows,), windows[:, 2, 2])
        if problem:
            return None, problem
        return to_display(mosaics.with_green(self.measured, self.filters, green, self.used)), ""

    def _developed(self, measured: Array) -> NDArray[np.uint8]:
        """A mosaic as sRGB bytes (height, width, 3): in the colours of its filters where that is shown, or rebuilt."""
        if self.show == "mosaic":
            return to_display(mosaics.in_colour(measured, self.filters))
        return to_display(mosaics.demosaic(measured, self.filters, self.used))

    @property
    def frequency(self) -> Array | None:
        """Of the zone plate's rings under the loupe, (fu, fv) in cycles/pixel; None on another picture."""
        if self.picture != "zone plate" or self.photograph is not None:
            return None
        size = self.truth.shape[0]
        return (np.array(self.at) - 0.5 - (size - 1) / 2) * 2 * self.highest / size

    @property
    def _size(self) -> tuple[int, int]:
        """The picture's width and height."""
        return self.truth.shape[1], self.truth.shape[0]

    @property
    def at(self) -> tuple[int, int]:
        """The pixel under the middle of the loupe, which stays inside the picture."""
        height, width = self.truth.shape[:2]
        half = LOUPE // 2
        return round(min(max(self.u, half), width - half)), round(min(max(self.v, half), height - half))

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        found = self.measures
        return {
            "PSNR": f"{found.psnr_db:.2f} dB",
            "false colour": f"ΔC = {found.false_colour:.1f} on average",
            "zippers": f"{100 * found.zipper:.1f} % of the pixels",
            **self._under_the_loupe(),
        }

    def _told(self) -> dict[str, str]:
        """The figures that the panels speak of."""
        if not self._has("figures"):
            return {}
        loupe = {} if self._has("loupe") else self._under_the_loupe()
        told = {name: one for name, one in self.numbers().items() if name not in loupe}
        if self.yours and self.show != "mosaic" and (pixels := self.your_picture[0]) is not None:
            psnr_db, false_colour = mosaics.psnr(pixels, self.truth), mosaics.false_colour(pixels, self.truth)
            told["yours"] = f"{psnr_db:.2f} dB, ΔC = {false_colour:.1f}"
        return told

    def _under_the_loupe(self) -> dict[str, str]:
        if self.frequency is None:
            return {"loupe at": f"column {self.at[0]}, row {self.at[1]}"}
        fu, fv = self.frequency
        near, (du, dv) = nearest_carrier(self.filters, fu, fv)
        away = float(np.hypot(du, dv))
        beat = f"beats once in {1 / away:.0f} px" if away > 0.005 else "no beat"
        return {"loupe at": true_minus(f"({fu:.2f}, {fv:.2f}) cycles/px"), "carrier": f"{_place(near)}: {beat}"}

    def description(self) -> str:
        figures = f": {listed(self._told())}" if self._has("figures") else ""
        blur = f"four spots {self.spots_px:g} px apart" if self.spots_px else "no blur before sampling"
        name = "a photograph" if self.photograph is not None else f"the {self.picture}"
        rings = f" up to {self.highest:g} cycles/px" if self.frequency is not None else ""
        return f"{name}{rings} under {self.pattern}, {blur}, by {self.used}{figures}. Shown: {self.show}."

    # What it looks like ----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        photographs: dict[str, bytes] = {}
        draw: dict[str, Callable[[], svg.Marks]] = {
            "picture": lambda: self._large_panel(photographs, draft),
            "yours": lambda: self._your_panel(photographs, draft),
            "loupe": lambda: self._loupe_panels(photographs),
            "figures": lambda: readout(self._told(), self._corner("figures", 8, 26), (0, 37), (0, 17)),
            "spectrum": lambda: self._spectrum_panel(photographs),
        }
        return self.tiled(self._layout, {name: draw[name]() for name in self._layout}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        """As many panels in a row as it has room for, in their order."""
        lines: list[dict[str, float]] = [{}]
        for name in filter(self._has, _WIDE):
            if sum(lines[-1].values()) + _WIDE[name] > WIDTH:
                lines.append({})
            lines[-1][name] = _WIDE[name]
        return shortened(rows(*((_HIGH, line) for line in lines)), figures=37 * len(self._told()) + 12)

    def _corner(self, tile: str, right: float, down: float) -> tuple[float, float]:
        """A place in a tile, from its upper left corner."""
        x, y, *_ = self._layout[tile]
        return x + right, y + down

    @cached_property
    def _panel(self) -> Panel:
        widest = _WIDE["picture"] - 20 - _KEY
        return image_panel("picture", 10, 34, widest, *self._size, tallest=widest)

    def _large_panel(self, photographs: dict[str, bytes], draft: bool) -> svg.Marks:
        marks, heading = self._predicted(), dict[str, Any]()
        if self._has("loupe"):
            label = "The picture; drag or press the arrow keys to move the loupe"
            marks, heading = marks + self._frame(), {"hint": "drag the loupe", "drag": "loupe", "label": label}
        if self.show == "false colour":
            return self._map_of_errors(self._panel, self.measures.colour_error, photographs, draft, marks, **heading)
        other = "" if self.used == self.algorithm else f" ({self.algorithm} is for Bayer's patterns)"
        title = f"The mosaic, {self.pattern}" if self.show == "mosaic" else f"Rebuilt: {self.used}{other}"
        photographs["picture"] = jpeg(self._developed(self.measured) if self.show == "mosaic" else self.rebuilt, 90)
        return self._panel.show(placed_image(self._panel, "picture", *self._size) + marks, title=title, **heading)

    def _map_of_errors(
        self, panel: Panel, error: NDArray, photographs: dict[str, bytes], draft: bool, marks: svg.Marks, **heading: Any
    ) -> svg.Marks:
        coarse = cv2.resize(error, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA) if draft else error
        photographs |= {panel.name: heat_map(coarse, 0, _WORST, "error"), f"{panel.name} key": heat_key("error")}
        heading = {"title": "What colour is false", **heading}
        return heat_panel(panel, *self._size, 0, _WORST, "ΔC", marks, **heading)

    def _your_panel(self, photographs: dict[str, bytes], draft: bool) -> svg.Marks:
        """The picture by the reader's function, or what is in the way of it."""
        (x, y), (pixels, problem) = self._corner("yours", 10, 34), self.your_picture
        panel, title = replace(self._panel, name="yours", x=x, y=y), "With your green"
        if self.your_mosaic is not None:
            title = "Your mosaic" if self.show == "mosaic" else "Rebuilt from your mosaic"
        if pixels is None:
            return without(panel, problem, title, (16, 30), placed_image(panel, "picture", *self._size))
        if self.show == "false colour":
            error = mosaics.colour_error(pixels, self.truth)
            title = "What colour is false in yours"
            return self._map_of_errors(panel, error, photographs, draft, self._predicted(), title=title)
        photographs["yours"] = jpeg(pixels, 90)
        return panel.show(placed_image(panel, "yours", *self._size) + self._predicted(), title=title)

    def _predicted(self) -> svg.Marks:
        """Rings on the zone plate where its frequency is one that the pattern takes for colour."""
        if self.frequency is None or self.panels == "picture":
            return svg.NOTHING
        size = self.truth.shape[0]
        places = (size - 1) / 2 + _everywhere(self.filters, self.highest) * size / (2 * self.highest)
        return _rings(self._panel.place(places), 9)

    def _frame(self) -> svg.Marks:
        """The loupe's outline on the picture."""
        u, v = self.at
        left, top = u - LOUPE / 2 - 0.5, v - LOUPE / 2 - 0.5
        outline = self._panel.place(np.array([(0, 0), (LOUPE, 0), (LOUPE, LOUPE), (0, LOUPE)]) + (left, top))
        return svg.polygon(outline, "paper-line") + svg.polygon(outline, "blue thick")

    def _loupe_panels(self, photographs: dict[str, bytes]) -> svg.Marks:
        u, v = self.at
        window = np.s_[v - LOUPE // 2 : v + LOUPE // 2, u - LOUPE // 2 : u + LOUPE // 2]
        filters = self.filters.cropped(u - LOUPE // 2, v - LOUPE // 2)
        seen = {
            "measured": to_display(mosaics.in_colour(self.measured[window], filters)),
            "rebuilt": self.rebuilt[window],
            "truth": self.truth[window],
        }
        body = svg.NOTHING
        for i, (name, pixels) in enumerate(seen.items()):
            panel = Panel(f"loupe {name}", *self._corner("loupe", 6, 34 + 102 * i), _SIDE, _SIDE, 0, 1, 0, 1)
            photographs[panel.name] = png(np.ascontiguousarray(pixels))
            content = svg.image(panel.name, 0, 0, _SIDE, _SIDE, image_rendering="pixelated")
            body += panel.show(content, title=name)
        return body

    def _spectrum_panel(self, photographs: dict[str, bytes]) -> svg.Marks:
        x, y = self._corner("spectrum", 62, 34)
        panel = plot.plot_panel("spectrum", x, y, 148, 148, (-0.5, 0.5), (0.5, -0.5))
        photographs["spectrum"] = jpeg(mosaic_steps.spectrum(self.source, self.filters, self.spots_px))
        places = _everywhere(self.filters, 0.5)
        content = svg.image("spectrum", 0, 0, panel.width, panel.height) + _rings(panel.place(places), 9)
        axes = plot.axes(panel, "fu [cycles/px]", "fv [cycles/px]", _TICKS, _TICKS)
        x, y = self._corner("spectrum", 4, 256)
        listed = [svg.text((x, y), "○ as colour, how strongly", "note")]
        for i, carrier in enumerate(mosaics.carriers(self.filters)[:6]):
            left, top = x + 118 * (i % 2), y + 19 + 18 * (i // 2)
            listed.append(svg.text((left, top), f"{_place(carrier)}", "tick"))
            listed.append(svg.text((left + 104, top), f"{carrier.strength:.2f}", "tick end"))
        return panel.show(content, title="Spectrum") + axes + svg.join(listed)

    # What can be dragged ---------------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> DemosaicingView:
        if handle != "loupe":
            return self
        panel, here = self._panel, np.array(self.at, dtype=float)
        moved = here + np.array([dx, dy]) / panel.scale if np.isnan(x) else panel.data((x - panel.x, y - panel.y))
        height, width = self.truth.shape[:2]
        u, v = np.clip(moved, 0, (width - 1, height - 1)).tolist()
        return self.but(u=u, v=v)

    def pressed(self, handle: str, key: str) -> DemosaicingView:
        """An arrow moves the loupe by one pixel, so that its phase can be followed."""
        steps = {"ArrowLeft": (-1, 0), "ArrowRight": (1, 0), "ArrowUp": (0, -1), "ArrowDown": (0, 1)}
        (u, v), (across, down) = self.at, steps.get(key, (0, 0))
        return self.but(u=float(u + across), v=float(v + down)) if handle == "loupe" else self


def nearest_carrier(pattern: Pattern, fu: float, fv: float) -> tuple[Carrier, Array]:
    """The carrier nearest to a frequency, and (2,) how far the frequency is from it, whole pixels being blind to ±1."""
    best, shortest = mosaics.carriers(pattern)[0], np.array([np.inf, np.inf])
    for carrier in mosaics.carriers(pattern):
        for sign in (1, -1):
            away = np.array([fu, fv]) - (sign * carrier.fu, sign * carrier.fv)
            away -= np.rint(away)
            if np.hypot(*away) < np.hypot(*shortest) - 1e-9:
                best, shortest = carrier, away
    return best, shortest


def _everywhere(pattern: Pattern, highest: float) -> Array:
    """The carriers (n, 2) at each of the frequencies, up to `highest`, that look alike on whole pixels."""
    places = set()
    for one in mosaics.carriers(pattern):
        for sign in (1, -1):
            for across, down in np.ndindex(3, 3):
                fu, fv = sign * one.fu + across - 1, sign * one.fv + down - 1
                if max(abs(fu), abs(fv)) <= highest + 1e-9:
                    places.add((round(fu, 9), round(fv, 9)))
    return np.array(sorted(places), dtype=float).reshape(-1, 2)


def _rings(centres: Array, radius: float) -> svg.Marks:
    lines = [centre + radius * circle(25) for centre in centres]
    return svg.path(lines, "paper-line") + svg.path(lines, "ink")


_FRACTIONS = {round(f, 9): name for f, name in ((0.5, "½"), (0.25, "¼"), (1 / 3, "⅓"), (1 / 6, "⅙"), (0, "0"))}


def _place(carrier: Carrier) -> str:
    """A carrier's frequency in words: (½, 0)."""
    named = [_FRACTIONS.get(round(abs(f), 9), f"{abs(f):.3g}") for f in (carrier.fu, carrier.fv)]
    signs = ["−" if f < 0 else "" for f in (carrier.fu, carrier.fv)]
    return f"({', '.join(map(str.__add__, signs, named))})"
