"""Refocusing a light field of 9 × 9 views of 256 × 256 pixels in colour, beside the straightforward NumPy version.

    python tools/benchmarks/lightfield.py

Prints Markdown for docs/performance.md. Times are medians; the error is the largest difference from the exact picture.
"""

import numpy as np
from kernel import median_ms, table
from scipy import ndimage

from camviz.cameras import Camera, Intrinsics
from camviz.lightfields import LightField, disparity_by_sweep, photograph_field, refocus
from camviz.scenes import textured_scene, to_linear

DISPARITY = 0.37


def by_hand(views: np.ndarray, disparity: float) -> np.ndarray:
    """Shift every view by interpolating between its pixels, and average, in NumPy alone."""
    rows, columns, height, width = views.shape[:4]
    total = np.zeros(views.shape[2:])
    for v in range(rows):
        for u in range(columns):
            y = np.clip(np.arange(height) - disparity * (v - (rows - 1) / 2), 0, height - 1)
            x = np.clip(np.arange(width) - disparity * (u - (columns - 1) / 2), 0, width - 1)
            top, left = np.minimum(y.astype(int), height - 2), np.minimum(x.astype(int), width - 2)
            down, right = (y - top)[:, None, None], (x - left)[:, None]
            upper, lower = views[v, u][top], views[v, u][top + 1]
            rows_between = (1 - down) * upper + down * lower
            total += (1 - right) * rows_between[:, left] + right * rows_between[:, left + 1]
    return total / (rows * columns)


def exact(views: np.ndarray, disparity: float) -> np.ndarray:
    """The same in double precision by scipy.ndimage.shift."""
    rows, columns = views.shape[:2]
    shifts = {(v, u): (disparity * (v - (rows - 1) / 2), disparity * (u - (columns - 1) / 2), 0)
              for v, u in np.ndindex(rows, columns)}  # fmt: skip
    moved = [ndimage.shift(views[at].astype(float), by, order=1, mode="nearest") for at, by in shifts.items()]
    return np.mean(moved, axis=0)


def main() -> None:
    camera = Camera(Intrinsics.from_fov(256, 256, 40))
    baseline = 12 / camera.intrinsics.fx
    encoded = photograph_field(textured_scene(), camera, 9, 9, baseline, 4.0, encoded=True)
    linear = LightField(to_linear(encoded.views))
    truth = exact(linear.views, DISPARITY)
    works = {
        "refocus, linear light": lambda: refocus(linear, DISPARITY),
        "refocus, sRGB bytes": lambda: refocus(encoded, DISPARITY),
        "the same in NumPy": lambda: by_hand(linear.views, DISPARITY),
    }
    rows = [[name, f"{median_ms(work):.0f}", f"{np.abs(work() - truth).max():.0e}"] for name, work in works.items()]
    print(table(["9 × 9 × 256 × 256 × 3", "ms", "largest error"], rows))
    sweep = median_ms(lambda: disparity_by_sweep(encoded, np.arange(-3, 3, 0.2)), repeats=3)
    print(f"Depth from slope, 30 slopes: {sweep:.0f} ms.\n")


if __name__ == "__main__":
    main()
