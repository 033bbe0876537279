"""Wide pictures: cube maps, projections, reprojection, rings of cameras and mirrors."""

from camviz.panoramas.cubemap import Cubemap, Layout, cubemap_camera, face_camera
from camviz.panoramas.mirrors import Catadioptric, Mirror
from camviz.panoramas.projections import Projection, projection
from camviz.panoramas.reprojection import equirectangular_camera, reproject, window
from camviz.panoramas.ring import Ring

__all__ = [
    "Catadioptric",
    "Cubemap",
    "Layout",
    "Mirror",
    "Projection",
    "Ring",
    "cubemap_camera",
    "equirectangular_camera",
    "face_camera",
    "projection",
    "reproject",
    "window",
]
