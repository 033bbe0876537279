"""What a calibration is worth to its task: angles, millimetres, depths, and when there are enough pictures."""

import json
import math

import numpy as np
import pytest
from calibrations import bare, pair, single

from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.uncertainty import (
    expected_length,
    largest_expected_error,
    projection_covariance,
    projection_uncertainty,
)
from camviz_clinic.checks import inspect
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.summary import Summary
from camviz_clinic.checks.task import DEPTHS, MATCHING_PX, direction_deviation, task_errors
from camviz_clinic.commands.command import main
from camviz_clinic.files.writing import write

PIXELS = np.array([(319.5, 239.5), (0.0, 0.0), (600.0, 60.0)])


@pytest.fixture(scope="module")
def adjustment():
    return Adjustment.of(single())


@pytest.mark.parametrize("distance", [math.inf, 2.0, 0.5])
def test_a_direction_is_as_uncertain_as_rays_of_pixels_that_err_so(adjustment, distance):
    """Against rays of randomly moved pixels, small so that the lens does not bend them."""
    camera, small = adjustment.cameras["camera"], 1e-4
    stated = direction_deviation(adjustment, PIXELS, distance)
    covariances = projection_covariance(adjustment, PIXELS, distance)
    rng = np.random.default_rng(4)
    for uv, covariance, deviation in zip(PIXELS, covariances, stated, strict=True):
        moved = uv + small * rng.multivariate_normal((0, 0), covariance, 20_000)
        rays = camera.lens.unproject(camera.intrinsics.from_pixels(moved))
        spread = np.linalg.eigvalsh(np.cov(rays.T))[-1] ** 0.5 / small
        assert deviation == pytest.approx(spread, rel=0.02)


def test_in_the_middle_of_the_picture_a_pixel_is_an_angle_of_one_over_f(adjustment):
    k = adjustment.cameras["camera"].intrinsics
    middle = [k.cx, k.cy]
    expected = projection_uncertainty(adjustment, middle) / k.fx
    assert direction_deviation(adjustment, middle) == pytest.approx(expected, rel=0.01)


def test_the_expected_length_is_the_mean_of_random_errors():
    rng = np.random.default_rng(1)
    for covariance in (np.diag([4.0, 0.3]), np.array([[2.0, 0.9], [0.9, 1.0]])):
        drawn = rng.multivariate_normal((0, 0), covariance, 400_000)
        assert expected_length(covariance) == pytest.approx(np.linalg.norm(drawn, axis=1).mean(), rel=5e-3)


def test_the_largest_expected_error_is_in_a_corner_and_falls_with_more_pictures():
    few, many = (Adjustment.of(single(views)) for views in (6, 24))
    k = few.cameras["camera"].intrinsics
    corners = [(0, 0), (k.width - 1, 0), (0, k.height - 1), (k.width - 1, k.height - 1)]
    in_corners = expected_length(projection_covariance(few, corners)).max()
    assert largest_expected_error(few) == pytest.approx(in_corners)
    assert largest_expected_error(many) < 0.7 * largest_expected_error(few)


def test_one_camera_and_a_pair_say_what_they_are_worth():
    camera, *_ = task_errors(Evidence(single()), at=2.0)
    assert camera.cameras == ("camera",)
    assert camera.values["at_m"] == 2
    assert f"±{camera.values['angle_centre_deg']:.2g}° at the centre" in camera.sentence
    assert "; at 2 m that is ±" in camera.sentence
    *_, both = task_errors(Evidence(pair()))
    assert both.cameras == ("left", "right")
    rig = pair().cameras
    baseline, f = np.linalg.norm(rig["right"].centre), rig["left"].intrinsics.fx
    for z in DEPTHS:
        total, own = both.values[f"depth_{z:g}m_mm"], both.values[f"calibration_{z:g}m_mm"]
        matching = 1000 * z**2 * MATCHING_PX / (f * baseline)  # of a rectified pair
        assert math.sqrt(total**2 - own**2) == pytest.approx(matching, rel=0.1)


def test_without_corners_nothing_is_said_of_the_task():
    assert task_errors(Evidence(bare()), at=1.0) == ()
    assert inspect(bare()).as_tree()["task"] == []


def test_the_goal_decides_whether_one_more_picture_is_asked_for():
    largest = Summary.of(single()).largest_errors["camera"]
    enough = Summary.of(single(), goal=1.01 * largest).guidance
    assert enough.startswith("There are enough pictures: where it is worst, a far point is expected to be ")
    assert Summary.of(single(), goal=0.99 * largest).guidance.startswith("Take one picture more: hold the board ")


def test_inspect_tells_the_error_at_a_distance_in_text_and_json(tmp_path, capsys):
    path = tmp_path / "camera.yaml"
    write(single(), path, "opencv")
    main(["inspect", str(path), "--at", "2m"])
    assert "; at 2 m that is ±" in capsys.readouterr().out
    main(["inspect", str(path), "--at", "2", "--json"])
    values = json.loads(capsys.readouterr().out)["task"][0]["values"]
    assert values["centre_mm"] > 0
    assert main(["inspect", str(path), "--at", "far"]) == 2
    assert "expected a distance in metres, from 0.01 to 10000, got 'far'" in capsys.readouterr().err
