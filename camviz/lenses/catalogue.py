"""Every lens there is, by name, and under what other names it goes.

Every module of this folder is looked through for lenses, so that a new one is a new file and no line elsewhere. Its
name in `LENSES` is the class's, in small letters.
"""

import re
from collections.abc import Iterator
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules

from camviz.lenses.base import Lens
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
