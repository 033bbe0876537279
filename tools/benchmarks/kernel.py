"""What camviz costs without a browser: imports, kernel memory, lenses beside OpenCV, the ray tracer.

    python tools/benchmarks/kernel.py

Prints Markdown for docs/performance.md. Times are medians.
"""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from queue import Empty

import cv2
import numpy as np
import psutil
from jupyter_client.manager import KernelManager

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import LENSES, BrownConrady, KannalaBrandt, Lens, Perspective, UnifiedSphere
from camviz.scenes import render, textured_scene

ROOT = Path(__file__).resolve().parents[2]
POINTS = 100_000
FOCAL_PX = 250.0  # the tracer's cameras, 640 × 480
COEFFICIENTS: dict[str, tuple[float, ...]] = {
    "brown_conrady": (-0.28, 0.07, 1e-3, -5e-4, 0.01),
    "kannala_brandt": (0.00693023, -0.0013828, -0.000272596, -0.000452646),
    "unified_sphere": (0.8,),
    "extended_unified": (0.6, 1.1),
    "double_sphere": (-0.2, 0.6),
    "field_of_view": (0.93,),
}


def median_ms(work: Callable[[], object], repeats: int = 9) -> float:
    """The median time of `work` in milliseconds, after one run that is not counted."""
    work()
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return float(np.median(times)) * 1000


def import_ms(module: str, repeats: int = 7) -> float:
    """The median time to import `module` in a fresh interpreter."""
    code = f"import time; t = time.perf_counter(); import {module}; print(time.perf_counter() - t)"
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, check=True) for _ in range(repeats)]
    return float(np.median([float(run.stdout) for run in runs])) * 1000


def lesson_mb(lesson: Path, renderer: str) -> tuple[float, float]:
    """Megabytes that a lesson's kernel holds after all of its cells have run, and how many another one would add."""
    cells = json.loads(lesson.read_text(encoding="utf-8"))["cells"]
    manager = KernelManager()
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "CAMVIZ_RENDERER": renderer, "PYTHONPATH": path}
    manager.start_kernel(cwd=str(lesson.parent), env=environment, stderr=subprocess.DEVNULL)
    client = manager.client()
    client.start_channels()
    try:
        client.wait_for_ready(timeout=60)
        for cell in cells:
            if cell["cell_type"] == "code":
                _run(client, "".join(cell["source"]), lesson)
        kernel = psutil.Process(manager.provisioner.pid)
        return kernel.memory_info().rss / 2**20, _of_its_own_mb(kernel.pid)
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def _of_its_own_mb(pid: int) -> float:
    """Megabytes of a process that it has written itself: the rest, the code of libraries, all processes share."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Private_Dirty")) / 2**10


def _run(client: object, source: str, lesson: Path) -> None:
    try:
        reply = client.execute_interactive(source, output_hook=lambda _: None, timeout=120)
    except Empty:
        raise RuntimeError(f"{lesson.name} did not answer") from None
    if reply["content"]["status"] != "ok":
        raise RuntimeError(f"{lesson.name}: {reply['content']['evalue']}")


def peer(lens: Lens, points: np.ndarray) -> Callable[[], object] | None:
    """OpenCV's projection of the same points by the same lens, where it has it."""
    zero, K = np.zeros(3), np.eye(3)
    if isinstance(lens, Perspective | BrownConrady):
        names = ("k1", "k2", "p1", "p2", "k3")
        coefficients = np.array([getattr(lens, name, 0.0) for name in names])
        return lambda: cv2.projectPoints(points, zero, zero, K, coefficients)
    if isinstance(lens, KannalaBrandt):
        coefficients = np.array([lens.k1, lens.k2, lens.k3, lens.k4])
        return lambda: cv2.fisheye.projectPoints(points[None], zero, zero, K, coefficients)
    if isinstance(lens, UnifiedSphere):
        return lambda: cv2.omnidir.projectPoints(points[None], zero, zero, K, float(lens.xi), np.zeros(4))
    return None


def lens_row(name: str) -> list[str]:
    """Million points a second projected, beside OpenCV, and unprojected; ms to trace 640 × 480 of the garden."""
    lens = LENSES[name](*COEFFICIENTS.get(name, ()))
    rng = np.random.default_rng(0)
    points = rng.uniform((-0.5, -0.5, 1), (0.5, 0.5, 2), (POINTS, 3))
    image = lens.project(points)
    rate = lambda work: POINTS / median_ms(work) / 1000  # noqa: E731
    other = peer(lens, points)
    camera = Camera(Intrinsics(640, 480, FOCAL_PX, FOCAL_PX, 319.5, 239.5), lens)
    return [
        name,
        f"{rate(lambda: lens.project(points)):.1f}",
        f"{rate(other):.1f}" if other else "–",
        f"{rate(lambda: lens.unproject(image)):.1f}",
        f"{median_ms(lambda: render(textured_scene(), camera)):.0f}",
    ]


def table(head: list[str], rows: list[list[str]]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *rows]) + "\n"


def main() -> None:
    modules = ("camviz", "camviz.cameras", "camviz.scenes", "camviz.twoview", "camviz_clinic.files", "camviz.widgets")
    print(table(["import", "ms"], [[name, f"{import_ms(name):.0f}"] for name in modules]))
    head = ["lens", "project, M points/s", "OpenCV", "unproject, M points/s", "trace 640 × 480, ms"]
    print(table(head, [lens_row(name) for name in LENSES]), flush=True)
    lessons = sorted((ROOT / "lessons").glob("*.ipynb"))
    rows = [[path.stem, *(f"{mb:.0f}" for r in ("wire", "solid") for mb in lesson_mb(path, r))] for path in lessons]
    print(table(["lesson's kernel", "wire, MB", "of its own", "solid, MB", "of its own"], rows))


if __name__ == "__main__":
    main()
