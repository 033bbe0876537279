"""Lenses: how directions become points on the image, before any pixel is counted."""

from camviz.lenses.base import Lens
from camviz.lenses.brown_conrady import BrownConrady
from camviz.lenses.fisheye import Equidistant, Equisolid, FieldOfView, Orthographic, Stereographic
from camviz.lenses.kannala_brandt import KannalaBrandt
from camviz.lenses.panoramas import Cylindrical, Equirectangular
from camviz.lenses.perspective import Perspective
from camviz.lenses.spheres import DoubleSphere, ExtendedUnified, UnifiedSphere
from camviz.lenses.thin_prism_fisheye import ThinPrismFisheye

LENSES: dict[str, type[Lens]] = {
    "perspective": Perspective,
    "brown_conrady": BrownConrady,
    "kannala_brandt": KannalaBrandt,
    "thin_prism_fisheye": ThinPrismFisheye,
    "equidistant": Equidistant,
    "equisolid": Equisolid,
    "orthographic": Orthographic,
    "stereographic": Stereographic,
    "unified_sphere": UnifiedSphere,
    "extended_unified": ExtendedUnified,
    "double_sphere": DoubleSphere,
    "field_of_view": FieldOfView,
    "equirectangular": Equirectangular,
    "cylindrical": Cylindrical,
}

__all__ = [
    "LENSES",
    "BrownConrady",
    "Cylindrical",
    "DoubleSphere",
    "Equidistant",
    "Equirectangular",
    "Equisolid",
    "ExtendedUnified",
    "FieldOfView",
    "KannalaBrandt",
    "Lens",
    "Orthographic",
    "Perspective",
    "Stereographic",
    "ThinPrismFisheye",
    "UnifiedSphere",
]
