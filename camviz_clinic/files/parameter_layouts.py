"""How programs write lenses: the camera models of each program, and their parameters in the program's order.

A program that learns a lens gets one row. The first row that holds a camera is the one that is written.
"""

from collections.abc import Mapping, Sequence

from camviz import lenses
from camviz_clinic.files.models import GRID, Model

RADTAN = "k1 k2 p1 p2"
RATIONAL = f"{RADTAN} k3 k4 k5 k6"
PRISM = f"{RATIONAL} s1 s2 s3 s4"

LAYOUTS: Mapping[str, Sequence[Model]] = {
    "basalt": [
        Model("pinhole", lenses.Perspective, GRID),
        Model("pinhole-radtan8", lenses.BrownConrady, f"{GRID} {RATIONAL}"),
        Model("fov", lenses.FieldOfView, f"{GRID} omega"),
        Model("kb4", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
        Model("ucm", lenses.ExtendedUnified, f"{GRID} alpha", {"beta": 1.0}),
        Model("eucm", lenses.ExtendedUnified, f"{GRID} alpha beta"),
        Model("ds", lenses.DoubleSphere, f"{GRID} xi alpha"),
    ],
    "camodocal": [
        Model("PINHOLE", lenses.BrownConrady, f"{GRID} {RADTAN}"),
        Model("PINHOLE_FULL", lenses.BrownConrady, f"{GRID} {RATIONAL}"),
        Model("KANNALA_BRANDT", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
        Model("MEI", lenses.UnifiedSphere, f"xi {GRID} {RADTAN}"),
    ],
    "colmap": [
        Model("SIMPLE_PINHOLE", lenses.Perspective, "f cx cy", number=0),
        Model("PINHOLE", lenses.Perspective, GRID, number=1),
        Model("SIMPLE_RADIAL", lenses.BrownConrady, "f cx cy k1", number=2),
        Model("RADIAL", lenses.BrownConrady, "f cx cy k1 k2", number=3),
        Model("OPENCV", lenses.BrownConrady, f"{GRID} {RADTAN}", number=4),
        Model("FULL_OPENCV", lenses.BrownConrady, f"{GRID} {RATIONAL}", number=6),
        Model("SIMPLE_FISHEYE", lenses.Equidistant, "f cx cy", number=14),
        Model("FISHEYE", lenses.Equidistant, GRID, number=15),
        Model("FOV", lenses.FieldOfView, f"{GRID} omega", number=7),
        Model("OPENCV_FISHEYE", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4", number=5),
        Model("SIMPLE_RADIAL_FISHEYE", lenses.KannalaBrandt, "f cx cy k1", number=8),
        Model("RADIAL_FISHEYE", lenses.KannalaBrandt, "f cx cy k1 k2", number=9),
        Model("EUCM", lenses.ExtendedUnified, f"{GRID} alpha beta", number=16),
        Model("THIN_PRISM_FISHEYE", lenses.ThinPrismFisheye, f"{GRID} {RADTAN} k3 k4 sx1 sy1", number=10),
    ],
    "euroc": [
        Model("radial-tangential", lenses.BrownConrady, f"{GRID} {RADTAN}"),
        Model("equidistant", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "kalibr": [
        Model("pinhole none", lenses.Perspective, GRID),
        Model("pinhole radtan", lenses.BrownConrady, f"{GRID} {RADTAN}"),
        Model("pinhole fov", lenses.FieldOfView, f"{GRID} omega"),
        Model("pinhole equidistant", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
        Model("omni none", lenses.UnifiedSphere, f"xi {GRID}"),
        Model("omni radtan", lenses.UnifiedSphere, f"xi {GRID} {RADTAN}"),
        Model("eucm none", lenses.ExtendedUnified, f"alpha beta {GRID}"),
        Model("ds none", lenses.DoubleSphere, f"xi alpha {GRID}"),
    ],
    "kitti": [
        Model("P", lenses.Perspective, f"{GRID} skew"),
    ],
    "kitti-raw": [
        Model("K and D", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
    ],
    "matlab": [
        Model("cameraParameters", lenses.BrownConrady, f"{GRID} skew {RADTAN} k3"),
    ],
    "metashape": [
        Model("frame", lenses.BrownConrady, f"{GRID} skew {RADTAN} k3"),
        Model("fisheye", lenses.KannalaBrandt, f"{GRID} skew k1 k2 k3 k4"),
        Model("spherical", lenses.Equirectangular, f"{GRID} skew"),
        Model("cylindrical", lenses.Cylindrical, f"{GRID} skew"),
    ],
    "mrcal": [
        Model("LENSMODEL_PINHOLE", lenses.Perspective, GRID),
        Model("LENSMODEL_OPENCV4", lenses.BrownConrady, f"{GRID} {RADTAN}"),
        Model("LENSMODEL_OPENCV5", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("LENSMODEL_OPENCV8", lenses.BrownConrady, f"{GRID} {RATIONAL}"),
        Model("LENSMODEL_OPENCV12", lenses.BrownConrady, f"{GRID} {PRISM}"),
        Model("LENSMODEL_STEREOGRAPHIC", lenses.Stereographic, GRID),
        Model("LENSMODEL_LONLAT", lenses.Equirectangular, GRID),
    ],
    "nerfstudio": [
        Model("OPENCV", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("OPENCV_FISHEYE", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "okvis": [
        Model("radialtangential", lenses.BrownConrady, f"{GRID} {RADTAN}"),
        Model("radialtangential8", lenses.BrownConrady, f"{GRID} {RATIONAL}"),
        Model("equidistant", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "opencv": [
        Model("distortion_coefficients", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("distortion_coefficients", lenses.BrownConrady, f"{GRID} {RATIONAL}"),
        Model("distortion_coefficients", lenses.BrownConrady, f"{GRID} {PRISM}"),
        Model("distortion_coefficients", lenses.BrownConrady, f"{GRID} {PRISM} tau_x tau_y"),
        Model("cv2.fisheye", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
        Model("cv2.omnidir", lenses.UnifiedSphere, f"{GRID} skew {RADTAN} xi"),
    ],
    "opensfm": [
        Model("perspective", lenses.BrownConrady, "f cx cy k1 k2"),
        Model("brown", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("fisheye", lenses.KannalaBrandt, "f cx cy k1 k2"),
        Model("fisheye_opencv", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "orbslam": [
        Model("PinHole", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("KannalaBrandt8", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "ros": [
        Model("plumb_bob", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("rational_polynomial", lenses.BrownConrady, f"{GRID} {RATIONAL}"),
        Model("equidistant", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "stella": [
        Model("perspective", lenses.BrownConrady, f"{GRID} {RADTAN} k3"),
        Model("fisheye", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
    "svo": [
        Model("pinhole none", lenses.Perspective, GRID),
        Model("pinhole radial-tangential", lenses.BrownConrady, f"{GRID} {RADTAN}"),
        Model("pinhole fisheye", lenses.FieldOfView, f"{GRID} omega"),
        Model("pinhole equidistant", lenses.KannalaBrandt, f"{GRID} k1 k2 k3 k4"),
    ],
}
