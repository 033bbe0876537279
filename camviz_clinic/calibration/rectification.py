"""How the pictures of a camera are rectified, where a file keeps it beside K and the distortion."""

from __future__ import annotations

from typing import NamedTuple

from camviz.lenses.base import Array


class Rectification(NamedTuple):
    """`R` (3, 3) from the camera's frame to the rectified one, and `P` (3, 4) of the rectified picture.

    P is in pixels; its last column is in pixels times metres. Source: sensor_msgs/CameraInfo, R and P.
    """

    R: Array
    P: Array
