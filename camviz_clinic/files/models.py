"""Camera models as formats list them: a name, a lens, and the parameters in the order in which the file has them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Lens, same_lenses
from camviz_clinic.calibration.types import CalibrationError
from camviz_clinic.files.section import explained, refuse_focal_lengths

GRID = "fx fy cx cy"


@dataclass(frozen=True)
class Model:
    """One camera model of a format; `parameters` has the names of Intrinsics and the lens, or f for fx = fy."""

    name: str
    lens: type[Any]
    parameters: str
    fixed: Mapping[str, float] = field(default_factory=dict)
    number: int = -1  # of the model, in a format that counts its models

    @property
    def names(self) -> list[str]:
        return self.parameters.split()

    def camera(self, values: Sequence[float], width: int, height: int, first_pixel: float, where: str) -> Camera:
        """The camera of these values; `first_pixel` is the coordinate the format gives the first pixel's centre."""
        held = dict(zip(self.names, map(float, values), strict=True)) | dict(self.fixed)
        focal = held.pop("f", None)
        fx, fy = (held.pop(name, focal) for name in ("fx", "fy"))
        cx, cy = held.pop("cx") - first_pixel, held.pop("cy") - first_pixel
        refuse_focal_lengths(fx, fy, where)  # type: ignore[arg-type]
        with explained(where):
            intrinsics = Intrinsics(width, height, fx, fy, cx, cy, held.pop("skew", 0.0))  # type: ignore[arg-type]
            return Camera(intrinsics, self.lens(**held))

    def values(self, camera: Camera, first_pixel: float) -> list[float]:
        """The inverse of `camera`, for a camera that the model can hold."""
        intrinsics = camera.intrinsics
        held = asdict(intrinsics) | _parameters(camera.lens) | {"f": intrinsics.fx}
        held |= {"cx": intrinsics.cx + first_pixel, "cy": intrinsics.cy + first_pixel}
        return [float(held[name]) for name in self.names]

    def lacks(self, camera: Camera) -> list[str]:
        """The parameters of a camera with a lens of this model's kind that have no place in the model."""
        intrinsics = camera.intrinsics
        needed = {name: value for name, value in _parameters(camera.lens).items() if value != self.fixed.get(name, 0.0)}
        lacking = [name for name in needed if name not in self.names]
        lacking += ["skew"] * (intrinsics.skew != 0 and "skew" not in self.names)
        return lacking + ["fy, which differs from fx,"] * (intrinsics.fx != intrinsics.fy and "f" in self.names)


def expressed(name: str, camera: Camera, models: Iterable[Model], title: str) -> tuple[Model, Camera]:
    """The first model that holds the camera, and the camera in its terms; CalibrationError saying why none does."""
    models = list(models)
    fitting = [(model, same) for same in equals(camera) for model in models if model.lens is type(same.lens)]
    if not fitting:
        known = ", ".join(dict.fromkeys(model.lens.__name__ for model in models))
        lens = type(camera.lens).__name__
        raise CalibrationError(f"{title} has no {lens} lens, which {name} has; it holds {known}")
    for model, same in fitting:
        if not model.lacks(same):
            return model, same
    model, same = min(fitting, key=lambda pair: len(pair[0].lacks(pair[1])))
    lacking = ", ".join(model.lacks(same))
    raise CalibrationError(f"{title} has no place for {lacking} of {name}: its {model.name} holds {model.parameters}")


def model_named(name: str, models: Iterable[Model]) -> Model | None:
    """The model of this name, if there is one."""
    return next((model for model in models if model.name == name), None)


def equals(camera: Camera) -> Iterator[Camera]:
    """The camera, and then the same camera under the other names that its lens has."""
    yield camera
    for lens, scale in same_lenses(camera.lens):
        yield replace(camera, intrinsics=_scaled(camera.intrinsics, scale), lens=lens)


def same_camera(a: Camera, b: Camera, tolerance: float = 1e-11) -> bool:
    """True where both have the same pixels, the same lens under one name or another, and the same pose."""
    return same_pose(a, b, tolerance) and any(_same_values(form, b, tolerance) for form in equals(a))


def same_pose(a: Camera, b: Camera, tolerance: float = 1e-11) -> bool:
    """True where both stand in one place and look one way."""
    first, second = a.world_from_cam.as_matrix(), b.world_from_cam.as_matrix()
    return bool(np.abs(first - second).max() <= tolerance * max(1.0, float(np.abs(first).max())))


def _same_values(a: Camera, b: Camera, tolerance: float) -> bool:
    if type(a.lens) is not type(b.lens):
        return False
    first, second = (np.array([*asdict(c.intrinsics).values(), *_parameters(c.lens).values()]) for c in (a, b))
    return bool(np.all(np.abs(first - second) <= tolerance * np.maximum(1, np.abs(first))))


def _scaled(intrinsics: Intrinsics, scale: float) -> Intrinsics:
    return replace(intrinsics, fx=intrinsics.fx * scale, fy=intrinsics.fy * scale, skew=intrinsics.skew * scale)


def _parameters(lens: Lens) -> dict[str, float]:
    return {name: getattr(lens, name) for name in lens.parameters()}
