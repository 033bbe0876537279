"""The read-out visualizer: one exposure leaves the sensor, bucket by bucket or row by row, while the world moves on.

Before a wall in the light of a lamp, a reader's own row time can be drawn beside the sensor's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import Cell, rows
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, curve, grid, plot_panel, upright
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.scenes import textured_scene, to_display
from camviz.sensors.readout import bucket_brigade, row_times
from camviz.views.base import View, answered, choice, slider

ROWS = 480  # of the sensor: what the row time counts
LARGE = (320, 240)  # pixels of a fine picture
SMALL = {"fan": (128, 96), "view from a train": (80, 60), "wall under a lamp": (128, 96)}  # the train is ray-traced
BUCKETS = (16, 12)  # of the brigade drawn, columns and rows
BLADES = 5
EXPOSURE_S = 1e-3
MAINS_HZ = 50.0  # of the lamp, which is bright twice in each period
_ABOVE = (276, {"scene": 330, "picture": 330, "numbers": 300})
LAYOUTS = {
    "pictures": rows(_ABOVE),
    "pictures time": rows(_ABOVE, (272, {"each row’s time": 500})) | {"what happens": (500, 276, 460, 272)},
    "pictures charge time": rows(_ABOVE, (272, {"charge": 330, "each row’s time": 370}))
    | {"what happens": (700, 276, 260, 130)},
}
"""What is drawn, and where."""
_DIM = 0.16  # of what has not been read
_FOV_DEG = 60.0
_ROW_TICKS = [(float(row), str(row)) for row in range(0, ROWS + 1, 120)]
_WORDS = {
    "CCD": "Exposed all at once, so nothing leans. Every charge passes through one amplifier, one after the other.",
    "CMOS, global shutter": "Exposed all at once, so nothing leans, though it is a CMOS sensor. Each pixel keeps its "
    "charge in the dark until its row's turn.",
    "CMOS, rolling shutter": "Each row sees the world a little later than the row above, so what moves is bent.",
}


@dataclass(frozen=True)
class ReadoutView(View):
    """A sensor of 480 rows being read out, `time` percent of the way through one frame.

    A CCD, and a CMOS sensor with a global shutter, expose all rows at once and read them later; a rolling shutter
    exposes each row just before it is read. The fan makes `speed` turns per second, the train `speed` metres; the lamp
    over the wall hangs on the mains, 50 Hz. `panels` is one of LAYOUTS. `yours` is a reader's function from the stripes
    that the lamp leaves in a frame, its rows and the mains frequency to the seconds from row to row.
    """

    title: ClassVar[str] = "Read-out"
    layouts = LAYOUTS

    readout: str = choice(
        "CMOS, rolling shutter", "CMOS, global shutter", "CCD", label="sensor", help="how charge is exposed and read"
    )
    subject: str = choice(
        "fan", "view from a train", "wall under a lamp", label="scene", help="what moves while the sensor is read"
    )
    time: float = slider(55.0, 0.0, 100.0, 1.0, label="time", unit="%", help="how much of the frame has been read")
    speed: float = slider(12.0, 0.0, 40.0, 0.5, label="speed", unit="turns/s or m/s", help="of the fan, or the train")
    row_us: float = slider(64.0, 2.0, 120.0, 1.0, label="row time", unit="µs", help="from one row to the next")
    panels: str = "pictures charge time"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.row_us <= 0:
            raise ValueError(f"row_us must be positive, got {self.row_us}")
        if not 0 <= self.time <= 100:
            raise ValueError(f"time must be a share of the frame, 0 to 100 %, got {self.time}")

    # What is true ----------------------------------------------------------------------------------------------------

    @property
    def frame_s(self) -> float:
        """How long the whole frame takes to read."""
        return ROWS * self.row_us * 1e-6

    @property
    def now_s(self) -> float:
        """The moment shown, from the middle of the first row's exposure."""
        return self.frame_s * self.time / 100

    @property
    def rolling(self) -> bool:
        return "rolling" in self.readout

    @property
    def read_rows(self) -> int:
        """Rows of the sensor that have been read."""
        return round(ROWS * self.time / 100)

    def picture(self, width: int, height: int) -> np.ndarray:
        """The whole picture as this sensor takes it, sRGB bytes (height, width, 3)."""
        return self._pair(width, height)[0]

    def scene_now(self, width: int, height: int) -> np.ndarray:
        """The world at this moment, sRGB bytes (height, width, 3)."""
        return self._pair(width, height)[1]

    def _pair(self, width: int, height: int) -> np.ndarray:
        row_s = self.frame_s / height if self.rolling else 0.0
        return _seen(self.subject, self.speed, self.now_s, row_s, width, height)

    @property
    def stripes(self) -> float:
        """How often the lamp over the wall is bright while a rolling shutter reads one frame."""
        return 2 * MAINS_HZ * self.frame_s

    @cached_property
    def your_row_s(self) -> tuple[float, str]:
        """The seconds from row to row by the reader's function, NaN without an answer, and what is wrong with it."""
        answer, problem = answered(self.yours, (self.stripes, ROWS, MAINS_HZ), 0.0)
        return float(answer), problem

    @cached_property
    def lean_px(self) -> float:
        """How far the world has moved on between the first and the last row, in pixels of a 640 px row.

        For the fan, its tips across the frame; for the train, what stands 3 m away: f v t / Z.
        """
        if not self.rolling:
            return 0.0
        apart_s = (ROWS - 1) * self.row_us * 1e-6
        if self.subject == "fan":
            return float(2 * np.pi * self.speed * apart_s * 0.43 * ROWS)
        return float(320 / np.tan(np.radians(_FOV_DEG / 2)) * self.speed * apart_s / 3)

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        frame = {"frame": f"{ROWS} rows · {self.row_us:g} µs = {1e3 * self.frame_s:.1f} ms"}
        read = {"read so far": f"{self.read_rows} of {ROWS} rows"}
        if self.subject == "wall under a lamp":
            stripes = f"{self.stripes:.2f} in a frame" if self.rolling else "none"
            return frame | {"stripes of the lamp": stripes} | self._your_figure() | read
        unit = "turns/s" if self.subject == "fan" else "m/s"
        what = "a blade's tip" if self.subject == "fan" else "a thing at 3 m"
        apart = {"between first and last row's exposure": f"{what} moves {self.lean_px:.0f} px"}
        return frame | {"speed": f"{self.speed:g} {unit}"} | apart | read

    @property
    def _problem(self) -> str:
        """What is in the way of the reader's row time, where one is asked for."""
        return self.your_row_s[1] if self.yours is not None and self.subject == "wall under a lamp" else ""

    def _your_figure(self) -> dict[str, str]:
        """What the reader's function makes of the stripes."""
        row_s, problem = self.your_row_s
        if self.yours is None or problem:
            return {}
        return {"row time, yours": f"{1e6 * row_s:.4g} µs"}

    def _told(self) -> dict[str, str]:
        figures = self.numbers()
        return figures if "time" in self.panels else {name: figures[name] for name in ("frame", "read so far")}

    def description(self) -> str:
        figures = listed(self._told())
        how = {
            "CCD": "All rows were exposed at once; their charge moves row by row into a register and along it.",
            "CMOS, global shutter": "All rows were exposed at once; each is then read through its columns' amplifiers.",
        }.get(self.readout, "Each row is exposed just before it is read, later than the one above it.")
        return f"{self.readout}, {self.subject}, {self.time:g} % read. {how} {figures}."

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        size = SMALL[self.subject] if draft else LARGE
        whole, now = self._pair(*size)
        read = round(size[1] * self.time / 100)
        partial = whole.copy()
        partial[read:] = (_DIM * whole[read:]).astype(np.uint8)
        parts = {
            "scene": self._photo("scene", 10, "The scene at this moment", size, "moves on"),
            "picture": self._photo("read", 340, "The picture, as far as it is read", size),
            "numbers": self._numbers(),
            "charge": self._buckets(whole) if "charge" in self.panels else "",
        }
        if "time" in self.panels:
            x = self._layout["what happens"][0] + 12
            said = f"{_WORDS[self.readout]}\n{self._problem}".strip()
            words = svg.paragraph((x, 302), said, 948 - x, "label")
            parts |= {"each row’s time": self._timing(), "what happens": words}
        return self.tiled(self._layout, parts, {"scene": jpeg(now), "read": jpeg(partial)})

    @property
    def _layout(self) -> Mapping[str, Cell]:
        return LAYOUTS[self.panels]

    def _photo(self, name: str, x: float, title: str, size: tuple[int, int], note: str = "") -> str:
        panel = image_panel(name, x, 34, 310, *size)
        place = panel.place((0, size[1] * self.time / 100 - 0.5))[1]
        if name == "scene" and not self.rolling:
            line = ""
        else:
            line = svg.line([(0, place), (panel.width, place)], "orange thick")
        return panel.show(placed_image(panel, name, *size) + line, title=title, note=note)

    # The charge ------------------------------------------------------------------------------------------------------

    def _buckets(self, whole: np.ndarray) -> str:
        """The sensor as 16 × 12 buckets, filled after the picture's brightness, at this moment of the read-out."""
        panel = Panel("buckets", 10, 310, 310, 232, 0, 18.6, 0, 13.92)
        charge = cv2.resize(whole.mean(axis=-1).astype(np.float32), BUCKETS, interpolation=cv2.INTER_AREA) / 255
        draw = self._brigade if self.readout == "CCD" else self._rows
        title = "Bucket brigade: one amplifier" if self.readout == "CCD" else "An amplifier in each pixel"
        return panel.show(draw(panel, charge), title=title, note=f"{BUCKETS[0]} × {BUCKETS[1]} pixels")

    def _brigade(self, panel: Panel, charge: Array) -> str:
        """Rows move down into the register; the lowest was the picture's first, for a lens turns it upside down."""
        columns, rows = BUCKETS
        state = bucket_brigade(charge, round(columns * rows * self.time / 100))
        bodies = _squares(panel, state.area[::-1], 1.2, 0.3) + _squares(panel, state.register[None], 1.2, 12.6)
        x, y = panel.place((1.2, 13.1))
        amplifier = svg.polygon([(x - 3, y - 8), (x - 3, y + 8), (x - 19, y)], "orange")
        arrow = "".join(_arrow(panel, (0.62, 3 + 3 * i), (0.62, 5 + 3 * i)) for i in range(3))
        return bodies + amplifier + arrow

    def _rows(self, panel: Panel, charge: Array) -> str:
        """Rows stay; one is selected, and all its columns are read at once."""
        row = min(int(BUCKETS[1] * self.time / 100), BUCKETS[1] - 1)
        left = charge.copy()
        left[:row] = 0
        if self.rolling:
            left[row + 1 :] *= np.clip(1.0 - 0.45 * np.arange(1, BUCKETS[1] - row), 0, 1)[:, None]
        (x0, y0), (x1, y1) = panel.place([(1.1, 0.2 + row), (17.3, 1.3 + row)])
        chosen = svg.path([[(x0, y0), (x1, y0), (x1, y1), (x0, y1)]], "orange thick", closed=True)
        selector = _arrow(panel, (0.05, 0.75 + row), (1.0, 0.75 + row))
        columns = panel.place(np.stack([np.arange(16) + 1.7, np.full(16, 12.75)], axis=-1))
        marks = "".join(svg.polygon(place + [(-5, -4), (5, -4), (0, 5)], "orange") for place in columns)
        return _squares(panel, left, 1.2, 0.3) + chosen + selector + marks

    # The time --------------------------------------------------------------------------------------------------------

    @cached_property
    def _clock(self) -> Panel:
        span = 1e3 * (self.frame_s + EXPOSURE_S)
        left, _, width, _ = self._layout["each row’s time"]
        return plot_panel("timing", left + 64, 310, width - 74, 186, (-1e3 * EXPOSURE_S, span), (ROWS, 0))

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> ReadoutView:
        moved = 100 * dx / (1e3 * self.frame_s * self._clock.scale[0])
        return self.but(time=float(np.clip(self.time + moved, 0, 100)))

    def _timing(self) -> str:
        """When each row is exposed, and when it is read."""
        panel = self._clock
        rows = np.array([0.0, ROWS])
        read = 1e3 * np.array([0.0, self.frame_s])
        start = read - 1e3 * EXPOSURE_S if self.rolling else np.full(2, -1e3 * EXPOSURE_S)
        stop = read if self.rolling else np.zeros(2)
        outline = panel.place(np.stack([np.r_[start, stop[::-1]], np.r_[rows, rows[::-1]]], axis=-1))
        content = (
            grid(panel, yticks=_ROW_TICKS)
            + svg.polygon(outline, "wash fill-blue")
            + svg.path([outline], "blue thin", closed=True)
            + curve(panel, read, rows, "orange thick")
            + upright(panel, 1e3 * self.now_s, "ink")
            + svg.text((panel.width - 8, 18), "exposed", "blue halo end")
            + svg.text((panel.width - 8, 36), "read", "orange halo end")
            + self._your_line(panel)
        )
        return axes(panel, "time [ms]", "row", yticks=_ROW_TICKS) + panel.show(
            content,
            title="Each row's time",
            hint="drag to move on",
            drag="time",
            label="Time of the read-out; drag or press the arrow keys",
        )

    def _your_line(self, panel: Panel) -> str:
        """When each row is read if the reader's row time is right."""
        if self.yours is None or self.subject != "wall under a lamp":
            return ""
        row_s, problem = self.your_row_s
        if problem:
            return ""
        rows = np.linspace(0, ROWS, 13)
        marks = svg.dots(panel.place(np.stack([1e3 * row_s * rows, rows], axis=-1)), "orange", 9)
        return marks + svg.text((panel.width - 8, 54), "dots: read, by your row time", "orange halo end")

    def _numbers(self) -> str:
        return svg.text((672, 26), "This read-out", "title") + readout(self._told(), (672, 50), (0, 46), (0, 20))


def fan(u: ArrayLike, v: ArrayLike, turns: ArrayLike) -> Array:
    """Linear light (..., 3) of a fan turned by `turns`, at u, v in half heights of the picture from its middle.

    The edges of its blades are straight: each lies on a ray from the hub, so that only a shutter can bend them.
    """
    u, v = np.asarray(u, dtype=float), np.asarray(v, dtype=float)
    radius, angle = np.hypot(u, v), np.arctan2(v, u) / (2 * np.pi)
    which = np.mod((angle - np.asarray(turns)) * BLADES, BLADES)
    number = np.floor(which)
    blade = (which - number < 0.42) & (radius < 0.86) & (radius > 0.12)
    light = np.empty((*np.broadcast_shapes(blade.shape, np.shape(turns)), 3))
    light[:] = (0.55, 0.66, 0.74)
    light[blade] = (0.05, 0.13, 0.22)
    light[blade & (number == 0)] = (0.75, 0.28, 0.04)
    light[(radius < 0.12) | ((radius > 0.9) & (radius < 0.94))] = (0.25, 0.25, 0.26)
    return light


@lru_cache(maxsize=2)
def _seen(subject: str, speed: float, now_s: float, row_s: float, width: int, height: int) -> np.ndarray:
    """The picture whose rows are `row_s` apart, and the scene at `now_s`: sRGB bytes (2, height, width, 3)."""
    times = np.concatenate([row_times(height, row_s), np.full(height, now_s)])
    draw: dict[str, Callable[..., np.ndarray]] = {"fan": _fan_rows, "view from a train": _train_rows}
    rows = draw[subject](speed * times, width, height) if subject in draw else _wall_rows(times, width, height)
    both = to_display(rows).reshape(2, height, width, 3)
    both.flags.writeable = False
    return both


def _fan_rows(turns: Array, width: int, height: int) -> Array:
    """Rows (n, width, 3) of the fan's picture, over and over from its first to its last, each turned by its own."""
    u = (np.arange(width) - (width - 1) / 2) / (height / 2)
    v = (np.arange(len(turns)) % height - (height - 1) / 2) / (height / 2)
    return fan(u, v[:, None], turns[:, None])


def _wall_rows(times_s: Array, width: int, height: int) -> Array:
    """Rows (n, width, 3) of a white wall in the light of a lamp that is bright twice in each period of the mains."""
    light = 0.04 + 0.7 * np.sin(2 * np.pi * MAINS_HZ * times_s) ** 2
    return np.broadcast_to(light[:, None, None] * np.array([1.0, 0.97, 0.9]), (len(times_s), width, 3))


def _train_rows(way_m: Array, width: int, height: int) -> NDArray[np.float32]:
    """Rows (n, width, 3) of the view from a train, over and over, each from its own place on the way to the right.

    One call of the tracer for all: what it costs is mostly the same for few rays and for many.
    """
    camera = Camera(Intrinsics.from_fov(width, height, _FOV_DEG))
    rays = np.tile(camera.rays(), (len(way_m) // height, 1, 1))
    origins = np.zeros_like(rays)
    origins[..., 0] = way_m[:, None]
    return textured_scene().trace(origins, rays, spread=1 / camera.intrinsics.fx)[0]


def _squares(panel: Panel, charge: Array, left: float, top: float) -> str:
    """Buckets, and in each a square as large as its charge (rows, columns), 0…1."""
    rows, columns = charge.shape
    v, u = np.mgrid[:rows, :columns] + 0.5
    centres = panel.place(np.stack([u + left, v + top], axis=-1).reshape(-1, 1, 2))
    side = panel.scale[0] * 0.46
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
    filled = np.sqrt(np.clip(charge, 0, 1)).reshape(-1, 1, 1) * side
    wells = svg.path(centres + side * corners, "grid", closed=True)
    full = filled[:, 0, 0] > 0.5
    return wells + svg.path((centres + filled * corners)[full], "fill-blue", closed=True)


def _arrow(panel: Panel, start: tuple[float, float], end: tuple[float, float]) -> str:
    a, b = panel.place([start, end])
    along = (b - a) / np.hypot(*(b - a))
    aside = np.array([-along[1], along[0]])
    return svg.line([a, b], "muted") + svg.path([[b - 6 * along + 4 * aside, b, b - 6 * along - 4 * aside]], "muted")
