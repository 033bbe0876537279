"""How long demosaicing takes and how well it does, beside colour-demosaicing and OpenCV, on the same mosaic.

    python tools/benchmarks/mosaics.py

The photograph is scikit-image's astronaut as it is stored, under RGGB; 10 pixels of border are left out of the PSNR.
Prints the table of docs/performance.md. Absolute times belong to one machine; the ratios within one run travel.
"""

from __future__ import annotations

import statistics
import time
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np
from kernel import table

from camviz import mosaics
from camviz.mosaics import BAYER
from camviz.scenes.photographs import photograph

with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    import colour_demosaicing as theirs

RGGB = BAYER["RGGB"]
THEIRS = {
    "bilinear": theirs.demosaicing_CFA_Bayer_bilinear,
    "Malvar": theirs.demosaicing_CFA_Bayer_Malvar2004,
    "Menon": theirs.demosaicing_CFA_Bayer_Menon2007,
}


def main() -> None:
    truth = photograph("astronaut") / 255
    measured = mosaics.mosaic(truth, RGGB)
    in_bytes = np.rint(255 * measured).astype(np.uint8)
    rows = []
    for name, ours in mosaics.ALGORITHMS.items():
        other = judged(partial(THEIRS[name], measured, "RGGB"), truth) if name in THEIRS else ["–", "–"]
        rows.append([name, *judged(partial(ours, measured, RGGB), truth), *other])
    for name in ("bilinear", "EA", "VNG"):
        found = judged(partial(in_opencv, in_bytes, name), truth)
        rows.append([f"OpenCV {name}, uint8", *found, "–", "–"])
    print(table(["algorithm, 512 × 512", "ms", "dB", "colour-demosaicing, ms", "dB"], rows))


def in_opencv(in_bytes: np.ndarray, method: str) -> np.ndarray:
    return mosaics.opencv(in_bytes, RGGB, method) / 255


def judged(work: Callable[[], np.ndarray], truth: np.ndarray) -> list[str]:
    """Median processor time in ms and PSNR in dB."""
    inside = np.s_[10:-10, 10:-10]
    taken = []
    for _ in range(7):
        start = time.process_time()
        picture = work()
        taken.append(1e3 * (time.process_time() - start))
    return [f"{statistics.median(taken):.1f}", f"{mosaics.psnr(picture[inside], truth[inside]):.2f}"]


if __name__ == "__main__":
    main()
