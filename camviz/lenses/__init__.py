"""Lenses: how directions become points on the image, before any pixel is counted.

Every module of this folder is looked through for lenses, so that a new one is a new file and no line elsewhere. Its
name in `LENSES` is the class's, in small letters.
"""

import re
from collections.abc import Iterator
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules

# What is found below needs no line here; these tell type checkers of the lenses that camviz itself makes use of.
from camviz.lenses.base import Lens
from camviz.lenses.brown_conrady import BrownConrady  # noqa: F401
from camviz.lenses.declarations import CalibrationModel, Spelling
from camviz.lenses.fisheye import Equidistant, Equisolid, FieldOfView, Orthographic, Stereographic  # noqa: F401
from camviz.lenses.kannala_brandt import KannalaBrandt  # noqa: F401
from camviz.lenses.panoramas import Cylindrical, Equirectangular  # noqa: F401
from camviz.lenses.perspective import Perspective
from camviz.lenses.spheres import DoubleSphere, ExtendedUnified, UnifiedSphere  # noqa: F401
from camviz.lenses.thin_prism_fisheye import ThinPrismFisheye  # noqa: F401


def _found() -> Iterator[type[Lens]]:
    """The lenses that the modules of this folder define."""
    for module in (import_module(f"{__name__}.{each.name}") for each in iter_modules(__path__)):
        for name, value in vars(module).items():
            own = isinstance(value, type) and issubclass(value, Lens) and value.__module__ == module.__name__
            if own and not isabstract(value) and not name.startswith("_"):
                yield value


LENSES: dict[str, type[Lens]] = {  # the pinhole first, the others by their files
    re.sub("(?<=[a-z])(?=[A-Z])", "_", lens.__name__).lower(): lens
    for lens in sorted(_found(), key=lambda lens: lens is not Perspective)
}
globals().update({lens.__name__: lens for lens in LENSES.values()})

__all__ = ["LENSES", "Lens", "calibration_models", "same_lenses", "spelled"]
__all__ += [lens.__name__ for lens in LENSES.values()]


def spelled(program: str) -> list[tuple[type[Lens], Spelling]]:
    """The lenses that a program has, each with its spelling there."""
    return [(lens, each) for lens in LENSES.values() for each in lens.spellings if each.program == program]


def calibration_models() -> dict[str, tuple[type[Lens], CalibrationModel]]:
    """The models that can be calibrated, by name, each with its lens."""
    return {each.name: (lens, each) for lens in LENSES.values() for each in lens.calibrations}


def same_lenses(lens: Lens) -> Iterator[tuple[Lens, float]]:
    """The same lens under other names, each with the factor from this one's focal lengths to that one's."""
    yield from lens.same_as()
    for other in LENSES.values():
        if other.plain is type(lens):
            yield other(), 1.0
