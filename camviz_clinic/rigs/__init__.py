"""Rigs: any number of cameras that see a board, or several, in any of the frames, and what ties them together."""

from camviz_clinic.rigs.boards import SolvedBoards, calibrate_boards
from camviz_clinic.rigs.frames import in_frames, synchronised
from camviz_clinic.rigs.places import RelativePose, relative_pose, rig_of
from camviz_clinic.rigs.solving import calibrate_rig

__all__ = [
    "RelativePose",
    "SolvedBoards",
    "calibrate_boards",
    "calibrate_rig",
    "in_frames",
    "relative_pose",
    "rig_of",
    "synchronised",
]
