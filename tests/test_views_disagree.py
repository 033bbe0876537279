"""When views are said to disagree: where their ± is twice that of the corners' noise, and not by chance."""

from dataclasses import replace

import numpy as np
import pytest

from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.checks import Inspection, faults, inspect, kinds
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings.scatter import FEWEST_VIEWS, Disagreement
from camviz_clinic.checks.observed import Observed
from camviz_clinic.checks.virtual import healthy, single


@pytest.mark.parametrize(
    ("ratio", "chance", "said"),
    [(2.0, 0.0, False), (2.001, 0.0, True), (3.0, 1e-6, False), (3.0, 0.99e-6, True)],
)
def test_it_is_said_beyond_both_limits(ratio, chance, said) -> None:
    assert Disagreement(ratio, chance).certain == said


def test_the_ratio_is_that_of_the_printed_deviations() -> None:
    """The median over the intrinsics of σ in the file over σ by the noise of corners."""
    calibration = faults()["loose board"].inject(np.random.default_rng(1), 1.0).calibration
    (found,) = [each for each in inspect(calibration).findings if each.id == "views-disagree"]
    printed = np.sqrt(np.diag(calibration.intrinsics_covariance["camera"]))
    plain = np.sqrt(np.diag(Adjustment.of(calibration).corner_covariance))
    assert found.value == pytest.approx(np.median(printed / plain), rel=0.05)
    assert found.unit == "times"


def test_healthy_sets_are_far_from_it(thorough) -> None:
    """Of healthy cameras none has a ratio of 1.8, nor a chance below one in a thousand."""
    for seed in range(20_200, 20_300 if thorough else 20_206):
        found = Disagreement.of(Observed("camera", Adjustment.of(healthy(np.random.default_rng(seed)))))
        assert found.ratio < 1.8
        assert found.chance > 1e-3


def test_the_chance_is_that_of_an_f_test_over_views() -> None:
    """Corners of one noise, however strong, give the same chance; a bend of every view's own takes it away."""
    rng = np.random.default_rng(2)
    set_up = single(rng, views=10)
    noise = rng.normal(size=set_up.corners[0].shape)

    def chance(corners) -> float:
        return Disagreement.of(Observed("camera", Adjustment.of(set_up.solved((corners,), robust=False)))).chance

    quiet, loud = (chance(set_up.corners[0] + sigma * noise) for sigma in (0.05, 0.2))
    assert quiet == pytest.approx(loud, abs=0.05)
    assert quiet > 1e-3
    corners = set_up.corners[0] + 0.05 * noise
    faults()["loose board"].make(rng, corners, (set_up.board.rows, set_up.board.columns), 0.5)
    assert chance(corners) < 1e-9


def test_of_four_views_nothing_is_said() -> None:
    """The ratio is then uncertain by more than it says; from five views on the check is made."""
    rng = np.random.default_rng(3)
    set_up = single(rng, views=FEWEST_VIEWS)
    calibration = set_up.solved(set_up.observed(rng))
    check = kinds()["views-disagree"].check
    assert list(check(Evidence(calibration))) == []
    corners = {"camera": calibration.detections["camera"].copy()}
    corners["camera"][0] = np.nan
    with pytest.raises(NotChecked, match="5 views"):
        list(check(Evidence(replace(calibration, detections=corners))))


def test_a_bent_board_is_the_cause_of_it() -> None:
    """What explains the disagreement stands above it, and it is no alarm of its own."""
    evidence = faults()["warped board"].inject(np.random.default_rng(20_003), 2)
    findings = {each.id: each for each in Inspection.of(evidence).findings}
    assert findings["views-disagree"].consequence_of == "board-warp"
    assert findings["views-disagree"].severity == "note"
