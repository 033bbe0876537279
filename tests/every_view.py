"""One state of every view that camviz has, by the name of its class or, in the clinic, of its entry."""

import importlib
import pkgutil
import re
from collections.abc import Callable
from dataclasses import MISSING, fields, replace
from functools import cache
from inspect import isclass

import numpy as np
from calibrations import bare, pair, single

import camviz.views
import camviz_clinic.views
import camviz_school.views
from camviz.draw.picture import Picture
from camviz.sensors import Sensor
from camviz.views.base import View
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.sharpness import SlantedEdge
from camviz_clinic.views.board_poses import BoardPosesView
from camviz_clinic.views.catalogue import VIEWS, Case
from camviz_clinic.views.measured_edge import MeasuredEdgeView
from camviz_clinic.views.measured_noise import MeasuredNoiseView

SHARED = (
    *("View", "OrbitView", "ObservedView", "SolvedView", "ViewChooser", "BoardPictures", "TwoCameras"),
    *("CameraMatrix", "ErrorBars", "EstimateNumbers", "RefocusedField", "TurningPair"),
)
"""Classes of what views are made of; they draw no picture themselves."""


def words(svg: str) -> str:
    """Everything that is written in a picture, the lines of its paragraphs joined."""
    return " ".join(found.strip() for found in re.findall(r">([^<>]+)</t(?:ext|span)>", svg))


def classes() -> dict[str, type[View]]:
    """Every class of view in the packages and beside the lessons, by name."""
    packages = (camviz.views, camviz_clinic.views, camviz_school.views)
    found = [one for each in packages for one in pkgutil.walk_packages(each.__path__, f"{each.__name__}.")]
    modules = [importlib.import_module(one.name) for one in found if not one.name.endswith(".exercises")]
    found = [one for module in modules for one in vars(module).values() if isclass(one) and issubclass(one, View)]
    return {one.__name__: one for one in found if one.__name__ not in SHARED}


def edge() -> View:
    u, v = np.meshgrid(np.arange(60.0), np.arange(60.0))
    return MeasuredEdgeView(edge=SlantedEdge.of(0.1 + 0.8 / (1 + np.exp(-2 * (u - 30 - 0.1 * (v - 30))))))


def noise() -> View:
    sensor, rng = Sensor(), np.random.default_rng(5)

    def frames(photons: float, seconds: float) -> list[np.ndarray]:
        return [sensor.expose(np.full((60, 80), photons), seconds, 20.0, rng).dn for _ in range(2)]

    times = np.linspace(0.1, 1, 8)
    return MeasuredNoiseView(
        measurement=Measurement(tuple(Level.of(t, frames(9000 * t, t), frames(0, t)) for t in times))
    )


def clinic(name: str) -> Callable[[], View]:
    return lambda: VIEWS[name].view(Case(pair(), pair(8, 0.2)))


def errors() -> View:
    return VIEWS["residual-vectors"].view(Case(replace(bare(), per_view_errors={"camera": np.array([0.2, 1.2, 0.3])})))


def _needs_nothing(view: type[View]) -> bool:
    return all(f.default is not MISSING or f.default_factory is not MISSING for f in fields(view))


@cache
def figure(name: str) -> Picture:
    """The picture of a state, drawn once."""
    return STATES[name]().figure()


def written(picture: Picture) -> str:
    """All words of a picture, in the order in which they are drawn."""
    return " ".join(text.words for text in picture.marks.texts())


STATES: dict[str, Callable[[], View]] = {
    **{name: view for name, view in sorted(classes().items()) if _needs_nothing(view)},
    **{f"clinic {name}": clinic(name) for name in VIEWS},
    "boards of one camera": lambda: BoardPosesView.of(single()),
    "edge": edge,
    "errors alone": errors,
    "missing": lambda: VIEWS["epipolar-pairs"].view(Case(bare())),
    "noise": noise,
}
