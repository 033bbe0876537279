"""What a distortion does to a picture: where it folds, how far it moves a pixel, how to take it back. For any lens."""

from camviz.distortion.limits import (
    edge_of_field,
    fold_angle,
    fold_radius,
    ideal_image_radius,
    image_corner_radius,
    image_reach,
    is_rational,
    jacobian_determinant,
    pole_radius,
    weakest_denominator,
)
from camviz.distortion.pictures import (
    displacement,
    distort_maps,
    remap,
    undistort_maps,
    undistorted_intrinsics,
    valid_region,
)

__all__ = [
    "displacement",
    "distort_maps",
    "edge_of_field",
    "fold_angle",
    "fold_radius",
    "ideal_image_radius",
    "image_corner_radius",
    "image_reach",
    "is_rational",
    "jacobian_determinant",
    "pole_radius",
    "remap",
    "undistort_maps",
    "undistorted_intrinsics",
    "valid_region",
    "weakest_denominator",
]
