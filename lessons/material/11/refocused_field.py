"""The state of the light field visualizer: a light field, the views that are summed, and what the sum is focused on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from camviz.draw.readout import signed
from camviz.lenses.base import Array
from camviz.lightfields import LightField, aperture, refocus
from camviz.scenes import to_display
from camviz.views.base import Control, View, choice, slider, switch
from camviz.views.depth_wedge import metres
from camviz_school.views import garden_field

PITCH = 0.002  # metres between microlenses, of the camera that would record the garden's field


@dataclass(frozen=True)
class RefocusedField(View):
    """A light field as a plenoptic camera records it, and a picture made of it afterwards.

    The picture is sharp where points move by `slope` pixels from view to view. Mark and slice lie at (column, row) of
    the middle view; (u, v) is one of the views, counted from 0 at the top left. `opening` is the width of each place of
    the lens that a view looks through, over the distance between places: 0 is a pinhole, sharp at all distances, and at
    1 the openings fill the lens and each view blurs what moves by d pixels over |d| pixels. Slopes are measured in the
    pinholes' views. `field` takes the place of the garden; its slopes lie within `limits`.
    """

    slope: float = slider(
        0.0, *garden_field.SLOPES, 0.02, unit="px", help="how far a sharp point moves from view to view"
    )
    aperture: str = choice("full", "half", "ring", "pinhole", help="which views are summed")
    u: int = slider(4, 0, 8, 1, label="view u", help="column of the view, from the left; the pinhole's place")
    v: int = slider(4, 0, 8, 1, label="view v", help="row of the view, from the top; the pinhole's place")
    column: int = slider(118, 0, 159, 1, unit="px", help="of the mark in the picture")
    row: int = slider(48, 0, 119, 1, unit="px", help="of the mark, and of the slice")
    opening: float = slider(
        0.0, 0.0, 1.0, 0.05, label="openings", help="0: pinholes; 1: as wide as they are apart, and no light is lost"
    )
    fence: bool = switch(False, label="a fence in front", help="slats two metres before the lens")
    show: str = choice("refocused", "slopes", help="the picture, or the slope measured at every pixel")
    field: LightField | None = None
    limits: tuple[float, float] = garden_field.SLOPES

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, size in zip(("v", "u", "row", "column"), self.views.shape, strict=False):
            value = getattr(self, name)
            if int(value) != value or not 0 <= value < size:
                raise ValueError(f"{name} must be a whole number from 0 to {size - 1}, got {value}")
            object.__setattr__(self, name, int(value))

    @classmethod
    def of(cls, field: LightField, limits: tuple[float, float] = (-3.0, 3.0)) -> Self:
        """The view of a given light field whose slopes lie within `limits`, its mark in the middle and in focus."""
        v, u, row, column = (size // 2 for size in field.views.shape[:4])
        view = cls(slope=limits[0], v=v, u=u, row=row, column=column, field=field, limits=limits)
        return view.but(slope=float(np.clip(round(view.slope_here, 2), *limits)))

    def offered(self) -> dict[str, Control]:
        """The controls with the ranges of this field; a given one has no fence, and openings as it has them."""
        controls = self.controls()
        for name, size in zip(("v", "u", "row", "column"), self.views.shape, strict=False):
            controls[name] = replace(controls[name], low=0, high=size - 1)
        controls["slope"] = replace(controls["slope"], low=self.limits[0], high=self.limits[1])
        fixed = [name for name, control in controls.items() if control.low is not None and control.low == control.high]
        for name in fixed + ["fence", "opening"] * (self.field is not None):
            del controls[name]
        return controls

    @property
    def light_field(self) -> LightField:
        """The field shown."""
        if self.field or not self.opening:
            return self._pinholes
        return garden_field.opened_field(self.fence, self.opening)

    @property
    def _pinholes(self) -> LightField:
        return self.field or garden_field.garden_field(self.fence)

    @property
    def views(self) -> np.ndarray:
        return self._pinholes.views if self.field else garden_field.garden_field(False).views

    @property
    def mask(self) -> Array:
        """The weights (rows, columns) of the views in the picture."""
        return aperture(self.aperture, self.views.shape[0], self.views.shape[1], self.v, self.u)

    @property
    def slopes(self) -> np.ndarray:
        """The slope (height, width) measured at every pixel of the middle view."""
        return garden_field.measured_slopes(self._pinholes, *self.limits)

    @property
    def slope_here(self) -> float:
        """The slope measured at the mark."""
        return float(self.slopes[self.row, self.column])

    def image(self) -> np.ndarray:
        """The picture (height, width, 3), sRGB bytes: sheared, then summed."""
        return to_display(refocus(self.light_field, self.slope, self.mask))

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        field, count = self.light_field, int(self.mask.sum())
        rows, columns, height, width = self.views.shape[:4]
        known = {
            "focused at": metres(float(field.depth(self.slope))),
            "slope at the mark": f"{signed(self.slope_here, 2)} px, {metres(float(field.depth(self.slope_here)))}",
        }
        if self.field is None:
            truth = float(garden_field.true_slopes(self.fence)[self.row, self.column])
            known["in truth"] = f"{signed(truth, 2)} px, {metres(float(field.depth(truth)))}"
            known["α"] = f"{float(field.alpha(self.slope, PITCH)):.3f}"
            known["a view blurs"] = f"{self.opening * abs(self.slope_here):.2f} px at the mark"
        return known | {
            "views summed": f"{count} of {rows * columns}",
            "sensor": f"{columns * width} × {rows * height} px",
            "each picture": f"{width} × {height} px",
        }

    def equation(self) -> str:
        """d = b f (1/z − 1/z_f) with this field's numbers."""
        field = self.light_field
        if not np.isfinite(field.baseline * field.focal_length):
            return "d = b f (1/z − 1/z_f)"
        if np.isinf(field.focus_distance):
            return f"d = {field.baseline * field.focal_length:.1f} px·m / z"
        return f"d = {field.baseline * field.focal_length:.1f} px·m (1/z − 1/{field.focus_distance:.4g} m)"
