"""Two-view geometry: what one picture says about another. After Hartley & Zisserman (2004), parts II and III.

Everything takes and gives arrays and cameras. Left and right are named as in a stereo rig, but any two views will do.
"""

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
from camviz.twoview.estimate import (
    decompose_essential,
    eight_point,
    linear_fundamental,
    nearest_essential,
    nearest_rank_two,
    normalising_transform,
    ransac_fundamental,
    recover_pose,
)
from camviz.twoview.matching import METHODS, MatchingScore, disparity, left_right_check, matching_score
from camviz.twoview.plane import homography
from camviz.twoview.rectify import (
    RectifiedPair,
    depth_error,
    depth_from_disparity,
    depth_interval,
    disparity_from_depth,
    rectify,
)
from camviz.twoview.triangulate import ray_distances, refine_points, triangulate, triangulate_linear

__all__ = [
    "METHODS",
    "MatchingScore",
    "RectifiedPair",
    "clip_lines",
    "cross_matrix",
    "decompose_essential",
    "depth_error",
    "depth_from_disparity",
    "depth_interval",
    "disparity",
    "disparity_from_depth",
    "eight_point",
    "epipolar_curve",
    "epipolar_lines",
    "epipoles",
    "essential",
    "essential_from_fundamental",
    "from_homogeneous",
    "fundamental",
    "homography",
    "left_right_check",
    "line_distance",
    "linear_fundamental",
    "matching_score",
    "nearest_essential",
    "nearest_rank_two",
    "normalising_transform",
    "projection_matrix",
    "ransac_fundamental",
    "ray_distances",
    "recover_pose",
    "rectify",
    "refine_points",
    "right_from_left",
    "sampson_distance",
    "symmetric_distance",
    "to_homogeneous",
    "triangulate",
    "triangulate_linear",
]
