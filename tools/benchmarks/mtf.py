"""MTF50 of edges whose blur is known analytically: the truth, camviz, and a published program on the same edges.

    python tools/benchmarks/mtf.py [FOLDER]

FOLDER holds SFR.py of github.com/carlasplund/SFR_calculation_code, in the public domain (CC0); without it that column
is left out. With noise, each figure is the deviation of 100 photographs from the truth, as a root mean square.
"""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests"))

from test_slanted_edge import photograph, true_mtf50

from camviz_clinic.measuring.sharpness import SlantedEdge

EDGES = [
    ("pixel", 0.0),
    ("gauss", 0.3),
    ("gauss", 0.5),
    ("gauss", 1.0),
    ("gauss", 2.0),
    ("disc", 1.5),
    ("disc", 3.0),
    ("airy", 0.5),
    ("airy", 2.0),
]
NOISY = [("pixel", 0.0), ("disc", 1.5), ("gauss", 1.0), ("gauss", 2.0)]
WORDS = {
    "pixel": "the pixel alone",
    "gauss": "a Gaussian, σ = {:g} px",
    "disc": "a disc of radius {:g} px",
    "airy": "diffraction, λN = {:g} px",
}
ANGLES_DEG = (2, 3, 5, 7, 10, 12, 15)
NOISE, SHOTS = 0.02, 100

Measure = Callable[[np.ndarray], float]


def camviz(image: np.ndarray) -> float:
    return SlantedEdge.of(image).mtf50


def published(folder: str) -> Measure:
    """MTF50 by Asplund's SFR, read off its curve as ours is, with its own defaults and a straight edge."""
    sys.path.append(folder)
    from SFR import SFR

    program = SFR(quadratic_fit=False)

    def mtf50(image: np.ndarray) -> float:
        frequency, values = program.calc_sfr(image)[0].T
        after = int(np.argmax(values < 0.5))
        return float(np.interp(-0.5, -values[after - 1 : after + 1], frequency[after - 1 : after + 1]))

    return mtf50


def off(measure: Measure, blur: str, size: float, angle_deg: float) -> float:
    """How far, of the true MTF50, the measured one is off."""
    return abs(measure(photograph(blur, size, angle_deg)) / true_mtf50(blur, size, angle_deg) - 1)


def row(cells: list[object]) -> None:
    print("| " + " | ".join(str(cell) for cell in cells) + " |")


def without_noise(programs: dict[str, Measure]) -> None:
    row(["blur", "true MTF50 at 5°", *programs, *(f"{name}: worst of 2° to 15°" for name in programs)])
    row(["---"] * (2 + 2 * len(programs)))
    for blur, size in EDGES:
        truth = true_mtf50(blur, size, 5)
        at_five = [f"{measure(photograph(blur, size, 5)):.4f}" for measure in programs.values()]
        worst = [f"{100 * max(off(measure, blur, size, a) for a in ANGLES_DEG):.2f} %" for measure in programs.values()]
        row([WORDS[blur].format(size), f"{truth:.4f}", *at_five, *worst])


def with_noise(programs: dict[str, Measure]) -> None:
    print(f"\n{100 * NOISE:g} % noise, an edge at 5°:\n")
    row(
        ["blur", "rows", *(f"{name}: off by" for name in programs), "camviz: its standard error", "within 3 %", "worst"]
    )
    row(["---"] * (5 + len(programs)))
    for blur, size in NOISY:
        truth = true_mtf50(blur, size, 5)
        for rows in (40, 80, 200, 400):
            rng, sharp = np.random.default_rng(rows), photograph(blur, size, 5, (rows, 120))
            shots = [sharp + rng.normal(0, NOISE * 0.8, sharp.shape) for _ in range(SHOTS)]
            errors = [np.array([measure(shot) / truth - 1 for shot in shots]) for measure in programs.values()]
            told = np.mean([SlantedEdge.of(shot).mtf50_error for shot in shots]) / truth
            scatter = [f"{100 * np.sqrt(np.mean(one**2)):.1f} %" for one in errors]
            within = f"{np.mean(np.abs(errors[0]) < 0.03) * 100:.0f} of 100"
            worst = f"{100 * np.abs(errors[0]).max():.1f} %"
            row([WORDS[blur].format(size), rows, *scatter, f"{100 * told:.1f} %", within, worst])


def main(folder: str | None) -> int:
    programs: dict[str, Measure] = {"camviz": camviz}
    if folder:
        programs["SFR"] = published(folder)
    without_noise(programs)
    with_noise(programs)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else None))
