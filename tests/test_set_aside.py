"""Corners that a solution set aside are told of once, and a line is its neighbour's only where it lies there."""

import numpy as np
import pytest

from camviz_clinic.checks import faults, inspect, kinds
from camviz_clinic.checks.causes import by_causes
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.corners import NEIGHBOUR
from camviz_clinic.checks.findings.set_aside import pattern, points_one_way
from camviz_clinic.checks.virtual import single

SEED = 20_003


@pytest.fixture(scope="module")
def virtual():
    """A virtual camera and its corners with noise."""
    rng = np.random.default_rng(SEED)
    set_up = single(rng, views=12)
    return set_up, set_up.observed(rng)[0]


def solved(virtual, spoil, **how):
    """The calibration of the corners after something was done to the views (views, rows, columns, 2)."""
    set_up, corners = virtual
    spoilt = corners.copy()
    spoil(spoilt.reshape(len(corners), set_up.board.rows, set_up.board.columns, 2))
    return set_up, set_up.solved((spoilt,), fixed=("k3",), **how)


def found(calibration):
    """The findings about corners, by the three checks alone."""
    evidence = Evidence(calibration)
    about = ("outlier-line", "outlier-view", "corners-set-aside")
    return by_causes([each for id in about for each in kinds()[id].check(evidence)], kinds())


def told(calibration):
    """The same as (id, severity, pictures)."""
    return [(each.id, each.severity, each.pictures) for each in found(calibration)]


def test_a_column_that_was_set_aside_is_one_note_and_no_warning(virtual):
    """Before, it was an outlier-line and an outlier-view as well, though no corner of it had a say."""

    def spoil(views):
        views[4, :, 0] += [6.0, 2.0]

    set_up, calibration = solved(virtual, spoil)
    assert calibration.set_aside["camera"][4].sum() == set_up.board.rows
    assert told(calibration) == [("corners-set-aside", "note", (4,))]
    inspection = inspect(calibration)
    assert inspection.healthy
    (note,) = inspection.findings
    rows, count = set_up.board.rows, set_up.board.rows * set_up.board.columns
    assert note.sentence.startswith(
        f"view05.png: {rows} of {count} corners are set aside, all in column 1, all to one side; the farthest is "
    )
    assert note.value == rows
    lengths = np.linalg.norm([6.0, 2.0]), float(note.sentence.split("farthest is ")[1].split(" px")[0])
    assert lengths[1] == pytest.approx(lengths[0], rel=0.15)


def test_the_same_column_is_a_warning_where_it_was_used(virtual):
    def spoil(views):
        views[4, :, 0] += [6.0, 2.0]

    _, calibration = solved(virtual, spoil, robust=False)
    assert told(calibration)[0] == ("outlier-line", "warning", (4,))
    assert "corners-set-aside" not in {each[0] for each in told(calibration)}


def test_above_a_twentieth_of_all_corners_it_is_a_warning_with_the_share(virtual):
    """One whole view of twelve is 8.3 % of the corners; half of its corners are 4.2 %."""

    def scatter(part):
        def spoil(views):
            noise = np.random.default_rng(1).normal(0, 8, views[3].shape)
            views[3, :, :part] += noise[:, :part]

        return spoil

    set_up, calibration = solved(virtual, scatter(None))
    assert told(calibration) == [("corners-set-aside", "warning", ()), ("corners-set-aside", "note", (3,))]
    warning, note = found(calibration)
    corners = set_up.board.rows * set_up.board.columns
    assert warning.value == pytest.approx(100 / 12)
    assert f"8.3% of all corners ({corners} of {12 * corners}) are set aside, in 1 of 12 views" in warning.sentence
    assert f"{corners} of {corners} corners are set aside, the whole view; the farthest is" in note.sentence
    _, milder = solved(virtual, scatter(set_up.board.columns // 3))
    assert {severity for _, severity, _ in told(milder)} == {"note"}


def test_the_pattern_needs_half_of_the_corners_and_half_of_a_line():
    seen = np.ones((6, 9), bool)
    aside = np.zeros((6, 9), bool)
    aside[2, 3] = True
    assert pattern(aside, seen) == "in row 3 and column 4"
    aside[4, 4] = aside[0, 8] = aside[5, 0] = True
    assert pattern(aside, seen) == "scattered over the board"
    aside[:] = False
    aside[5, :4] = True  # less than half of a row of nine
    assert pattern(aside, seen) == "scattered over the board"
    aside[5, :5] = True
    assert pattern(aside, seen) == "all in row 6"
    seen[5, 5:] = False
    aside[5, 4] = False  # four of the five that were seen
    assert pattern(aside, seen) == "all in row 6"
    assert pattern(seen, seen) == "the whole view"


def test_one_way_is_where_all_point_to_much_the_same_side():
    assert points_one_way(np.array([[1, 0.1], [2, -0.1], [0.5, 0.0]]))
    assert not points_one_way(np.array([[1, 0.1], [-2, -0.1], [0.5, 0.0]]))
    assert not points_one_way(np.array([[1, 0.1], [2, -0.1]]))


@pytest.mark.parametrize(("squares", "neighbour"), [(0.1, False), (0.3, False), (1.0, True)])
def test_a_line_was_taken_for_its_neighbour_only_where_it_is_about_a_square_off(squares, neighbour):
    spoilt = faults()["column off"].inject(np.random.default_rng(SEED), squares).calibration
    line = next(each for each in found(spoilt) if each.id == "outlier-line")
    assert (NEIGHBOUR in line.causes) == neighbour
    width = float(line.sentence.split("A square is ")[1].split(" px")[0])
    assert line.value == pytest.approx(squares * width, rel=0.4)
