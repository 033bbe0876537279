"""Two-view geometry: what one picture says about another. After Hartley & Zisserman (2004), parts II and III.

Everything takes and gives arrays and cameras. Left and right are named as in a stereo rig, but any two views will do.

What follows from the geometry of lines is here at once; estimating, matching, rectifying and triangulating are imported
when they are first used.
"""

from importlib import import_module
from typing import Any

from camviz.twoview.epipolar import (
    clip_lines,
    cross_matrix,
    epipolar_curve,
    epipolar_lines,
    epipoles,
    essential,
    essential_from_fundamental,
    from_homogeneous,
    fundamental,
    line_distance,
    projection_matrix,
    right_from_left,
    sampson_distance,
    symmetric_distance,
    to_homogeneous,
)

_HOME = {
    "decompose_essential": "estimate",
    "eight_point": "estimate",
    "linear_fundamental": "estimate",
    "nearest_essential": "estimate",
    "nearest_rank_two": "estimate",
    "normalising_transform": "estimate",
    "ransac_fundamental": "estimate",
    "recover_pose": "estimate",
    "METHODS": "matching",
    "MatchingScore": "matching",
    "disparity": "matching",
    "left_right_check": "matching",
    "matching_score": "matching",
    "homography": "plane",
    "RectifiedPair": "rectification",
    "depth_error": "rectification",
    "depth_from_disparity": "rectification",
    "depth_interval": "rectification",
    "disparity_from_depth": "rectification",
    "rectify": "rectification",
    "ray_distances": "triangulation",
    "refine_points": "triangulation",
    "triangulate": "triangulation",
    "triangulate_linear": "triangulation",
}

__all__ = [
    "clip_lines",
    "cross_matrix",
    "epipolar_curve",
    "epipolar_lines",
    "epipoles",
    "essential",
    "essential_from_fundamental",
    "from_homogeneous",
    "fundamental",
    "line_distance",
    "projection_matrix",
    "right_from_left",
    "sampson_distance",
    "symmetric_distance",
    "to_homogeneous",
    *_HOME,
]


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'camviz.twoview' has no attribute {name!r}")
    return getattr(import_module(f"camviz.twoview.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
