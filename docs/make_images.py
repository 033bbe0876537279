"""Draw the README's pictures anew: python docs/make_images.py (solid 3D needs OpenGL)."""

from pathlib import Path

from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz.views.intrinsics import IntrinsicsView
from camviz.views.pinhole import PinholeView

PICTURES = {
    "pinhole": PinholeView(),
    "intrinsics": IntrinsicsView(),
    "frustum": FrustumView(),
    "distortion": DistortionView(k1=-0.28, k2=0.07),
    "fold": DistortionView(k1=-0.3, k2=0.0),
    "epipolar": EpipolarView(),
}

if __name__ == "__main__":
    folder = Path(__file__).with_name("images")
    folder.mkdir(exist_ok=True)
    for name, view in PICTURES.items():
        view.figure().save(folder / f"{name}.svg")
