"""A lens written as another one: the error that is said is the error that is there, pixel by pixel."""

import numpy as np
import pytest

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, DoubleSphere, FieldOfView, KannalaBrandt, UnifiedSphere
from camviz_clinic.calibration.lens_fit import fit_lens
from camviz_clinic.commands import command
from camviz_clinic.files import Calibration, write

GRID = Intrinsics(640, 480, 350.0, 351.0, 322.0, 238.5)
PAIRS = {
    "double sphere as Kannala-Brandt": (DoubleSphere(-0.2, 0.6), "fisheye"),
    "rational as Brown-Conrady": (BrownConrady(0.3, -0.1, 1e-3, -5e-4, 0.02, 0.6, -0.05, 0.01), "standard"),
    "Kannala-Brandt as unified sphere": (KannalaBrandt(0.01, -0.004, 0.001, -2e-4), "omni"),
    "field of view as rational": (FieldOfView(0.9), "rational"),
    "unified sphere as Kannala-Brandt": (UnifiedSphere(0.9, -0.05, 0.01, 5e-4, -3e-4), "fisheye"),
}


def brute(camera, other):
    """How far apart two cameras show the ray of each pixel of the image, one by one."""
    u, v = np.meshgrid(np.arange(640.0), np.arange(480.0))
    uv = np.stack([u, v], axis=-1)
    return np.linalg.norm(other.project(camera.unproject(uv)) - uv, axis=-1)


@pytest.mark.parametrize("pair", PAIRS)
def test_the_error_that_is_said_is_there(pair):
    """Median and worst equal those of all pixels within 1 %, and no pixel is worse than the one named by more."""
    lens, model = PAIRS[pair]
    fit = fit_lens(Camera(GRID, lens), model)
    error = brute(Camera(GRID, lens), fit.camera)
    assert fit.median == pytest.approx(np.median(error), rel=0.01)
    assert fit.worst == pytest.approx(error.max(), rel=0.01)
    u, v = np.rint(fit.worst_at).astype(int)
    assert error[v, u] == pytest.approx(error.max(), rel=0.02)
    assert fit.worst < 5


def test_a_lens_that_the_model_holds_is_found_again():
    camera = Camera(GRID, KannalaBrandt(0.01, -0.004, 0.001, -2e-4))
    fit = fit_lens(camera, "fisheye")
    assert fit.worst < 1e-6
    assert fit.camera.intrinsics.fx == pytest.approx(350, abs=1e-6)


def test_least_squares_is_at_its_least():
    """No parameter that is moved a little makes the sum of squares over the image smaller."""
    camera = Camera(GRID, DoubleSphere(-0.2, 0.6))
    best = fit_lens(camera, "fisheye").camera
    u, v = np.meshgrid(np.linspace(0, 639, 60), np.linspace(0, 479, 40))
    uv = np.stack([u, v], axis=-1)

    def cost(other):
        return np.sum((other.project(camera.unproject(uv)) - uv) ** 2)

    for k, step in (("k1", 1e-5), ("k2", 1e-5)):
        for sign in (1, -1):
            moved = {name: getattr(best.lens, name) for name in best.lens.parameters()}
            moved[k] += sign * step
            assert cost(Camera(best.intrinsics, KannalaBrandt(**moved))) > cost(best)


def converted(tmp_path, *options):
    camera = Camera(GRID, DoubleSphere(-0.2, 0.6))
    write(Calibration({"cam0": camera}, tmp_path, "made"), tmp_path / "ds.yaml", "kalibr")
    words = ["convert", str(tmp_path / "ds.yaml"), str(tmp_path / "out.yaml"), "--to", "ros", *options]
    return command.main(words), tmp_path / "out.yaml"


def test_convert_fits_and_says_how_far_it_is_off(tmp_path, capsys):
    status, path = converted(tmp_path, "--fit", "fisheye", "--tolerance", "0.5")
    assert status == 0
    assert "cam0: fitted as KannalaBrandt, off by " in capsys.readouterr().out
    (camera,) = camviz_clinic.load(path).cameras.values()
    assert brute(Camera(GRID, DoubleSphere(-0.2, 0.6)), camera).max() < 0.5


def test_convert_refuses_above_the_tolerance(tmp_path, capsys):
    status, path = converted(tmp_path, "--fit", "standard", "--tolerance", "1e-9")
    assert status != 0
    assert not path.exists()
    assert "above the tolerance of 1e-09 px" in capsys.readouterr().err


def test_without_fit_the_lens_is_refused_as_before(tmp_path, capsys):
    status, path = converted(tmp_path)
    assert status != 0
    assert not path.exists()
    assert "has no DoubleSphere lens" in capsys.readouterr().err
