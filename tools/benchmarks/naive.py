"""The three visualizers as one would write them in an afternoon: `interact` over a function that ends in `plt.show()`.

Each shows what camviz's own view shows: the same scene, camera, pictures, curves and numbers, from the same arrays.
"""

import matplotlib.pyplot as plt
import numpy as np

from camviz.cameras import Camera
from camviz.scenes import board_corners, render, textured_scene, to_display, wireframe_scene
from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView

SCENE = textured_scene()
LINES = wireframe_scene()


def frustum(hfov_deg: float) -> None:
    """The scene and the frustum in 3D, the picture with projected corners, R, t and C in numbers."""
    view = FrustumView().but(hfov_deg=hfov_deg)
    figure = plt.figure(figsize=(13, 5))
    _space(figure.add_subplot(131, projection="3d"), view.camera)
    _picture(figure.add_subplot(132), view.camera, view.camera.project(board_corners().reshape(-1, 3)))
    _words(figure.add_subplot(133), view.numbers())
    plt.show()


def epipolar(depth: float) -> None:
    """Both pictures with the point and its epipolar line, both cameras in 3D, the numbers."""
    view = EpipolarView().but(depth=depth)
    figure = plt.figure(figsize=(13, 9))
    left, right = figure.add_subplot(221), figure.add_subplot(222)
    _picture(left, view.left, np.array([[view.u, view.v]]))
    _picture(right, view.right, view.uv_right[None])
    a, b, c = view.line
    u = np.array([0.0, view.right.intrinsics.width])
    right.plot(u, -(a * u + c) / b)
    _space(figure.add_subplot(223, projection="3d"), view.left, view.right)
    _words(figure.add_subplot(224), view.numbers())
    plt.show()


def distortion(k1: float) -> None:
    """The picture, the displacement field with contours, the radial curve, the bent frustum, the numbers."""
    view = DistortionView().but(k1=k1)
    figure, ((picture, field, words), (curve, _, hidden)) = plt.subplots(2, 3, figsize=(13, 9))
    _picture(picture, view.camera, np.empty((0, 2)))
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 16), np.linspace(-0.7, 0.7, 12))
    moved = view.camera.lens.project(np.stack([x, y, np.ones_like(x)], axis=-1)) - np.stack([x, y], axis=-1)
    field.quiver(x, y, *np.moveaxis(moved, -1, 0))
    field.contour(x, y, np.linalg.norm(moved, axis=-1))
    r = np.linspace(0, 1.5, 200)
    curve.plot(r, r * (1 + k1 * r**2 + view.k2 * r**4))
    hidden.axis("off")
    _space(figure.add_subplot(235, projection="3d"), view.camera)
    _words(words, view.numbers())
    plt.show()


def _picture(axes, camera: Camera, points: np.ndarray) -> None:
    axes.imshow(to_display(render(SCENE, camera)))
    axes.scatter(*points.T, s=6)


def _space(axes, *cameras: Camera) -> None:
    for _, line in LINES:
        axes.plot(*line.T, lw=0.7)
    for camera in cameras:
        for rim in camera.frustum(0.3, 1.2):
            axes.plot(*rim.T)


def _words(axes, numbers: dict) -> None:
    axes.axis("off")
    axes.text(0, 0.5, "\n".join(f"{name}: {value}" for name, value in numbers.items()), fontsize=7)
