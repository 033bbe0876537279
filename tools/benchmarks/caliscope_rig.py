"""A rig by caliscope, from corners that tools/benchmarks/rigs_public.py gives.

    PYTHON tools/benchmarks/caliscope_rig.py FOLDER

PYTHON is one that has caliscope ("pip install caliscope" in an environment of its own). FOLDER has corners.csv, the
corners as caliscope's own `ImagePoints`, and board.json, and gets rig.toml. It goes as caliscope's page "Scripting API"
does: every camera by itself, then `calibrate_extrinsics` as it comes.
"""

from __future__ import annotations

import json
import logging
import sys
from pathlib import Path

from caliscope.api import (
    CameraArray,
    Chessboard,
    ConstraintSet,
    ImagePoints,
    calibrate_extrinsics,
    calibrate_intrinsics,
)


def main(folder: Path) -> None:
    """Calibrate what is in the folder."""
    logging.disable(logging.WARNING)
    told = json.loads((folder / "board.json").read_text(encoding="utf-8"))
    points = ImagePoints.from_csv(folder / "corners.csv")
    cameras = CameraArray.from_image_sizes({number: tuple(size) for number, size in enumerate(told["sizes"])})
    for number in cameras.cameras:
        cameras[number] = calibrate_intrinsics(points, cameras[number]).camera
    board = Chessboard(told["rows"], told["columns"], told["square_cm"])
    run = calibrate_extrinsics(points, cameras, ConstraintSet.from_chessboard(board))
    print("intrinsics held" if run.intrinsic_refinement_gated else "intrinsics refined")
    run.capture_volume.camera_array.to_toml(folder / "rig.toml")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
