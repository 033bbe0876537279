"""How long the finder of chessboards takes, and what it finds, in a folder of large photographs.

    python tools/benchmarks/corners.py PHOTOGRAPHS... --board 9x6

Each photograph is searched twice by the same process on one core: everywhere, as OpenCV's finder does, and as
`find_chessboard` does, first in a smaller copy and then at full size where the board is. Last comes `detect` with as
many processes as the machine has. docs/performance.md has figures.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from camviz_clinic.calibration import Board, detect
from camviz_clinic.calibration.chessboards import everywhere, find_chessboard
from camviz_clinic.calibration.finding import read_gray


def timed(find: Callable[[Any, Board], Any], pictures: list[Any], board: Board) -> tuple[list[Any], float]:
    """What was found in each picture, and the seconds of one core in all."""
    start = time.process_time()
    found = [find(picture, board) for picture in pictures]
    return found, time.process_time() - start


def apart(one: Any, other: Any) -> float:
    """The largest distance of two corners in pixels, whichever end comes first."""
    return float(min(np.linalg.norm(one - each, axis=-1).max() for each in (other, other[::-1])))


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("photographs", nargs="+", type=Path)
    parser.add_argument("--board", default="9x6")
    options = parser.parse_args()
    columns, rows = map(int, options.board.split("x"))
    board = Board(columns, rows, 0.025)
    cv2.setNumThreads(1)
    pictures = [picture for path in options.photographs if (picture := read_gray(path)) is not None]
    before, slow = timed(everywhere, pictures, board)
    after, quick = timed(find_chessboard, pictures, board)
    for name, found, seconds in (("everywhere", before, slow), ("now", after, quick)):
        count = sum(corners is not None for corners in found)
        print(f"{name:<10} {count} of {len(pictures)} boards, {seconds:.1f} s, {seconds / len(pictures):.3f} s each")
    both = [
        apart(one, other) for one, other in zip(before, after, strict=True) if one is not None and other is not None
    ]
    print(f"the worst corner of a picture moved by {np.median(both):.3f} px (median), {max(both):.3f} px (most)")
    start = time.perf_counter()
    detections = detect(options.photographs, board)
    print(f"detect     {len(detections.pictures)} boards in {time.perf_counter() - start:.1f} s by the clock")


if __name__ == "__main__":
    main()
