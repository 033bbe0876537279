"""How far off a projected pixel may be: over the picture at one distance, and at some pixels over all distances."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import inf
from typing import Any, ClassVar, Self

import numpy as np

from camviz.cameras import Camera
from camviz.draw import plot, svg
from camviz.draw.flow import rows
from camviz.draw.marks import NOTHING, Marks
from camviz.draw.panel import image_panel
from camviz.draw.picture import Picture
from camviz.draw.readout import readout
from camviz.draw.shades import Shades, bar, contours, heat
from camviz.lenses.base import Array
from camviz.views.base import View, choice
from camviz.views.marks import circle
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.uncertainty import projection_covariance, worst_deviation
from camviz_clinic.views.observations import Missing

DISTANCES = {"infinity": inf, "30 m": 30.0, "10 m": 10.0, "3 m": 3.0, "1 m": 1.0, "0.5 m": 0.5, "0.3 m": 0.3}
LEFT_OUT = (
    "This is the scatter of the views carried through the solution. It leaves out what is wrong alike in all views: a "
    "bent board, or a lens that the model cannot describe. Cross-validation and the residuals show that."
)
_LAYOUT = rows((470, {"uncertainty": 680, "numbers": 280}))
_RANGE_LAYOUT = rows((380, {"range": 695, "in words": 265}))


@dataclass(frozen=True)
class SolvedView(View):
    """A view of a solution whose corners determine it. Raises Missing where they do not."""

    adjustment: Adjustment = field(compare=False, repr=False)
    camera: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        determined(self.adjustment)

    @classmethod
    def of(cls, calibration: Any, camera: str = "") -> Self:
        """The view of a calibration. Raises Missing where it does not hold what its solution was made from."""
        return cls(adjusted(calibration, camera), camera)

    @property
    def name(self) -> str:
        """Which camera it is of."""
        return self.camera or next(iter(self.adjustment.cameras))


@dataclass(frozen=True)
class UncertaintyView(SolvedView):
    """The uncertainty of projection at every pixel, in the worst direction, for points at one distance.

    With `ellipses`, how it spreads: ellipses of one standard deviation, enlarged.
    """

    title: ClassVar[str] = "Uncertainty of projection"

    distance: str = choice(*DISTANCES, help="how far away the points are that a pixel stands for")

    @property
    def seen_by(self) -> Camera:
        """The camera itself."""
        return self.adjustment.cameras[self.name]

    def covariances(self, columns: int, rows: int) -> tuple[Array, Array]:
        """Pixels (rows, columns, 2) from edge to edge of the picture and their covariances (rows, columns, 2, 2)."""
        return _covariances(self.adjustment, self.name, DISTANCES[self.distance], columns, rows)

    def values(self, columns: int = 45, rows: int = 30) -> Array:
        """The standard deviation (rows, columns) in pixels in its worst direction."""
        return worst_deviation(self.covariances(columns, rows)[1])

    @cached_property
    def _centre(self) -> float:
        k = self.seen_by.intrinsics
        middle = [(k.width - 1) / 2, (k.height - 1) / 2]
        return float(
            worst_deviation(projection_covariance(self.adjustment, middle, DISTANCES[self.distance], self.name))
        )

    def numbers(self) -> dict[str, float]:
        """The uncertainty in pixels in the middle of the picture and at its worst, and the share of it below 1 px."""
        values = self.values(15, 10)
        known = np.isfinite(values)
        return {
            "middle": self._centre,
            "worst": float(np.nanmax(values)) if known.any() else np.nan,
            "below_1": float(np.mean(np.where(known, values, np.inf) < 1)),
            "sigma": self.adjustment.sigma,
        }

    def description(self) -> str:
        n = self.numbers()
        return (
            f"{self.name}, points {place_of(self.distance)}: ±{n['middle']:.3g} px in the middle of the picture, "
            f"±{n['worst']:.3g} px at worst; below 1 px over {100 * n['below_1']:.0f} % of it. The corners' noise is "
            f"{n['sigma']:.3g} px. {LEFT_OUT}"
        )

    def figure(self, *, draft: bool = False) -> Picture:
        columns, rows = (15, 10) if draft else (45, 30)
        values, k = self.values(columns, rows), self.seen_by.intrinsics
        panel = image_panel("uncertainty", 20, 34, 560, k.width, k.height, tallest=420)
        shades = Shades.around(values)
        colours, attached = heat(panel, "colours", values, shades)
        content = colours + self._ellipses(panel) + contours(panel, values, shades, " px", strong=1.0)
        legend, bar_picture = bar(panel.x + panel.width + 14, 64, panel.height - 60, "bar", shades, "px")
        shown = panel.show(content, title=f"{self.name}: one standard deviation, points {place_of(self.distance)}")
        parts = {"uncertainty": shown + legend, "numbers": self._words(690)}
        return self.tiled(_LAYOUT, parts, attached | bar_picture)

    def _ellipses(self, panel: Any) -> Marks:
        """Ellipses of one standard deviation at a few pixels, all enlarged so that the smallest can be seen."""
        uv, covariance = self.covariances(15, 10)
        uv, covariance = uv[1:-1:2, 1:-1:2].reshape(-1, 2), covariance[1:-1:2, 1:-1:2].reshape(-1, 2, 2)
        values, directions = np.linalg.eigh(np.where(np.isfinite(covariance), covariance, 0))
        long = np.sqrt(np.maximum(values[:, 1], 0))
        known = np.isfinite(covariance).all(axis=(1, 2)) & (long > 0)
        if not known.any():
            return NOTHING
        # Lengths by the logarithm, for they differ a hundredfold; the ratio of the axes is kept.
        reach = (7 + 9 * np.clip(np.log10(np.where(known, long, 1) / np.median(long[known])) + 0.5, 0, 1)) / np.where(
            long > 0, long, 1
        )
        axes = directions * np.sqrt(np.maximum(values, 0))[:, None, :] * reach[:, None, None]
        lines = panel.place(uv)[:, None] + circle(25) @ np.swapaxes(axes, 1, 2)
        return svg.path(lines[known], "paper-line", stroke_width=3) + svg.path(lines[known], "ink thin")

    def _words(self, x: float) -> Marks:
        n = self.numbers()
        rows = [("in the middle", f"±{n['middle']:.3g} px"), ("at worst", f"±{n['worst']:.3g} px"),
                ("below 1 px over", f"{100 * n['below_1']:.0f} % of the picture"),
                ("noise of a corner", f"{n['sigma']:.3g} px")]  # fmt: skip
        words = readout(rows, (x, 60), (0, 40), (0, 18))
        words += svg.paragraph((x, 236), "Ellipses: in which direction (not to scale).", 960 - x - 10)
        return words + svg.paragraph((x, 280), LEFT_OUT, 960 - x - 10)


@dataclass(frozen=True)
class UncertaintyRangeView(SolvedView):
    """The uncertainty of projection against the distance of the points, at three pixels from the middle outwards.

    It is least where the boards were held.
    """

    title: ClassVar[str] = "Uncertainty against range"

    scale: str = choice("logarithmic", "linear", label="axis", help="of the uncertainty")

    @cached_property
    def boards(self) -> Array:
        """How far (views,) the middles of the boards were from the camera, in metres."""
        a = self.adjustment
        middles = a.first_from_board[a.posed].as_matrix() @ np.append(a.board.corners.mean(axis=0), 1)
        return np.linalg.norm(middles[:, :3] - a.cameras[self.name].centre, axis=-1)

    @cached_property
    def pixels(self) -> dict[str, Array]:
        """The pixels (2,) that have a curve, by what they are called."""
        k = self.adjustment.cameras[self.name].intrinsics
        middle, corner = np.array([k.width - 1, k.height - 1]) / 2, np.zeros(2)
        parts = {"the middle": 0.0, "half way to the corner": 0.5, "nine tenths of the way": 0.9}
        return {words: middle + part * (corner - middle) for words, part in parts.items()}

    def curves(self) -> tuple[Array, Array]:
        """Distances (n,) in metres, and the standard deviations (pixels, n) at each of `pixels`."""
        near, far = float(np.min(self.boards)) / 8, float(np.max(self.boards)) * 200
        distances = tuple(np.geomspace(near, far, 49).tolist())
        return _along(self.adjustment, self.name, distances, tuple(tuple(uv.tolist()) for uv in self.pixels.values()))

    def description(self) -> str:
        distances, values = self.curves()
        found = np.nan_to_num(values, nan=np.inf)
        best = "; ".join(
            f"{words}: least ±{v.min():.3g} px at {distances[v.argmin()]:.2g} m, ±{v[-1]:.3g} px far away"
            for words, v in zip(self.pixels, found, strict=True) if np.isfinite(v).any()
        )  # fmt: skip
        return f"{self.name}. {best}. The boards were {self.boards.min():.2g} m to {self.boards.max():.2g} m away."

    def figure(self, *, draft: bool = False) -> Picture:
        distances, values = self.curves()
        log = self.scale == "logarithmic"
        finite = values[np.isfinite(values) & (values > 0)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.1, 1.0)
        x = np.log10(distances)
        ylim = (0.0, 1.25 * high)
        if log:
            ylim = float(np.log10(low)) - 0.1, float(np.log10(high)) + 0.3 * float(np.log10(high / low)) + 0.1
        panel = plot.plot_panel("range", 70, 34, 610, 290, (float(x[0]), float(x[-1])), ylim)
        xticks = plot.logarithmic(panel.left, panel.right)
        yticks = plot.logarithmic(*ylim) if log else None
        boards = np.log10([self.boards.min(), self.boards.max()])
        content = plot.band(panel, boards[0] - 0.005, boards[1] + 0.005, "fill-green")
        content += svg.text((panel.place((boards.mean(), 0))[0], 16), "the boards", "green halo middle")
        classes = ("blue thick", "orange thick", "purple thick")
        for class_, curve in zip(classes, values, strict=True):
            content += plot.curve(panel, x, np.log10(curve) if log else curve, class_)
        content += plot.legend(panel, list(zip(classes, self.pixels, strict=True)), "top right")
        names = "distance of the point [m]", "standard deviation [px]"
        words = (
            "The solution knows the camera best where the boards were held. Nearer than that, the place of the "
            f"camera’s centre is what is uncertain.\n \n{LEFT_OUT}"
        )
        body = plot.plotted(panel, content, *names, xticks, yticks, title=f"{self.name}: at three pixels")
        return self.tiled(_RANGE_LAYOUT, {"range": body, "in words": svg.paragraph((705, 50), words, 240)})


@lru_cache(maxsize=24)
def _covariances(adjustment: Adjustment, name: str, distance: float, columns: int, rows: int) -> tuple[Array, Array]:
    k = adjustment.cameras[name].intrinsics
    u, v = np.linspace(-0.5, k.width - 0.5, columns), np.linspace(-0.5, k.height - 0.5, rows)
    uv = np.stack(np.meshgrid(u, v), axis=-1)
    return uv, projection_covariance(adjustment, uv, distance, name)


@lru_cache(maxsize=8)
def _along(
    adjustment: Adjustment, name: str, distances: tuple[float, ...], pixels: tuple[tuple[float, ...], ...]
) -> tuple[Array, Array]:
    """The distances (n,), and the standard deviations (pixels, n) there."""
    deviations = [worst_deviation(projection_covariance(adjustment, pixels, d, name)) for d in distances]
    return np.array(distances), np.stack(deviations, axis=-1)


def place_of(distance: str) -> str:
    """Where points at one of DISTANCES lie, in words."""
    return "at infinity" if distance == "infinity" else f"{distance} away"


def adjusted(calibration: Any, *names: str) -> Adjustment:
    """The adjustment of a calibration. Raises Missing where the file does not hold what it takes."""
    try:
        return Adjustment.of(calibration, *filter(None, names))
    except ValueError as error:
        raise Missing(f"The calibration does not hold what its solution was made from: {error}.") from error


def determined(adjustment: Adjustment) -> Adjustment:
    """The adjustment, if its corners determine its parameters and their noise. Raises Missing if not."""
    if not np.isfinite(adjustment.sigma):
        n, k = adjustment.measurements, adjustment.unknowns
        raise Missing(f"The calibration has {n} measurements for {k} unknowns: too few to tell how far they scatter.")
    try:
        known = bool(np.isfinite(adjustment.mean_twist_covariance).all())
    except np.linalg.LinAlgError:
        known = False
    if not known:
        raise Missing(
            "The corners do not determine the parameters of this solution, so their uncertainty has no bounds."
        )
    return adjustment
