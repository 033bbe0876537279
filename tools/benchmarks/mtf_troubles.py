"""Edges with every kind of trouble: how often `camviz mtf` refuses them, and whether what it prints is so.

    python tools/benchmarks/mtf_troubles.py [EDGES OF A KIND]

An edge's pixels are integrals in closed form, as in tests/test_slanted_edge.py; then light falls off over it, a spot
lies on it, noise is added, and the picture is clipped, encoded as sRGB in 8 bits or kept linear in 16, or saved as
JPEG. It is read as the command reads it. A figure is false where MTF50 is further off than 3 standard errors and 3 %.
"""

import sys
from argparse import Namespace
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "tests"))

from test_slanted_edge import second_antiderivative, true_mtf50

from camviz.scenes import to_encoded
from camviz_clinic.commands.mtf import ends_of_scale, linear_light
from camviz_clinic.measuring.sharpness import SlantedEdge

EACH = 400
FALSE_ERRORS, FALSE_SHARE = 3.0, 0.03


@dataclass(frozen=True)
class Edge:
    """One photograph of an edge: what is in front of the camera, and what the camera does."""

    blur: str
    size: float
    angle_deg: float
    rows: int = 100
    columns: int = 100
    place: float = 0.0  # of the edge, pixels from the middle
    dark: float = 0.1
    bright: float = 0.9
    noise: float = 0.01  # of the contrast
    falls: tuple[float, float] = (0.0, 0.0)  # of the light over the picture, along rows and columns
    curved: tuple[float, float] = (0.0, 0.0)  # the same with the square of the place
    spot: float = 0.0  # diameter on the edge, pixels
    bend: float = 0.0  # sagitta, pixels
    jpeg: int = 0  # quality
    encoded: bool = True  # sRGB of 8 bits; else linear of 16

    @property
    def truth(self) -> float:
        return true_mtf50(self.blur, self.size, self.angle_deg)

    def light(self, rng: np.random.Generator) -> np.ndarray:
        theta = np.radians(self.angle_deg)
        c, s = np.cos(theta), np.sin(theta)
        v, u = np.indices((self.rows, self.columns)).astype(float)
        x, y = u - self.columns / 2, v - self.rows / 2
        sag = self.bend * (4 * (y / self.rows) ** 2 - 0.5)
        d = (x - self.place) * c - y * s - sag
        G = second_antiderivative(self.blur, self.size)
        square = (G(d + (c + s) / 2) - G(d + (c - s) / 2) - G(d - (c - s) / 2) + G(d - (c + s) / 2)) / (c * s)
        light = self.dark + (self.bright - self.dark) * square
        for share, place, curve in zip(self.falls, (x / self.columns, y / self.rows), self.curved, strict=True):
            light = light * (1 + share * place + curve * (4 * place**2))
        if self.spot:
            at = (rng.uniform(-0.3, 0.3) * self.rows) if self.angle_deg < 31 else 0.0
            middle = self.place + at * s / c
            spot = np.hypot(x - middle, y - at) < self.spot / 2
            light[spot] = self.dark if rng.random() < 0.5 else self.bright
        return light + rng.normal(0, self.noise * (self.bright - self.dark), light.shape)

    def picture(self, rng: np.random.Generator) -> np.ndarray:
        light = np.clip(self.light(rng), 0, 1)
        picture = np.rint(255 * to_encoded(light)).astype(np.uint8) if self.encoded else np.rint(65535 * light)
        if self.jpeg:
            _, packed = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, self.jpeg])
            picture = cv2.imdecode(packed, cv2.IMREAD_GRAYSCALE)
        return np.rot90(picture if self.encoded else picture.astype(np.uint16), rng.integers(4))


def usual(rng: np.random.Generator, low: float = 2, high: float = 29) -> Edge:
    """A clean edge."""
    blur = str(rng.choice(["pixel", "gauss", "disc"]))
    size = {"pixel": 0.0, "gauss": np.exp(rng.uniform(np.log(0.3), np.log(2.5))), "disc": rng.uniform(0.7, 3)}[blur]
    return Edge(
        blur,
        float(size),
        rng.uniform(low, high),
        int(rng.integers(60, 240)),
        int(rng.integers(60, 160)),
        rng.uniform(-4, 4),
        dark=rng.uniform(0.03, 0.15),
        bright=rng.uniform(0.5, 0.9),
        noise=float(rng.choice([0.0, 0.002, 0.01, 0.02])),
        encoded=bool(rng.random() < 0.5),
    )


def kinds() -> dict[str, Callable[[np.random.Generator], Edge]]:
    """Edges at random, by the words for their trouble."""

    def signed(rng: np.random.Generator, low: float, high: float) -> float:
        return float(rng.choice([-1, 1]) * rng.uniform(low, high))

    def rational(rng: np.random.Generator) -> Edge:
        slope = rng.choice([1 / 2, 1 / 3, 1 / 4, 1 / 5, 2 / 5, 1 / 6, 1 / 8, 2 / 7])
        return replace(usual(rng), angle_deg=float(np.degrees(np.arctan(slope))) + rng.choice([0, 0, 0, 0.05, 0.2]))

    return {
        "none": usual,
        "noise of 2 to 5 %": lambda rng: replace(
            usual(rng), noise=rng.uniform(0.02, 0.05), dark=rng.uniform(0.12, 0.2)
        ),
        "a small picture, 24 to 50 pixels": lambda rng: replace(
            usual(rng, 4), rows=int(rng.integers(24, 50)), columns=int(rng.integers(24, 50)), place=rng.uniform(-2, 2)
        ),
        "white clipped, at 1.00 to 1.30 of the scale": lambda rng: replace(usual(rng), bright=rng.uniform(1.0, 1.3)),
        "black clipped, at -0.10 to 0": lambda rng: replace(usual(rng), dark=rng.uniform(-0.1, 0)),
        "light falls by 5 to 40 % across": lambda rng: replace(
            usual(rng), falls=(signed(rng, 0.05, 0.4), 0.0), bright=rng.uniform(0.5, 0.7)
        ),
        "light falls by 5 to 40 % along": lambda rng: replace(
            usual(rng), falls=(0.0, signed(rng, 0.05, 0.4)), bright=rng.uniform(0.5, 0.7)
        ),
        "light falls off with the square of the place": lambda rng: replace(
            usual(rng), curved=(-rng.uniform(0.05, 0.3), -rng.uniform(0.05, 0.3))
        ),
        "a spot of 2 to 8 px on the edge": lambda rng: replace(usual(rng), spot=rng.uniform(2, 8)),
        "bent by 0.1 to 3 px": lambda rng: replace(usual(rng, 2, 25), bend=signed(rng, 0.1, 3)),
        "slopes of 1/2, 1/3, 1/4 … and nearly so": rational,
        "1° to 60°": lambda rng: usual(rng, 1, 60),
        "JPEG of quality 50 to 95": lambda rng: replace(usual(rng), jpeg=int(rng.integers(50, 96)), encoded=True),
        "several of these": lambda rng: replace(
            usual(rng, 1, 60),
            noise=rng.uniform(0, 0.05),
            falls=(signed(rng, 0, 0.2), signed(rng, 0, 0.2)),
            bend=signed(rng, 0, 0.5),
            spot=float(rng.choice([0, 0, 4])),
            jpeg=int(rng.choice([0, 75, 90])),
            encoded=True,
        ),
    }


def measure(edge: Edge, rng: np.random.Generator) -> tuple[float, float] | str:
    """MTF50 and its standard error, or why not."""
    options = Namespace(linear=False, srgb=False)
    picture = edge.picture(rng)
    try:
        found = SlantedEdge.of(linear_light(picture, options)[0], ends_of_scale(picture))
    except ValueError as error:
        return str(error)
    return found.mtf50, found.mtf50_error


def main(each: int) -> int:
    print("| trouble | edges | refused | off by, of those printed | inside 2 SE | off by > 3 SE + 3 % | median SE |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    false, reasons = 0, Counter[str]()
    for number, (words, one) in enumerate(kinds().items()):
        rng = np.random.default_rng(number)
        printed, refused = [], 0
        for _ in range(each):
            edge = one(rng)
            said = measure(edge, rng)
            if isinstance(said, str):
                refused += 1
                reasons[f"{words}: {''.join(c for c in said if not c.isdigit())[:70]}"] += 1
            else:
                printed.append((said[0] / edge.truth - 1, said[1] / edge.truth, edge))
        if not printed:
            print(f"| {words} | {each} | {refused} | | | | |")
            continue
        off, error = np.array([(a, b) for a, b, _ in printed]).T
        bad = ~(np.abs(off) <= FALSE_ERRORS * error + FALSE_SHARE)
        false += int(bad.sum())
        print(
            f"| {words} | {each} | {refused} | {100 * np.sqrt(np.mean(off**2)):.1f} % | "
            f"{100 * np.mean(np.abs(off) <= 2 * error):.0f} % | {bad.sum()} | {100 * np.median(error):.1f} % |",
            flush=True,
        )
        if "-v" in sys.argv:
            for i in np.flatnonzero(bad)[:6]:
                print(f"   {100 * off[i]:+.1f} ± {100 * error[i]:.1f} %  {printed[i][2]}")
    if "-v" in sys.argv:
        for words, number in sorted(reasons.items()):
            print("  ", number, words)
    print(f"\n{false} of {each * len(kinds())} figures are false.")
    return 1 if false else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else EACH))
