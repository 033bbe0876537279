"""Light fields: the picture from every place of an aperture, and what can be made of them afterwards."""

from camviz.lightfields.apertures import APERTURES, aperture
from camviz.lightfields.field import LightField
from camviz.lightfields.folders import read_folder
from camviz.lightfields.plenoptic import (
    epipolar_plane_image,
    from_microlens_image,
    from_mosaic,
    to_microlens_image,
    to_mosaic,
)
from camviz.lightfields.refocusing import fourier_slice, periodic_shift_and_sum, refocus
from camviz.lightfields.rendering import disparity_of_views, photograph_field, true_disparity
from camviz.lightfields.slopes import disparity_by_structure, disparity_by_sweep
from camviz.lightfields.subapertures import Openings, exact_range

__all__ = [
    "APERTURES",
    "LightField",
    "Openings",
    "aperture",
    "disparity_by_structure",
    "disparity_by_sweep",
    "disparity_of_views",
    "epipolar_plane_image",
    "exact_range",
    "fourier_slice",
    "from_microlens_image",
    "from_mosaic",
    "periodic_shift_and_sum",
    "photograph_field",
    "read_folder",
    "refocus",
    "to_microlens_image",
    "to_mosaic",
    "true_disparity",
]
