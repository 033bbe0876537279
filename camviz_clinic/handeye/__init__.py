"""Hand–eye calibration: where a camera sits on a robot's hand or beside the robot, and what is wrong with the poses."""

from camviz_clinic.calibration.motions import PoseError
from camviz_clinic.handeye.pose_table import RobotPoses, read_poses
from camviz_clinic.handeye.solving import HandEye, hand_eye, hand_eye_from_corners

__all__ = ["HandEye", "PoseError", "RobotPoses", "hand_eye", "hand_eye_from_corners", "read_poses"]
