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
from camviz.draw.flow import WIDTH, Cell, rows, shortened
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, curve, grid, plot_panel, upright
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.scenes import textured_scene, to_display
from camviz.sensors.readout import bucket_brigade, row_times
from camviz.views.base import View, answered, choice, positive, slider
from camviz.views.yours import placeholder

ROWS = 480  # of the sensor: what the row time counts
LARGE = (320, 240)  # pixels of a fine picture
SMALL = {"fan": (128, 96), "view from a train": (80, 60), "wall under a lamp": (128, 96)}  # the train is ray-traced
BUCKETS = (16, 12)  # of the brigade drawn, columns and rows
BLADES, BLADE = 5, 0.42  # of the fan: how many, and which share of its circle each fifth has
TIP = 0.43  # of the sensor's height: how far a blade reaches from the hub
MAINS_HZ = 50.0  # of the lamp, which is bright twice in each period
_SIZES = {"scene": (330, 276), "picture": (330, 276), "numbers": (300, 276), "charge": (330, 276), "time": (370, 276)}
_SIZES |= {"what happens": (260, 130)}
"""The panels in their order, and how wide and high each is in picture units."""
_DIM = 0.16  # of what has not been read
_FOV_DEG = 60.0
_ROW_TICKS = [(float(row), str(row)) for row in range(0, ROWS + 1, 120)]
_WORDS = {
    "CCD": "All rows are exposed at once, so nothing leans; then all charge passes, row by row, through one amplifier.",
    "CMOS, global shutter": "All rows are exposed at once, so nothing leans; each waits in the dark till it is read.",
    "CMOS, rolling shutter": "Each row is exposed just before it is read, later than the one above: what moves bends.",
}


@dataclass(frozen=True)
class ReadoutView(View):
    """A sensor of 480 rows being read out, `time` percent of the way through one frame.

    A CCD, and a CMOS sensor with a global shutter, expose all rows at once and read them later; a rolling shutter
    exposes each row just before it is read. The fan makes `speed` turns per second, the train `speed` metres; the lamp
    over the wall hangs on the mains, 50 Hz. Each exposure lasts `exposure_ms`, until the row is read or, for a shutter
    that exposes all rows at once, until the first row is. `panels` names what is drawn: the picture, and any of scene,
    numbers, charge and time. `yours` is a reader's function from the stripes that the lamp leaves in a frame, its rows
    and the mains frequency to the seconds from row to row.
    """

    title: ClassVar[str] = "Read-out"
    openable: ClassVar[Mapping[str, str]] = {"scene": "scene", "time": "each row’s time", "charge": "charge"}

    readout: str = choice(
        "CMOS, rolling shutter", "CMOS, global shutter", "CCD", label="sensor", help="how charge is exposed and read"
    )
    subject: str = choice(
        "fan", "view from a train", "wall under a lamp", label="scene", help="what moves while the sensor is read"
    )
    time: float = slider(55.0, 0.0, 100.0, 1.0, label="time", unit="%", help="how much of the frame has been read")
    speed: float = slider(12.0, 0.0, 40.0, 0.5, label="speed", unit="turns/s or m/s", help="of the fan, or the train")
    row_us: float = slider(64.0, 2.0, 120.0, 1.0, label="row time", unit="µs", help="from one row to the next")
    exposure_ms: float = slider(1.0, 0.1, 10.0, 0.1, label="exposure", unit="ms", help="how long a row gathers light")
    panels: str = "scene picture numbers charge time"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "row_us", "exposure_ms")
        if not 0 <= self.time <= 100:
            raise ValueError(f"time must be a share of the frame, 0 to 100 %, got {self.time}")
        if "picture" not in (wanted := self.panels.split()) or not set(wanted) <= {*_SIZES}:
            raise ValueError(f"panels must be picture and any of {', '.join(_SIZES)}, got {self.panels!r}")

    # What is true ----------------------------------------------------------------------------------------------------

    @property
    def frame_s(self) -> float:
        """How long the whole frame takes to read."""
        return ROWS * self.row_us * 1e-6

    @property
    def rolling(self) -> bool:
        return "rolling" in self.readout

    def picture(self, width: int, height: int) -> np.ndarray:
        """The whole picture as this sensor takes it, sRGB bytes (height, width, 3)."""
        row_s = self.frame_s / height if self.rolling else 0.0
        return _seen(self.subject, self.speed, 0.0, row_s, self.exposure_ms / 1000, width, height)

    def scene_now(self, width: int, height: int) -> np.ndarray:
        """The world at this moment, `time` percent of a frame after the first row is read; bytes as above."""
        return _seen(self.subject, self.speed, self.frame_s * self.time / 100, 0.0, 0.0, width, height)

    @property
    def stripes(self) -> float:
        """How often the lamp over the wall is bright while a rolling shutter reads one frame."""
        return 2 * MAINS_HZ * self.frame_s

    @cached_property
    def your_row_s(self) -> tuple[float, str]:
        """The seconds from row to row by the reader's function, NaN without an answer, and what is wrong with it."""
        if self.yours is None or self.subject != "wall under a lamp":
            return float("nan"), ""
        answer, problem = answered(self.yours, (self.stripes, ROWS, MAINS_HZ), 0.0)
        return float(answer), problem

    def moved_px(self, seconds: float) -> float:
        """How far the world moves in that time, in pixels of a 640 px row.

        Of the fan it is the tip of a blade that moves, along its circle; from the train what is 3 m away: f v t / Z.
        """
        if self.subject == "fan":
            return float(2 * np.pi * self.speed * seconds * TIP * ROWS)
        return float(320 / np.tan(np.radians(_FOV_DEG / 2)) * self.speed * seconds / 3)

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        frame = {"frame": f"{ROWS} rows · {self.row_us:g} µs = {1e3 * self.frame_s:.1f} ms"}
        so_far = f"{round(ROWS * self.time / 100)} of {ROWS} rows"
        read = {"exposure": f"{self.exposure_ms:g} ms", "read so far": so_far}
        if self.subject == "wall under a lamp":
            stripes, (row_s, problem) = f"{self.stripes:.2f} in a frame" if self.rolling else "none", self.your_row_s
            yours = {} if problem or self.yours is None else {"row time, yours": f"{1e6 * row_s:.4g} µs"}
            return frame | {"stripes of the lamp": stripes} | yours | read
        unit, what = ("turns/s", "a blade's tip") if self.subject == "fan" else ("m/s", "a thing at 3 m")
        seconds = self.exposure_ms / 1000, (ROWS - 1) * self.row_us * 1e-6 * self.rolling
        blur, lean = (f"{what} moves {self.moved_px(one):.0f} px" for one in seconds)
        moved = {"during one exposure": blur, "between first and last row's exposure": lean}
        return frame | {"speed": f"{self.speed:g} {unit}"} | moved | read

    def description(self) -> str:
        return f"{self.readout}, {self.subject}, {self.time:g} % read. {_WORDS[self.readout]} {listed(self.numbers())}."

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        size = SMALL[self.subject] if draft else LARGE
        whole = self.picture(*size)
        partial, read = whole.copy(), round(size[1] * self.time / 100)
        partial[read:] = (_DIM * whole[read:]).astype(np.uint8)
        photographs = {"picture": jpeg(partial)}
        if self._has("scene"):
            photographs["scene"] = jpeg(self.scene_now(*size))
        title = "The picture, as far as it is read" if self.time < 100 else "The picture"
        draw: dict[str, Callable[[], svg.Marks]] = {
            "scene": lambda: self._photo("scene", "The scene at this moment", size, "moves on"),
            "picture": lambda: self._photo("picture", title, size),
            "numbers": self._numbers,
            "charge": lambda: self._buckets(whole),
            "time": self._timing,
            "what happens": self._words,
        }
        return self.tiled(self._layout, {name: draw[name]() for name in self._layout}, photographs)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        return in_rows(_SIZES, lambda name: self._has("time" if name == "what happens" else name))

    def _photo(self, name: str, title: str, size: tuple[int, int], note: str = "") -> svg.Marks:
        panel = image_in(self._layout[name], name, *size)
        place = panel.place((0, size[1] * self.time / 100 - 0.5))[1]
        marked = self.time < 100 and (self.rolling or name == "picture")
        line = svg.line([(0, place), (panel.width, place)], "orange thick") if marked else svg.NOTHING
        return panel.show(placed_image(panel, name, *size) + line, title=title, note=note)

    def _buckets(self, whole: np.ndarray) -> svg.Marks:
        """The sensor as 16 × 12 buckets, filled after the picture's brightness, at this moment of the read-out."""
        left, top, *_ = self._layout["charge"]
        panel = Panel("buckets", left + 10, top + 34, 310, 232, 0, 18.6, 0, 13.92)
        charge = cv2.resize(whole.mean(axis=-1).astype(np.float32), BUCKETS, interpolation=cv2.INTER_AREA) / 255
        draw = self._brigade if self.readout == "CCD" else self._rows
        title = "Bucket brigade: one amplifier" if self.readout == "CCD" else "An amplifier in each pixel"
        return panel.show(draw(panel, charge), title=title, note=f"{BUCKETS[0]} × {BUCKETS[1]} pixels")

    def _brigade(self, panel: Panel, charge: Array) -> svg.Marks:
        """Rows move down into the register; the lowest was the picture's first, for a lens turns it upside down."""
        columns, rows = BUCKETS
        state = bucket_brigade(charge, round(columns * rows * self.time / 100))
        bodies = _squares(panel, state.area[::-1], 1.2, 0.3) + _squares(panel, state.register[None], 1.2, 12.6)
        x, y = panel.place((1.2, 13.1))
        amplifier = svg.polygon([(x - 3, y - 8), (x - 3, y + 8), (x - 19, y)], "orange")
        arrow = svg.join(_arrow(panel, (0.62, 3 + 3 * i), (0.62, 5 + 3 * i)) for i in range(3))
        return bodies + amplifier + arrow

    def _rows(self, panel: Panel, charge: Array) -> svg.Marks:
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
        marks = svg.join(svg.polygon(place + [(-5, -4), (5, -4), (0, 5)], "orange") for place in columns)
        return _squares(panel, left, 1.2, 0.3) + chosen + selector + marks

    @cached_property
    def _clock(self) -> Panel:
        left, top, *_ = self._layout["time"]
        return plot_panel(
            "timing", left + 64, top + 34, 296, 186, (-self.exposure_ms, 1e3 * self.frame_s + 1), (ROWS, 0)
        )

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> ReadoutView:
        moved = 100 * dx / (1e3 * self.frame_s * self._clock.scale[0])
        return self.but(time=float(np.clip(self.time + moved, 0, 100)))

    def _words(self) -> svg.Marks:
        x, y, *_ = self._layout["what happens"]
        return svg.paragraph((x + 16, y + 30), placeholder(self.your_row_s[1]) or _WORDS[self.readout], 238, "label")

    def _timing(self) -> svg.Marks:
        """When each row is exposed, and when it is read."""
        panel = self._clock
        rows = np.array([0.0, ROWS])
        read = 1e3 * np.array([0.0, self.frame_s])
        start = read - self.exposure_ms if self.rolling else np.full(2, -self.exposure_ms)
        stop = read if self.rolling else np.zeros(2)
        outline = panel.place(np.stack([np.r_[start, stop[::-1]], np.r_[rows, rows[::-1]]], axis=-1))
        content = (
            grid(panel, yticks=_ROW_TICKS)
            + svg.polygon(outline, "wash fill-blue")
            + svg.path([outline], "blue thin", closed=True)
            + curve(panel, read, rows, "orange thick")
            + upright(panel, 1e3 * self.frame_s * self.time / 100, "ink")
            + svg.text((panel.width - 22, 18), "exposed", "blue halo end")
            + svg.text((panel.width - 22, 36), "read", "orange halo end")
            + self._your_line(panel)
        )
        shown = panel.show(
            content,
            title="Each row's time",
            hint="drag to move on",
            drag="time",
            label="Time of the read-out; drag or press the arrow keys",
        )
        return shown + axes(panel, "time [ms]", "row", yticks=_ROW_TICKS)

    def _your_line(self, panel: Panel) -> svg.Marks:
        """When each row is read if the reader's row time is right."""
        if np.isnan(self.your_row_s[0]):
            return svg.NOTHING
        rows = np.linspace(0, ROWS, 13)
        marks = svg.dots(panel.place(np.stack([1e3 * self.your_row_s[0] * rows, rows], axis=-1)), "orange", 9)
        return marks + svg.text((panel.width - 8, 54), "dots: read, by your row time", "orange halo end")

    def _numbers(self) -> svg.Marks:
        x, y, *_ = self._layout["numbers"]
        figures = readout(self.numbers(), (x + 12, y + 50), (0, 39), (0, 18))
        return svg.text((x + 12, y + 26), "This read-out", "title") + figures


def in_rows(sizes: Mapping[str, tuple[float, float]], shown: Callable[[str], bool]) -> dict[str, Cell]:
    """The panels that are shown, of these widths and heights: as many in a row as it has room for, in their order."""
    lines: list[dict[str, float]] = [{}]
    for name in filter(shown, sizes):
        if sum(lines[-1].values()) + sizes[name][0] > WIDTH:
            lines.append({})
        lines[-1][name] = sizes[name][0]
    heights = {name: height for name, (_, height) in sizes.items()}
    return shortened(rows(*((max(heights[name] for name in line), line) for line in lines)), **heights)


def fan(u: ArrayLike, v: ArrayLike, turns: ArrayLike, during: float = 0.0) -> Array:
    """Linear light (..., 3) of a fan turned by `turns`, at u, v in half heights of the picture from its middle.

    It is the mean while the fan came there through `during` turns. The edges of its blades are straight: each lies on a
    ray from the hub, so that only a shutter can bend them.
    """
    u, v = np.asarray(u, dtype=float), np.asarray(v, dtype=float)
    radius, angle = np.hypot(u, v), np.arctan2(v, u) / (2 * np.pi)
    behind = (angle - np.asarray(turns)) * BLADES  # the first blade's edge, counted in blades
    swept = during * BLADES
    reached = (radius < 0.86) & (radius > 0.12)

    def covered(every: int) -> Array:
        """For how much of the time one blade of `every` is there."""
        if not swept:
            return reached * (np.mod(behind, every) < BLADE).astype(float)
        ends = np.stack([behind, behind + swept])
        passed = BLADE * np.floor(ends / every) + np.minimum(np.mod(ends, every), BLADE)
        return (passed[1] - passed[0]) / swept * reached

    blades, orange = covered(1)[..., None], covered(BLADES)[..., None]
    light = (1 - blades) * (0.55, 0.66, 0.74) + (blades - orange) * (0.05, 0.13, 0.22) + orange * (0.75, 0.28, 0.04)
    light[(radius < 0.12) | ((radius > 0.9) & (radius < 0.94))] = (0.25, 0.25, 0.26)
    return light


@lru_cache(maxsize=2)
def _seen(
    subject: str, speed: float, start_s: float, row_s: float, exposure_s: float, width: int, height: int
) -> np.ndarray:
    """The picture whose rows are read `row_s` apart from `start_s` on, as sRGB bytes (height, width, 3)."""
    times = start_s + row_times(height, row_s)
    if subject == "fan":
        u, v = ((np.arange(size) - (size - 1) / 2) / (height / 2) for size in (width, height))
        light = fan(u, v[:, None], speed * times[:, None], speed * exposure_s)
    elif subject == "wall under a lamp":
        light = _wall_rows(times, exposure_s, width)
    else:
        count = int(np.clip(60 * speed * exposure_s, 1, 5))  # of moments, a few centimetres apart
        moments = exposure_s * (np.arange(count) + 0.5) / count
        light = np.mean([_train_rows(speed * (times - one), width, height) for one in moments], axis=0)
    picture = to_display(light)
    picture.flags.writeable = False
    return picture


def _wall_rows(times_s: Array, exposure_s: float, width: int) -> Array:
    """Rows (n, width, 3) of a white wall in the light of a lamp that is bright twice in each period of the mains."""
    half = np.pi * MAINS_HZ * exposure_s  # of the angle that the current passes meanwhile; sin² is ½ − ½ cos of twice
    middle = 2 * np.pi * MAINS_HZ * times_s - half
    light = 0.04 + 0.7 * (0.5 - 0.5 * np.cos(2 * middle) * np.sinc(2 * half / np.pi))
    return np.broadcast_to(light[:, None, None] * np.array([1.0, 0.97, 0.9]), (len(times_s), width, 3))


def _train_rows(way_m: Array, width: int, height: int) -> NDArray[np.float32]:
    """The view from a train (height, width, 3), each row from its own place on the way to the right."""
    camera = Camera(Intrinsics.from_fov(width, height, _FOV_DEG))
    rays = camera.rays()
    origins = np.zeros_like(rays)
    origins[..., 0] = way_m[:, None]
    return textured_scene().trace(origins, rays, spread=1 / camera.intrinsics.fx)[0]


def _squares(panel: Panel, charge: Array, left: float, top: float) -> svg.Marks:
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


def _arrow(panel: Panel, start: tuple[float, float], end: tuple[float, float]) -> svg.Marks:
    a, b = panel.place([start, end])
    along = (b - a) / np.hypot(*(b - a))
    aside = np.array([-along[1], along[0]])
    return svg.line([a, b], "muted") + svg.path([[b - 6 * along + 4 * aside, b, b - 6 * along - 4 * aside]], "muted")
