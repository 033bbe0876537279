"""The prior on a rational lens's denominator: no pole in the image, nothing lost where the lens has a denominator."""

from dataclasses import replace

import numpy as np
import pytest
from boards import BOARD, CAMERA, board_poses, noisy, truth

import camviz
import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.distortion.limits import NEARLY_A_POLE, image_reach, weakest_denominator
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import calibrate, calibrate_pair, detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.cross_validation import held_out
from camviz_clinic.calibration.denominator_prior import DenominatorPrior
from camviz_clinic.calibration.difference import difference
from camviz_clinic.calibration.regularisation import regularised, with_priors
from camviz_clinic.checks import kinds
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.virtual import SetUp, detections, spread_boards
from camviz_clinic.files.writing import write
from camviz_school.samples import SampleUnavailable, sample

RATIONAL = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
LENSES = {  # as in wide cameras: a denominator that falls to 0.37 in the image, and one that rises to 3
    "falling": Camera(
        Intrinsics(1280, 720, 610, 611, 643, 356), BrownConrady(0.45, -2.5, 0, 0, 1.45, 0.33, -2.33, 1.38)
    ),
    "rising": Camera(Intrinsics(1280, 960, 641, 642, 643, 476), BrownConrady(0.3, 0.05, 0, 0, 0.02, 0.5, 0.2, 0.03)),
}


def least_denominator(camera):
    """By brute force, over the rays of every pixel that has one, and out to where an undistorted picture asks."""
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(camera.intrinsics.grid())).reshape(-1, 3)
    rays = rays[np.isfinite(rays).all(axis=1)]
    s = np.concatenate([np.sum(rays[:, :2] ** 2, axis=1) / rays[:, 2] ** 2, [image_reach(camera) ** 2]])
    lens = camera.lens
    return float(np.min(1 + s * (lens.k4 + s * (lens.k5 + s * lens.k6))))


def observed(camera, seed, noise=0.15):
    rng = np.random.default_rng(seed)
    set_up = SetUp((camera,), BOARD, spread_boards(rng, (camera,), BOARD, 14, (15, 40)), noise)
    return set_up, detections(camera, set_up.observed(rng)[0])


@pytest.fixture(scope="module", params=["left", "right"])
def photographed(request):
    try:
        paths = [sample(f"{request.param}{i:02d}.jpg") for i in range(1, 15) if i != 10]
    except SampleUnavailable as reason:
        pytest.skip(str(reason))
    found = detect(paths, BOARD, workers=1)
    return {model: calibrate(found, BOARD, model) for model in ("standard", "rational")}


@pytest.mark.thorough
def test_on_the_samples_the_denominator_stays_above_a_fifth_over_the_whole_image(photographed):
    camera = photographed["rational"].cameras["camera"]
    assert least_denominator(camera) > NEARLY_A_POLE == 0.2
    assert list(kinds()["near-pole"].check(Evidence(photographed["rational"]))) == []


@pytest.mark.thorough
def test_on_the_samples_what_was_held_out_is_predicted_no_worse_than_by_the_standard_model(photographed):
    """The denominator of left*.jpg earns its place. That of right*.jpg does not: its solution is the standard one."""
    standard, rational = (held_out(Adjustment.of(photographed[m]), folds=4).rms for m in ("standard", "rational"))
    assert rational < standard * (1 + 1e-9)  # two solutions of one problem differ by 1e-10


@pytest.mark.sampled(1)
@pytest.mark.parametrize("seed", range(3))
def test_a_lens_without_a_denominator_gets_none(seed):
    _, found = observed(CAMERA, seed)
    camera = calibrate(found, BOARD, "rational").cameras["camera"]
    assert least_denominator(camera) > 0.5
    standard = calibrate(found, BOARD).cameras["camera"]
    off = {name: np.nanmax(difference(CAMERA, one).length) for name, one in (("ours", camera), ("standard", standard))}
    assert off["ours"] < 2 * off["standard"] + 0.1


@pytest.mark.thorough
@pytest.mark.parametrize("name", LENSES)
def test_a_lens_with_a_denominator_comes_out_no_worse_than_without_the_prior(name):
    errors = {"free": [], "prior": []}
    for seed in range(3):
        _, found = observed(LENSES[name], seed)
        solved = calibrate(found, BOARD, "rational")
        free = replace(Adjustment.of(solved), priors={}).refined().cameras["camera"]
        for how, camera in (("free", free), ("prior", solved.cameras["camera"])):
            errors[how].append(np.sqrt(np.nanmean(difference(LENSES[name], camera).length ** 2)))
    assert np.median(errors["prior"]) < 1.1 * np.median(errors["free"])


def test_the_rows_are_the_slopes_of_the_cost():
    prior, lens = DenominatorPrior(0.9, 0.7, 0.2), BrownConrady(k4=-0.3, k5=0.4, k6=-0.2)
    rows, residuals = prior.rows(lens, RATIONAL)
    assert prior.cost(lens) == pytest.approx(np.sum(residuals**2))
    for name, column in zip(RATIONAL, rows.T, strict=True):
        if hasattr(lens, name):
            ahead, behind = (replace(lens, **{name: getattr(lens, name) + step}) for step in (1e-6, -1e-6))
            assert (prior.cost(ahead) - prior.cost(behind)) / 2e-6 == pytest.approx(-2 * column @ residuals, abs=1e-7)
        else:
            assert not column.any()
    assert prior.cost(BrownConrady(k4=-1.5)) == np.inf


@pytest.mark.thorough
def test_sigma_and_the_covariance_count_the_prior_as_bayes_does():
    """Lenses drawn from the prior: errors of k4, k5, k6 have the covariance that is said, and σ is not biased."""
    rng = np.random.default_rng(5)
    reach, deviation, noise, scaled, sigmas = image_reach(CAMERA), 0.05, 0.1, [], []
    prior = DenominatorPrior(reach, deviation, noise)
    slopes, _ = prior.rows(BrownConrady(), ("k4", "k5", "k6"))
    drawn_by = np.linalg.cholesky(noise**2 * np.linalg.inv(slopes.T @ slopes))
    for _ in range(30):
        terms = drawn_by @ rng.normal(size=3)
        lens = replace(CAMERA.lens, **dict(zip(("k4", "k5", "k6"), terms.tolist(), strict=True)))
        camera = replace(CAMERA, lens=lens)
        exact = truth(board_poses(rng, 6, camera=camera), {"camera": camera}, estimated=RATIONAL)
        solved = replace(noisy(exact, rng, noise), priors={"camera": prior}).refined()
        error = (solved.intrinsics("camera") - exact.intrinsics("camera"))[-3:]
        covariance = (noise / solved.sigma) ** 2 * solved.intrinsics_covariance("camera")[-3:, -3:]
        scaled.append(error @ np.linalg.solve(covariance, error))
        sigmas.append(solved.sigma**2)
        assert 0 < solved.held_by_priors["camera"] < 3
    assert np.mean(scaled) == pytest.approx(3, rel=0.45)  # χ² of three degrees, 30 times: 3 ± 0.45
    assert np.mean(sigmas) == pytest.approx(noise**2, rel=0.03)


def test_a_prior_is_written_and_read_and_is_at_work_when_a_file_is_looked_at(tmp_path):
    _, found = observed(CAMERA, 1)
    solved = calibrate(found, BOARD, "rational")
    write(solved, tmp_path / "camera.yml", "opencv")
    back = camviz_clinic.load(tmp_path / "camera.yml")
    assert back.priors == solved.priors
    again = Adjustment.of(back).refined().cameras["camera"]
    assert np.nanmax(difference(again, solved.cameras["camera"]).length) < 1e-3
    left_out = write(solved, tmp_path / "camera.yaml", "ros")
    assert "the prior on the denominator" in " ".join(left_out)
    (tmp_path / "camera.yml").write_text(
        (tmp_path / "camera.yml").read_text().replace(repr(solved.priors["camera"].reach)[:6], "-1.000")
    )
    with pytest.raises(camviz_clinic.files.CalibrationError, match="three positive numbers"):
        camviz_clinic.load(tmp_path / "camera.yml")


@pytest.mark.thorough
def test_a_pair_has_a_prior_for_each_camera():
    left = LENSES["falling"]
    rng = np.random.default_rng(2)
    right = left.at(camviz.poses.RigidTransform.from_translation([0.06, 0, 0]))
    set_up = SetUp((left, right), BOARD, spread_boards(rng, (left, right), BOARD, 10, (15, 40)), 0.15)
    found = [detections(camera, uv) for camera, uv in zip(set_up.cameras, set_up.observed(rng), strict=True)]
    solved = calibrate_pair(*found, BOARD, "rational")
    assert set(solved.priors) == {"left", "right"}
    for camera in solved.cameras.values():
        assert weakest_denominator(camera.lens, image_reach(camera))[1] > NEARLY_A_POLE


def test_without_a_free_denominator_nothing_is_assumed():
    _, found = observed(CAMERA, 3)
    solved = calibrate(found, BOARD, "rational", fixed=("k4", "k5", "k6"))
    assert Adjustment.of(solved).at_work == {}
    standard = calibrate(found, BOARD).cameras["camera"]
    assert np.nanmax(difference(standard, solved.cameras["camera"]).length) < 1e-3


def test_corners_without_noise_give_the_lens_itself():
    camera = LENSES["rising"]
    rng = np.random.default_rng(1)
    exact = truth(spread_boards(rng, (camera,), BOARD, 8, (15, 40)), {"camera": camera}, estimated=RATIONAL)
    there = regularised(with_priors(exact)).cameras["camera"]
    assert np.nanmax(difference(camera, there).length) < 1e-3


def test_what_a_prior_cannot_be_is_refused():
    with pytest.raises(ValueError, match="deviation must be positive and finite, got 0"):
        DenominatorPrior(1.0, 0)
