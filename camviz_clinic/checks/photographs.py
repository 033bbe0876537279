"""Photographs of a board by a virtual camera, whose truth is known to the last digit."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.poses import RigidTransform
from camviz.scenes import Scene, Texture, render, to_display
from camviz.scenes.surfaces import Rectangle
from camviz_clinic.calibration.boards.picture import whiteness
from camviz_clinic.calibration.types import Board

BLACK, WHITE, BEHIND = 0.03, 0.85, 0.4  # of the light that falls on ink, paper, and what is behind the board
TEXELS = 80  # along `square_size`
MARGIN = 0.6  # white around the board, in `square_size`
BLUR = 0.6  # pixels


def photographed(
    camera: Camera, board: Board, cam_from_board: RigidTransform, *, supersample: int = 2, texels: int = TEXELS
) -> NDArray[np.uint8]:
    """The board at a pose as the camera sees it, uint8 grey (height, width), in sRGB, a little out of focus.

    `supersample`² rays to a pixel, `texels` along `square_size` of the board.
    """
    share = whiteness(board, texels, MARGIN)
    light = (BLACK + (WHITE - BLACK) * share)[..., None].repeat(3, axis=-1)
    texel = board.square_size / texels
    left, top = (edge - MARGIN * board.square_size for edge in board.area[:2])
    corner, across, down = np.array([[left, top, 0], [light.shape[1] * texel, 0, 0], [0, light.shape[0] * texel, 0]])
    turn = cam_from_board.rotation
    paper = Rectangle(cam_from_board.apply(corner), turn.apply(across), turn.apply(down), Texture(light))
    scene = Scene([paper], Texture(np.full((1, 1, 3), BEHIND)))
    picture = cv2.GaussianBlur(render(scene, camera, supersample), (0, 0), BLUR)
    return cv2.cvtColor(to_display(picture), cv2.COLOR_RGB2GRAY)
