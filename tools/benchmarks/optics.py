"""What a photograph through a lens costs: by layers, by tracing every ray, and written straight down in NumPy.

    python tools/benchmarks/optics.py

Prints Markdown for docs/performance.md. 320 × 240 pixels, 50 mm at f/1.4 in the garden; times are medians.
"""

from collections.abc import Callable

import cv2
import numpy as np
from kernel import median_ms, table
from scipy.spatial.transform import RigidTransform

from camviz.scenes import textured_scene, to_display
from camviz_school.views import aperture, parallax
from camviz_school.views.aperture import ThinLensCamera
from camviz_school.views.depth_of_field import DRAFT, FINE, DepthOfFieldView

POINTS = 64  # of the lens


def camera(f_number: float = 1.4) -> ThinLensCamera:
    return ThinLensCamera(f_number=f_number, focus_m=2.3, world_from_cam=RigidTransform.from_translation([0.5, 0.5, 1]))


def straightforward(lens: ThinLensCamera, samples: int) -> np.ndarray:
    """As the equation reads: for each point of the lens all rays through the plane in focus, traced and averaged."""
    scene, fx = textured_scene(), lens.camera.intrinsics.fx
    rays = lens.camera.lens.unproject(lens.camera.intrinsics.from_pixels(lens.camera.intrinsics.grid()))
    focused, light = lens.focus_m * rays / rays[..., 2:], np.zeros(rays.shape)
    points, passes = lens.points(samples)
    for point, passing in zip(points * lens.aperture_mm / 2000, passes, strict=True):
        ways = focused - np.array([*point, 0])
        ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
        start = lens.world_from_cam.apply([*point, 0])
        light += passing / samples * scene.trace(start, ways, spread=1 / fx)[0]
    return light


def main() -> None:
    scene = textured_scene()
    stops = iter(np.linspace(1.4, 1.5, 1000))
    focus = iter(np.linspace(2.0, 4.0, 1000))
    fine = iter(np.linspace(1.4, 1.5, 1000))
    exact = to_display(aperture.photograph(scene, camera(), POINTS))
    fast = to_display(parallax.photograph(scene, camera(), POINTS))
    view = DepthOfFieldView(f_number=1.4)
    moving, resting = view.samples_for(*DRAFT), view.samples_for(*FINE)
    works: list[tuple[str, int, int, Callable[[], object]]] = [
        ("layers, the f-number changes", POINTS, 9, lambda: parallax.photograph(scene, camera(next(stops)), POINTS)),
        ("layers, traced afresh", POINTS, 9, _afresh),
        ("every ray traced, as pinhole cameras", POINTS, 3, lambda: aperture.photograph(scene, camera(), POINTS)),
        ("every ray traced, straightforward NumPy", POINTS, 3, lambda: straightforward(camera(), POINTS)),
        ("the view while f-number is dragged", moving, 9, lambda: view.but(f_number=next(stops)).figure(draft=True)),
        ("the view while focus is dragged", moving, 9, lambda: view.but(focus_m=next(focus)).figure(draft=True)),
        ("the view at rest", resting, 9, lambda: view.but(f_number=next(fine)).figure()),
    ]
    rows = [[name, f"{points}", f"{median_ms(work, repeats):.0f}"] for name, points, repeats, work in works]
    print(table(["photograph through a lens", "points of the lens", "ms"], rows))
    print(f"Layers against every ray: {cv2.PSNR(fast, exact):.1f} dB.")


def _afresh() -> None:
    parallax._kept.cache_clear()
    parallax.photograph(textured_scene(), camera(), POINTS)


if __name__ == "__main__":
    main()
