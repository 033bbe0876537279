"""The programs that tools/benchmarks/rigs_public.py has calibrate rigs: from the same corners to cameras in place.

caliscope runs in a Python of its own, which CALISCOPE_PYTHON names, as `pip install caliscope` brings another OpenCV.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from field import LIMIT_S, MRCAL, by_opencv
from rigs import calibrated_by_opencv

from camviz.cameras import Camera
from camviz_clinic.calibration import Detections
from camviz_clinic.calibration.types import Board
from camviz_clinic.files import load
from camviz_clinic.rigs import calibrate_rig

MODEL = "standard"
WITHOUT_REGION = """import runpy, sys, mrcal
mrcal.calibration._compute_valid_intrinsics_region = lambda *given: None
sys.argv = sys.argv[1:]
runpy.run_path(sys.argv[0], run_name="__main__")"""
CALISCOPE = os.environ.get("CALISCOPE_PYTHON", "")
Found = dict[str, Detections]
Rig = dict[str, Camera]


def rig_by_camviz(found: Found, board: Board) -> Rig:
    """`camviz calibrate --rig` as it comes."""
    return calibrate_rig(found, board, MODEL, board_warp="auto").cameras


def rig_by_opencv(found: Found, board: Board) -> Rig:
    """cv2.calibrateCamera by all corners, and cv2.calibrateMultiview by those that all cameras of a frame see."""
    held = {name: by_opencv(each, board, MODEL) for name, each in found.items()}
    rig = calibrated_by_opencv(found, board, dict.fromkeys(found, MODEL), held)
    if rig is None:
        raise ValueError("cv2.calibrateMultiview fails")
    return rig


def rig_by_mrcal(found: Found, board: Board) -> Rig:
    """mrcal-calibrate-cameras as it comes, from OpenCV's focal length, without the region of valid intrinsics.

    Where a camera has few views, it fails in the search for this region after it has solved for everything.
    """
    focal = np.median([by_opencv(each, board, MODEL).intrinsics.fx for each in found.values()])
    rows = ["# filename x y level"]
    for camera, each in enumerate(found.values()):
        for place, corners in zip(each.places, each.corners, strict=True):
            name = f"cam{camera}-frame{place:04d}.png "
            rows += [name + (f"{u} {v} 0" if np.isfinite(u) else "0 0 -") for u, v in corners]
    size = {f"{each.width} {each.height}" for each in found.values()}
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "corners.vnl").write_text("\n".join(rows) + "\n", encoding="utf-8")
        words = f"--corners-cache corners.vnl --lensmodel {MRCAL[MODEL]} --focal {focal} "
        words += f"--object-spacing {board.square_size} --object-width-n {board.columns} "
        words += f"--object-height-n {board.rows} --imagersize {' '.join(size)} "
        words += " ".join(f"cam{camera}-frame*.png" for camera in range(len(found)))
        program = ["/usr/bin/python3", "-c", WITHOUT_REGION, str(shutil.which("mrcal-calibrate-cameras"))]
        subprocess.run([*program, *words.split()], cwd=folder, capture_output=True, check=True, timeout=LIMIT_S)
        files = [Path(folder, f"camera-{camera}.cameramodel") for camera in range(len(found))]
        return {name: next(iter(load(path).cameras.values())) for name, path in zip(found, files, strict=True)}


def rig_by_caliscope(found: Found, board: Board) -> Rig:
    """caliscope's scripting API as its pages show it: tools/benchmarks/caliscope_rig.py."""
    rows = ["sync_index,cam_id,object_id,keypoint_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y,obj_loc_z"]
    for camera, each in enumerate(found.values()):
        for place, corners in zip(each.places, each.corners, strict=True):
            for number, ((u, v), point) in enumerate(zip(corners, board.corners, strict=True)):
                rows += [f"{place},{camera},0,{number},{u},{v},{','.join(map(str, point))}"] * bool(np.isfinite(u))
    told = {"rows": board.rows, "columns": board.columns, "square_cm": 100 * board.square_size,
            "sizes": [(each.width, each.height) for each in found.values()]}  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "corners.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
        Path(folder, "board.json").write_text(json.dumps(told), encoding="utf-8")
        command = [CALISCOPE, str(Path(__file__).with_name("caliscope_rig.py")), folder]
        subprocess.run(command, capture_output=True, check=True, timeout=LIMIT_S)
        return dict(zip(found, load(Path(folder, "rig.toml")).cameras.values(), strict=True))


PROGRAMS: dict[str, Callable[[Found, Board], Rig]] = {"camviz": rig_by_camviz}
if hasattr(cv2, "calibrateMultiview"):  # from 5.0 on
    PROGRAMS["OpenCV"] = rig_by_opencv
if shutil.which("mrcal-calibrate-cameras"):
    PROGRAMS["mrcal"] = rig_by_mrcal
if CALISCOPE:
    PROGRAMS["caliscope"] = rig_by_caliscope
