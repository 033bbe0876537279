"""Every lens there is, by name: which programs know it, how they write it, and under what other names it goes.

Every module of this folder is looked through for lenses, so that a new one is a new file and no line elsewhere. Its
name in `LENSES` is the class's, in small letters.
"""

import re
from collections.abc import Iterator
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules

from camviz.lenses.base import Lens
from camviz.lenses.declarations import CalibrationModel, Spelling
from camviz.lenses.perspective import Perspective


def _found() -> Iterator[type[Lens]]:
    """The lenses that the modules of this folder define."""
    folder = __name__.rpartition(".")[0]
    modules = [import_module(f"{folder}.{each.name}") for each in iter_modules(import_module(folder).__path__)]
    for module in modules:
        for name, value in vars(module).items():
            own = isinstance(value, type) and issubclass(value, Lens) and value.__module__ == module.__name__
            if own and not isabstract(value) and not name.startswith("_"):
                yield value


LENSES: dict[str, type[Lens]] = {  # the pinhole first, the others by their files
    re.sub("(?<=[a-z])(?=[A-Z])", "_", lens.__name__).lower(): lens
    for lens in sorted(_found(), key=lambda lens: lens is not Perspective)
}
"""Every lens by its class's name in small letters.

>>> LENSES["double_sphere"].parameters()
('xi', 'alpha')
"""


def spelled(program: str) -> list[tuple[type[Lens], Spelling]]:
    """The lenses that a program has, and how it writes them.

    Args:
        program: The name of a format, such as "kalibr".

    Returns: list of (type of Lens, Spelling). A lens may have several spellings; none for a program that is not known.

    >>> [(lens.__name__, spelling.model) for lens, spelling in spelled("ros")][:2]
    [('BrownConrady', 'plumb_bob'), ('BrownConrady', 'rational_polynomial')]
    """
    return [(lens, each) for lens in LENSES.values() for each in lens.spellings if each.program == program]


def calibration_models() -> dict[str, tuple[type[Lens], CalibrationModel]]:
    """The models that can be calibrated, by name, each with its lens.

    Returns: dict of str to (type of Lens, CalibrationModel), by the names that `camviz calibrate --model` takes.

    >>> lens, model = calibration_models()["fisheye"]
    >>> lens.__name__, model.parameters
    ('KannalaBrandt', 'k1 k2 k3 k4')
    """
    return {each.name: (lens, each) for lens in LENSES.values() for each in lens.calibrations}


def same_lenses(lens: Lens) -> Iterator[tuple[Lens, float]]:
    """The same lens under other names.

    Args:
        lens: The lens to be written otherwise.

    Yields:
        other: A lens of another class with the same image, up to its scale.
        factor: From this lens's focal lengths to the other's.

    >>> from camviz.lenses import BrownConrady
    >>> list(same_lenses(BrownConrady()))  # nothing but 0: a perspective lens
    [(Perspective(), 1.0)]
    """
    yield from lens.same_as()
    for other in LENSES.values():
        if other.plain is type(lens):
            yield other(), 1.0
