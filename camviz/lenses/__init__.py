"""Lenses: how directions become points on the image, before any pixel is counted.

A new lens is a new file and no line elsewhere: `camviz.lenses.catalogue` finds it. The few lenses that every view
needs are here at once, all others when one of them, or the catalogue, is first asked for.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from camviz.lenses.base import Lens  # noqa: F401 - the names of this folder, see __getattr__
from camviz.lenses.brown_conrady import BrownConrady  # noqa: F401
from camviz.lenses.fisheye import Equidistant, Equisolid, FieldOfView, Orthographic, Stereographic  # noqa: F401
from camviz.lenses.panoramas import Cylindrical, Equirectangular  # noqa: F401
from camviz.lenses.perspective import Perspective  # noqa: F401

if TYPE_CHECKING:  # the catalogue finds these without a line; type checkers do not
    from camviz.lenses.catalogue import LENSES, same_lenses  # noqa: F401
    from camviz.lenses.kannala_brandt import KannalaBrandt  # noqa: F401
    from camviz.lenses.modified_brown_conrady import ModifiedBrownConrady  # noqa: F401
    from camviz.lenses.spheres import DoubleSphere, ExtendedUnified, UnifiedSphere  # noqa: F401
    from camviz.lenses.thin_prism_fisheye import ThinPrismFisheye  # noqa: F401

_OF_ALL = ("LENSES", "same_lenses")


def __getattr__(name: str) -> Any:
    if name.startswith("_") and name != "__all__":
        raise AttributeError(f"module 'camviz.lenses' has no attribute {name!r}")
    catalogue = import_module("camviz.lenses.catalogue")
    lenses = {lens.__name__: lens for lens in catalogue.LENSES.values()}
    if name == "__all__":
        return ["Lens", *_OF_ALL, *lenses]
    if name in lenses:
        return lenses[name]
    if name in _OF_ALL:
        return getattr(catalogue, name)
    raise AttributeError(f"module 'camviz.lenses' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__getattr__("__all__"))
