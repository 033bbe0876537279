"""Wide lenses: a panorama through a fisheye that turns, as camviz does it and as one writes it with NumPy.

python tools/benchmarks/wide.py        wall-clock milliseconds, median and best of 21, another direction every time
"""

from __future__ import annotations

from time import perf_counter, process_time

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import Equidistant
from camviz.panoramas.cubemap import cubemap_camera
from camviz.panoramas.reprojection import equirectangular_camera, reproject, turned

RUNS = 21
AROUND = equirectangular_camera(2048, 1024)
FISHEYE = Camera(Intrinsics(800, 800, 250, 250, 399.5, 399.5), Equidistant())


def main() -> None:
    """Print one line for each way."""
    sky = np.random.default_rng(0).integers(0, 256, (1024, 2048, 3), dtype=np.uint8)
    error = np.abs(naive(sky, 30).astype(int) - looking(sky, 30))
    print(f"the two pictures differ by {error.mean():.2f} of 255 on average, of noise from pixel to pixel")
    for name, ways in {
        "equirectangular 2048 × 1024 → fisheye 800 × 800, camviz": lambda yaw: looking(sky, yaw),
        "the same with NumPy": lambda yaw: naive(sky, yaw),
        "equirectangular 2048 × 1024 → cube map 2048 × 1536, camviz": lambda yaw: reproject(
            sky, AROUND, cubemap_camera(512).at(turned(yaw, 0, 0))
        ),
    }.items():
        ways(0.0)
        wall, cpu = [], []
        for yaw in np.linspace(-170, 170, RUNS):
            began, used = perf_counter(), process_time()
            ways(float(yaw))
            wall.append(1e3 * (perf_counter() - began))
            cpu.append(1e3 * (process_time() - used))
        print(f"{name}: {np.median(wall):.0f} ms, best {min(wall):.0f}; processor {np.median(cpu):.0f} ms")


def looking(sky: NDArray[np.uint8], yaw: float) -> NDArray[np.uint8]:
    """The panorama through the fisheye turned `yaw` degrees to the right and 20° up."""
    return reproject(sky, AROUND, FISHEYE.at(turned(yaw, 20, 0)))


def naive(sky: NDArray[np.uint8], yaw: float) -> NDArray[np.uint8]:
    """The same as one writes it: every ray by its angles, four neighbours of every pixel, their weights."""
    u, v = np.meshgrid(np.arange(800.0), np.arange(800.0))
    x, y = (u - 399.5) / 250, (v - 399.5) / 250
    theta, around = np.hypot(x, y), np.arctan2(y, x)
    rays = np.stack([np.sin(theta) * np.cos(around), np.sin(theta) * np.sin(around), np.cos(theta)], axis=-1)
    rays = rays @ turned(yaw, 20, 0).rotation.as_matrix().T
    column = (np.arctan2(rays[..., 0], rays[..., 2]) + np.pi) * 2048 / (2 * np.pi) - 0.5
    row = (np.arctan2(rays[..., 1], np.hypot(rays[..., 0], rays[..., 2])) + np.pi / 2) * 1024 / np.pi - 0.5
    c, r = np.floor(column).astype(int), np.floor(row).astype(int)
    a, b = (column - c)[..., None], (row - r)[..., None]
    upper = (1 - a) * sky[r.clip(0, 1023), c % 2048] + a * sky[r.clip(0, 1023), (c + 1) % 2048]
    lower = (1 - a) * sky[(r + 1).clip(0, 1023), c % 2048] + a * sky[(r + 1).clip(0, 1023), (c + 1) % 2048]
    return np.rint((1 - b) * upper + b * lower).astype(np.uint8)


if __name__ == "__main__":
    main()
