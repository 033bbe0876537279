"""Draw the README's pictures anew: python tools/docs/make_images.py (solid 3D needs OpenGL)."""

from pathlib import Path

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz_school.views.calibration import CalibrationView
from camviz_school.views.colour import ColourView
from camviz_school.views.demosaicing import DemosaicingView
from camviz_school.views.depth_of_field import DepthOfFieldView
from camviz_school.views.fault_lab import FaultLabView
from camviz_school.views.fisheye import FisheyeView
from camviz_school.views.intrinsics import IntrinsicsView
from camviz_school.views.light_field import LightFieldView
from camviz_school.views.mosaic import MosaicView
from camviz_school.views.noise import PhotonTransferView
from camviz_school.views.omnidirectional import OmnidirectionalView
from camviz_school.views.pinhole import PinholeView
from camviz_school.views.readout import ReadoutView
from camviz_school.views.rectification import RectificationView
from camviz_school.views.sharpness import SharpnessView
from camviz_school.views.vanishing import VanishingView

# The left camera of OpenCV's samples/data/intrinsics.yml
PUBLISHED = Camera(
    Intrinsics(640, 480, 534.80326845, 534.80326845, 335.68643204, 240.66183054),
    BrownConrady(k1=0.29589439552724328, k2=-1.0354662043042675),
)
PICTURES = {
    "pinhole": PinholeView(),
    "intrinsics": IntrinsicsView(),
    "frustum": FrustumView(),
    "distortion": DistortionView(k1=-0.28, k2=0.07),
    "fold": DistortionView.of(PUBLISHED),
    "calibration": CalibrationView(tilt=2.0, picked=3, panels="picture fit"),
    "epipolar": EpipolarView(right_x=0.15, right_z=0.9, yaw=0.0, depth=3.0, panels="right epipoles"),
    "rectification": RectificationView(),
    "colour": ColourView(matrix="off", patch=18, panels="chart"),
    "demosaicing": DemosaicingView(panels="picture loupe"),
    "depth_of_field": DepthOfFieldView(),
    "fisheye": FisheyeView(panels="picture curves"),
    "image_sensor": ReadoutView(panels="picture", time=100),
    "light_field": LightFieldView(slope=1.04, panels="picture slice"),
    "noise": PhotonTransferView(exposure=-8.0, dark_current=0.0, panels="picture curve"),
    "omnidirectional": OmnidirectionalView(panels="doughnut window", hfov_deg=80.0),
    "sharpness": SharpnessView(f_number=2.8, defocus_um=20.0),
    "one_picture": VanishingView(panels="paper"),
    "mosaic": MosaicView(panels="mosaic"),
    "fault_lab": FaultLabView(fault="column off", strength=0.5, seed=5).worst(),
}

if __name__ == "__main__":
    folder = Path(__file__).parents[2] / "docs" / "images"
    folder.mkdir(exist_ok=True)
    for name, view in PICTURES.items():
        view.figure().save(folder / f"{name}.svg", theme="browser")
