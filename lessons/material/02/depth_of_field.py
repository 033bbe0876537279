"""The depth-of-field visualizer: a lens and its rays, the photograph those rays make, and how sharp it can be where.

A reader's own blur and their own limits of the depth of field can be drawn beside the right ones.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, ClassVar, Self

import numpy as np

from camviz import optics
from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.panel import Panel, image_in, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.plot import axes, band, curve, legend, logarithmic, logarithmic_grid, logs, plot_panel, upright
from camviz.draw.readout import listed, readout
from camviz.poses import RigidTransform
from camviz.scenes import to_display
from camviz.views.base import View, choice, positive, slider, step_of, switch, without
from camviz.views.yours import is_unwritten, tried
from camviz_school.views import lens_diagram, parallax
from camviz_school.views.aperture import Aperture, ThinLensCamera
from camviz_school.views.blur_levels import BLURS, DEPTHS, levels, micrometres
from camviz_school.views.garland import DUSK, GLOBE_M, GLOBE_Z, STAND, garden_at_dusk, garden_with_lamps
from camviz_school.views.lens_tiles import NARROW, PANELS, TILES, lens_tiles

SENSORS = {"full frame": 36.0, "APS-C": 23.5, "Four Thirds": 17.3}
DRAFT, FINE = (0.25, 8, 24), (1.0, 32, 128)  # points of the lens for a pixel of the largest blur; at least, at most
LAMPLIT_DRAFT, LAMPLIT_FINE = (0.25, 24, 64), (1.0, 64, 224)  # a lamp alone in the dark shows each of them
SHOWN = 64  # points in the picture of the aperture
_NEAREST_M = 1.0  # of what is in the picture, in most states
LIGHT_N = 4.0  # the f-number for which a fixed exposure is right
_SHAPES = {"disc": ("disc", 6), "hexagon": ("polygon", 6), "ring": ("ring", 6), "heart": ("heart", 6)}


@dataclass(frozen=True)
class DepthOfFieldView(View):
    """A thin lens of `focal_mm` at `f_number`, focused at `focus_m`, `distance_m` before a globe in the garden.

    When the focal length changes, `hold` says what stays: the f-number, the diameter of the aperture, or the framing,
    for which the camera steps back or forth until the globe is as large as before, and the focus with it. The picture
    is traced through the aperture's shape, of which a half may be covered. `match_exposure` exposes for as long as the
    f-number needs; otherwise as f/4 needs. A covered half is never made up for. Without `diffraction` the view says
    nothing of the Airy disc, and without `bounds` nothing of the depth of field, for readers who are yet to meet them.
    `dusk` lights the garden with lamps of many colours.

    `panels` names what is drawn: the photograph, and beside it any of rays, blur, sensor (the cones that meet there)
    and numbers; the figures are those that the panels speak of. `yours` is a reader's blur(f, N, s, u) for points
    u (...), and `your_limits` a reader's limits(f, N, s, c) for focus distances s (...), two arrays, all in
    millimetres; both are drawn in orange over the blur.
    """

    title: ClassVar[str] = "Lens and depth of field"
    openable: ClassVar[Mapping[str, str]] = {
        "rays": "rays",
        "sensor": "at the sensor",
        "blur": "blur curve",
        "numbers": "numbers",
    }

    focal_mm: float = slider(50.0, 20.0, 100.0, 1.0, label="focal length f", unit="mm")
    f_number: float = slider(2.0, 1.4, 22.0, 0.1, label="f-number N", help="focal length / diameter of the aperture")
    focus_m: float = slider(2.3, 0.8, 10.0, 0.05, label="focus s", unit="m", help="the distance that is sharp")
    distance_m: float = slider(2.3, 1.0, 6.0, 0.05, label="distance Z", unit="m", help="from the lens to the globe")
    sensor: str = choice("full frame", *list(SENSORS)[1:], label="sensor", help="36, 23.5 or 17.3 mm wide")
    hold: str = choice("f-number", "diameter", "framing", label="hold fixed", help="while the focal length changes")
    aperture: str = choice("disc", "hexagon", "ring", "heart", label="aperture", help="the shape of the stop")
    covered: str = choice("nothing", "left half", "upper half", label="cover", help="black card before the lens")
    match_exposure: bool = switch(True, label="match exposure", help="expose as long as the f-number needs")
    diffraction: bool = True
    bounds: bool = True
    dusk: bool = False
    panels: str = "rays photograph blur sensor numbers"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    your_limits: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        positive(self, "focal_mm", "f_number", "focus_m", "distance_m")
        if not 1000 * min(self.focus_m, self.distance_m) > self.focal_mm:
            raise ValueError(f"focus_m and distance_m must lie beyond the focal length, got {self.focus_m} m")
        wanted = self.panels.split()
        if "photograph" not in wanted or not set(wanted) <= set(PANELS):
            raise ValueError(f"panels must be photograph and any of {', '.join(self.openable)}, got {self.panels!r}")

    @classmethod
    def at_dusk(cls, **state: Any) -> Self:
        """A long lens, wide open, before the garden's lamps in the evening, and nothing else open."""
        first: dict[str, Any] = {"focal_mm": 85.0, "f_number": 1.4, "distance_m": 4.5, "focus_m": 7.4, "dusk": True}
        first |= {"diffraction": False, "bounds": False, "panels": "photograph"}
        return cls(**{**first, **state})

    def but(self, **changes: Any) -> Self:
        """The same view with some fields changed, and what `hold` makes of another focal length or sensor."""
        changed = super().but(**changes)
        if changed.hold == "diameter" and "f_number" not in changes:
            number = float(np.clip(changed.focal_mm / self.lens.aperture_mm, *self._range("f_number")))
            return replace(changed, f_number=number)
        return self._stepped(changed) if changed.hold == "framing" and "distance_m" not in changes else changed

    def _stepped(self, changed: Self) -> Self:
        """m / sensor stays: m = f / (Z - f), so Z = f (1 + 1/m). The focus moves with the camera."""
        zoom = SENSORS[changed.sensor] / SENSORS[self.sensor]
        m = float(optics.magnification(self.focal_mm, 1000 * self.distance_m)) * zoom
        if zoom == 1 and changed.focal_mm == self.focal_mm:
            return changed
        distance = float(np.clip(changed.focal_mm * (1 + 1 / m) / 1000, *self._range("distance_m")))
        focus = changed.focus_m + distance - self.distance_m
        return replace(changed, distance_m=distance, focus_m=float(np.clip(focus, *self._range("focus_m"))))

    @classmethod
    def _range(cls, name: str) -> tuple[float, float]:
        control = cls.controls()[name]
        return float(control.low or 0), float(control.high or 0)

    # What is true ----------------------------------------------------------------------------------------------------

    @cached_property
    def lens(self) -> ThinLensCamera:
        """The camera that takes the picture."""
        shape, blades = _SHAPES[self.aperture]
        pose = RigidTransform.from_translation([*STAND, GLOBE_Z - self.distance_m])
        stop = Aperture(shape, blades, self.covered)  # type: ignore[arg-type]
        sensor = SENSORS[self.sensor]
        return ThinLensCamera(320, 240, sensor, self.focal_mm, self.f_number, self.focus_m, stop, pose)

    @property
    def circle_mm(self) -> float:
        """The largest disc that passes for a point: 1/1500 of the sensor's diagonal, 0.03 mm for full frame."""
        return self.lens.sensor_mm * 1.25 / 1500

    @property
    def limits_m(self) -> tuple[float, float]:
        """Nearest and farthest distance that is blurred by no more than that."""
        args = (self.focal_mm, self.f_number, 1000 * self.focus_m, self.circle_mm)
        return float(optics.near_limit_mm(*args)) / 1000, float(optics.far_limit_mm(*args)) / 1000

    def blur_mm(self, depth_m: np.ndarray | float) -> np.ndarray:
        """Diameter (...) of the disc that a point at depth (...) makes on the sensor."""
        depth_mm = 1000 * np.asarray(depth_m)
        return optics.circle_of_confusion_mm(self.focal_mm, self.f_number, 1000 * self.focus_m, depth_mm)

    @cached_property
    def open_share(self) -> float:
        """The share of the lens's area that is open."""
        return float(self.lens.points(4096)[1].mean())

    @property
    def working_f_number(self) -> float:
        """N (1 + m) = v / D: how wide the cones are that meet on the sensor, m belonging to the distance in focus."""
        m = optics.magnification(self.focal_mm, 1000 * self.focus_m)
        return float(optics.working_f_number(self.f_number, m))

    @property
    def airy_mm(self) -> float:
        """Diameter of the Airy disc on the sensor, 2.44 λ v / D."""
        return 2e-3 * float(optics.airy_radius_um(self.working_f_number))

    @property
    def brightness(self) -> float:
        """Exposure of the sensor, 1 being correct: open area over image distance squared, ∝ share / (N (1 + m))²."""
        fixed = (LIGHT_N / self.working_f_number) ** 2
        return self.open_share * (1.0 if self.match_exposure else fixed)

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        near, far = self.limits_m
        field_ = optics.field_of_view_deg(self.lens.sensor_mm, self.lens.image_mm)
        m = float(optics.magnification(self.focal_mm, 1000 * self.distance_m))
        blur = float(self.blur_mm(self.distance_m))
        hyperfocal = float(optics.hyperfocal_mm(self.focal_mm, self.f_number, self.circle_mm)) / 1000
        return {
            "aperture": f"{self.focal_mm:g} mm / {self.f_number:.3g} = {self.lens.aperture_mm:.1f} mm",
            "sensor at v": f"{self.lens.image_mm:.2f} mm behind the lens",
            "field of view": f"{field_:.1f}° across",
            "globe on the sensor": f"{1000 * GLOBE_M * m:.1f} mm, m = 1 : {1 / m:.0f}",
            "blur of the globe": f"{1000 * blur:.0f} µm = {blur * 320 / self.lens.sensor_mm:.1f} px",
            "depth of field": f"{_range_m(near, far)}",
            "hyperfocal distance": f"{hyperfocal:.2f} m",
            **({"Airy disc": f"{1000 * self.airy_mm:.1f} µm across"} if self.diffraction else {}),
            "light": f"{_percent(self.brightness)} of a correct exposure",
        }

    def _told(self) -> dict[str, str]:
        left_out = set()
        if not (self._has("rays") and self._has("blur")):
            left_out |= {"field of view", "globe on the sensor"}
        if not self._has("blur"):
            left_out |= {"blur of the globe", "Airy disc"}
        if not (self._has("blur") and self.bounds):
            left_out |= {"depth of field", "hyperfocal distance"}
        return {name: figure for name, figure in self.numbers().items() if name not in left_out}

    def equation(self) -> str:
        """The lens equation, with this state's numbers."""
        return f"1/{self.focal_mm:g} = 1/{1000 * self.focus_m:.0f} + 1/{self.lens.image_mm:.2f}"

    def description(self) -> str:
        figures = listed(self._told())
        return (
            f"A lens of {self.focal_mm:g} mm at f/{self.f_number:.3g}, focused at {self.focus_m:.2f} m, "
            f"{self.distance_m:.2f} m from the globe, {self.sensor} sensor, aperture {self.aperture}, "
            f"covered: {self.covered}. {figures}."
        )

    def image(self, samples: int | None = None, *, rough: bool = False) -> np.ndarray:
        """The photograph, upright, as sRGB bytes (240, 320, 3); a `rough` one takes less time.

        It is traced through `samples` points of the lens, at first as many as the blur needs.
        """
        least, most = (LAMPLIT_DRAFT, LAMPLIT_FINE) if self.dusk else (DRAFT, FINE)
        samples = samples or self.samples_for(*(least if rough else most))
        light = parallax.photograph(
            garden_at_dusk() if self.dusk else garden_with_lamps(), self.lens, samples, rough=rough
        )
        share = self.lens.points(samples)[1].mean()
        return to_display(light * (DUSK if self.dusk else 1) * np.float32(self.brightness / share))

    def samples_for(self, per_px: float, least: int, most: int) -> int:
        """How many points of the lens fill the largest disc, of what is far away or as near as anything shown."""
        sharp = 1 / self.focus_m
        radius = self.lens.parallax_px * max(sharp, 1 / _NEAREST_M - sharp)
        return int(np.clip(per_px * np.pi * radius**2, least, most))

    # What it looks like ----------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        draw = {
            "rays": self._ray_panel,
            "photograph": self._photograph_panel,
            "blur": self._blur_panel,
            "sensor": lambda: self._loupe_panel() + self._aperture_panel(),
            "numbers": self._numbers,
        }
        tiles = {TILES.get(name, name): cell for name, cell in self._layout.items()}
        parts = {TILES.get(name, name): draw[name]() for name in self._layout}
        return self.tiled(tiles, parts, {"lens": _photographed(self._photographed_alone, draft)})

    @property
    def _photographed_alone(self) -> Self:
        """The view as far as its photograph depends on it: another panel has nothing traced anew."""
        nobodys: dict[str, Any] = {"yours": None, "your_limits": None}
        return replace(self, panels="photograph", hold="f-number", diffraction=True, bounds=True, **nobodys)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        return lens_tiles(self.panels.split())

    @cached_property
    def _rays(self) -> Panel:
        x, y, width, height = self._layout["rays"]
        return lens_diagram.diagram_panel(x + 10, y + 34, width - 20, height - 44)

    def _ray_panel(self) -> svg.Marks:
        content = lens_diagram.rays(self._rays, self.lens, 1000 * self.distance_m)
        label = "Rays through the lens; drag or press the arrow keys to move the object"
        content += svg.text((8, self._rays.height - 10), "← infinity", "note halo")
        hint, title = "drag the object", "Thin lens, to scale behind the lens"
        return self._rays.show(content, title=title, hint=hint, drag="object", label=label)

    @cached_property
    def _loupe(self) -> Panel:
        x, y, width, _ = self._layout["sensor"]
        across = width - 20 if width < NARROW else width - 234
        return lens_diagram.loupe_panel(x + 10, y + 34, across, 140, self.lens.image_mm)

    def _loupe_panel(self) -> svg.Marks:
        depths = [(1000 * self.distance_m, "blue", "globe"), (np.inf, "orange", "far away")]
        content = lens_diagram.loupe(self._loupe, self.lens, depths)
        label = "Around the sensor, enlarged; drag or press the arrow keys to move the sensor"
        note = "10 mm wide, 2.5 mm tall"
        return self._loupe.show(content, title="At the sensor", note=note, drag="sensor", label=label)

    def _aperture_panel(self) -> svg.Marks:
        x, y, width, _ = self._layout["sensor"]
        x, y, width = (x + 10, y + 214, width - 20) if width < NARROW else (x + width - 210, y + 34, 200)
        across = 1.1 * width / 140
        panel = Panel("aperture", x, y, width, 140, -across, across, -1.1, 1.1)
        points, passes = self.lens.points(SHOWN)
        content = lens_diagram.opening(panel, self.lens.aperture, points, passes)
        return panel.show(content, title="Points of the lens")

    def _photograph_panel(self) -> svg.Marks:
        panel = image_in(self._layout["photograph"], "lens", 320, 240)
        note = "" if len(self._layout) == 1 else f"{self.lens.sensor_mm:g} × {0.75 * self.lens.sensor_mm:.3g} mm"
        return panel.show(placed_image(panel, "lens", 320, 240), title="The photograph, traced", note=note)

    @cached_property
    def _plot(self) -> Panel:
        x, y, width, height = self._layout["blur"]
        return plot_panel("blur", x + 70, y + 34, width - 82, height - 84, logs(DEPTHS), logs(BLURS))

    def _blur_panel(self) -> svg.Marks:
        panel, (near, far) = self._plot, self.limits_m
        around = 1 + np.outer((-1, 1), np.geomspace(1e-4, 0.1, 9)).ravel()  # the curve comes down steeply to the focus
        depth = np.sort(np.concatenate([np.geomspace(*DEPTHS, 161), self.focus_m * around]))
        blur = np.maximum(self.blur_mm(depth), 1e-6)
        far_x = min(np.log10(far), panel.right)
        allowed, airy = self.circle_mm if self.bounds else None, self.airy_mm if self.diffraction else None
        bounds = band(panel, np.log10(near), far_x, "fill-green") if self.bounds else svg.NOTHING
        here = panel.place(logs((self.distance_m, max(float(self.blur_mm(self.distance_m)), BLURS[0]))))
        xticks, yticks = logarithmic(*logs(DEPTHS)), micrometres()
        right = (
            logarithmic_grid(panel, xticks, yticks)
            + bounds
            + curve(panel, np.log10(depth), np.log10(blur), "blue thick")
            + upright(panel, np.log10(self.focus_m), "red thin")
        )
        drawn, problem = self._your_part(panel, depth)
        title = "Blur against distance"
        label = f"{title}; drag or press the arrow keys to change the focus"
        if is_unwritten(problem):
            shown = without(panel, problem, title, right=right)
        else:
            globe = svg.dots([here], "blue", 10) + svg.text(here + (8, -8), "globe", "blue halo")
            taken = panel.place(np.log10(np.stack([depth, blur], axis=-1)))
            taken = np.concatenate([taken, here + np.mgrid[8:56:12, -20:-4:5].reshape(2, -1).T])
            content = right + levels(panel, taken, allowed, airy) + globe + drawn
            shown = panel.show(content, title=title, hint="drag to focus", drag="focus", label=label)
        return axes(panel, "distance from the lens [m]", "blur [µm]", xticks, yticks, aside=56) + shown

    def _your_part(self, panel: Panel, depth_m: np.ndarray) -> tuple[svg.Marks, str]:
        """The reader's blur over distance, their limits and the names of both; and what is wrong with either."""
        drawn, entries, problems = svg.NOTHING, [], []
        state = (self.focal_mm, self.f_number)
        if self.yours:
            blur, problem = tried(self.yours, (*state, 1000 * self.focus_m, 1000 * depth_m), depth_m)
            drawn += curve(panel, np.log10(depth_m), _log10(np.maximum(blur, 1e-6)), "orange dashed")
            entries += [] if problem else [("blue", "right"), ("orange dashed", "your blur")]
            problems.append(problem)
        if self.your_limits:
            focus = np.array([1000 * self.focus_m])
            limits, problem = tried(self.your_limits, (*state, focus, self.circle_mm), (focus, focus))
            ends = np.minimum(_log10(np.concatenate(limits) / 1000), panel.right)
            drawn += svg.join(upright(panel, float(end), "orange") for end in ends if np.isfinite(end))
            entries += [] if problem else [("orange", "your limits")]
            problems.append(problem)
        words = "\n".join(filter(None, dict.fromkeys(problems)))
        drawn += legend(panel, entries, "top right") if entries else svg.NOTHING
        below = 40 * len(entries)  # the legend, where it is shown largest
        drawn += svg.paragraph((12, 22 + below), words, panel.width - 24, "note halo") if words else svg.NOTHING
        return drawn, words if all(is_unwritten(one) for one in problems) else ""

    def _numbers(self) -> svg.Marks:
        x, y, _, high = self._layout["numbers"]
        figures = self._told()
        if self._has("rays") and self._has("blur"):
            figures |= {"1/f = 1/s + 1/v, in mm": self.equation()}
        step = min(42, (high - 52) // len(figures))
        return svg.text((x + 10, y + 26), "This lens", "title") + readout(figures, (x + 10, y + 48), (0, step), (0, 16))

    # What it does when touched ---------------------------------------------------------------------------------------

    def dragged(self, handle: str, x: float, y: float, dx: float, dy: float) -> Self:
        if handle == "object":
            place = lens_diagram.before_lens(1000 * self.distance_m, 0.0)[0] + dx / self._rays.scale[0]
            share = float(np.clip(-place / lens_diagram.HORIZON_MM, 0.01, 0.99))
            return self._moved("distance_m", lens_diagram.HORIZON_MM * share / (1 - share) / 1000)
        if handle == "sensor":
            v = max(self.lens.image_mm + dx / self._loupe.scale[0], self.focal_mm * 1.0001)
            return self._moved("focus_m", float(optics.object_distance_mm(self.focal_mm, v)) / 1000)
        return self._moved("focus_m", float(10 ** (np.log10(self.focus_m) + dx / self._plot.scale[0])))

    def _moved(self, name: str, value: float) -> Self:
        return self.but(**{name: float(np.clip(value, *self._range(name)))})

    def pressed(self, handle: str, key: str) -> Self:
        step = step_of(key)
        if handle == "object":  # to the right is nearer
            return self._moved("distance_m", self.distance_m * 1.05**-step)
        return self._moved("focus_m", self.focus_m * 1.05 ** (-step if handle == "sensor" else step))


@lru_cache(maxsize=128)  # some 2 MB
def _photographed(view: DepthOfFieldView, rough: bool) -> bytes:
    """The view's photograph as JPEG, which no reader's function changes."""
    return jpeg(view.image(rough=rough))


def _log10(values: np.ndarray) -> np.ndarray:
    """NaN for what has no logarithm."""
    return np.log10(np.where(values > 0, values, np.nan))


def _range_m(near: float, far: float) -> str:
    digits = 2 if far - near > 0.1 else 3
    return f"{near:.{digits}f} m to " + ("infinity" if np.isinf(far) else f"{far:.{digits}f} m")


def _percent(share: float) -> str:
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.1f} %"
