"""What measuring a sensor costs: 50 levels of 640 × 480 frames, beside a straightforward version of the same.

    python tools/benchmarks/noise.py

Prints Markdown for docs/performance.md. The frames are simulated once; times are medians of five runs.
"""

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from camviz.sensors import Sensor
from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.recording import measure, read_recording
from camviz_school.views.noise import PhotonTransferView

SENSOR = Sensor(prnu=0.01, dsnu_e=5, dark_current_e_per_s=100)
EXPOSURES_S = np.linspace(0.02, 1, 50)
PHOTONS_PER_S = 19_000.0
Shots = list[tuple[float, list[np.ndarray], list[np.ndarray]]]


def shots() -> Shots:
    """Two bright and two dark frames of every level."""
    rng = np.random.default_rng(0)

    def pair(photons: float, t: float) -> list[np.ndarray]:
        return [SENSOR.expose(np.full((480, 640), photons), t, 20.0, rng).dn for _ in range(2)]

    return [(float(t), pair(PHOTONS_PER_S * t, t), pair(0.0, t)) for t in EXPOSURES_S]


def ours(taken: Shots) -> float:
    levels = tuple(Level.of(t, bright, dark, PHOTONS_PER_S * t) for t, bright, dark in taken)
    return Measurement(levels).gain_dn_per_e


def straightforward(taken: Shots) -> float:
    """Means, the variance of the difference, and a fit, as one would write them down."""
    signal, variance = [], []
    for _, (a, b), (c, d) in taken:
        signal.append(np.mean([a, b]) - np.mean([c, d]))
        variance.append((np.var(a.astype(float) - b) - np.var(c.astype(float) - d)) / 2)
    x, y = np.array(signal), np.array(variance)
    used = x <= 0.7 * x[np.argmax(y)]
    return float(np.linalg.lstsq(x[used, None], y[used], rcond=None)[0][0])


def median_ms(work: Callable[[], object]) -> float:
    """The median time of `work` in milliseconds of this process's CPU, after one run that is not counted."""
    work()
    times = []
    for _ in range(5):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return 1000 * statistics.median(times)


def from_disk_ms(taken: Shots) -> float:
    with tempfile.TemporaryDirectory() as folder:
        for t, bright, dark in taken:
            for kind, frames in (("bright", bright), ("dark", dark)):
                for number, frame in enumerate(frames):
                    cv2.imwrite(f"{folder}/{kind}_{1000 * t:g}_{number}.png", frame)
        return median_ms(lambda: measure(read_recording(Path(folder))))


def view_ms(draft: bool) -> float:
    states = iter(np.linspace(-8, 2, 100))
    return median_ms(lambda: PhotonTransferView(exposure=float(next(states))).figure(draft=draft))


def main() -> None:
    taken = shots()
    frame = np.full((480, 640), 10_000.0)
    rng = np.random.default_rng(1)
    rows = [
        ("50-level photon transfer of 640 × 480 frames, all EMVA figures", median_ms(lambda: ours(taken))),
        ("the same by plain NumPy, the gain alone", median_ms(lambda: straightforward(taken))),
        ("the same with reading 200 PNG files", from_disk_ms(taken)),
        ("one frame of 640 × 480 exposed", median_ms(lambda: SENSOR.expose(frame, 0.5, 20.0, rng))),
        ("the photon-transfer view, a draft", view_ms(True)),
        ("the photon-transfer view, fine", view_ms(False)),
    ]
    print("| what | ms |\n|---|---|")
    print("\n".join(f"| {what} | {ms:.0f} |" for what, ms in rows))
    print(f"\nK: {ours(taken):.6f} and {straightforward(taken):.6f} DN/e⁻, for a true {SENSOR.gain_dn_per_e}.")


if __name__ == "__main__":
    main()
