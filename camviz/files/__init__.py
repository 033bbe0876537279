"""Calibration files: `load(path)` reads what OpenCV, ROS and Kalibr write into a `Calibration`."""

from camviz.files.calibration import Board, Calibration, CalibrationError
from camviz.files.loading import load

__all__ = ["Board", "Calibration", "CalibrationError", "load"]
