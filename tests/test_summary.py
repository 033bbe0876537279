"""A calibration at a glance: the verdict in one line, every number with its deviation, and what to do next."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from html import escape
from pathlib import Path

import numpy as np
import pytest
from calibrations import bare, pair, sick, single

import camviz_clinic
from camviz.lenses import BrownConrady
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.solving import calibrate
from camviz_clinic.checks import inspect
from camviz_clinic.checks.summary import CORNER, GOOD, MIDDLE, RMS, Summary, measured
from camviz_clinic.files.writing import write
from camviz_clinic.report.findings import findings_html, glance_html, verdict_html
from camviz_clinic.report.inspection import report
from camviz_clinic.report.notebook import CAMERA, LOOK, LiveInspection
from camviz_clinic.views.catalogue import VIEWS, Case
from camviz_clinic.views.guidance import GuidanceView
from camviz_clinic.views.uncertainty import UncertaintyView

SKIPPED = (
    "11 could not because the file holds one camera, not a pair, and because no pictures of the board were given "
    "(--images) (4 more reasons below)"
)


@pytest.fixture(scope="module")
def solved():
    """By camviz itself, with one bad corner that it sets aside, and two pictures that it could not use."""
    given = single()
    corners = given.detections["camera"].copy()
    corners[4, 7] += 0.8
    skipped = (("dark.jpg", "no board"), ("small.jpg", "it has another size"))
    names = given.pictures["camera"]
    return calibrate(Detections(names, corners, 640, 480, skipped=skipped), given.board)


def changed(lens=None, **pinhole):
    """The healthy calibration's camera alone, with other numbers."""
    camera = single().cameras["camera"]
    lens = lens or camera.lens
    return replace(
        bare(), cameras={"camera": replace(camera, lens=lens, intrinsics=replace(camera.intrinsics, **pinhole))}
    )


def test_a_healthy_calibration_says_what_it_is_good_for(solved):
    """The boards of `solved` left out the corners of the image; of thirty boards some reach them."""
    said = inspect(solved).verdict
    assert said.startswith(
        "Good to ±0.058° in the 50 % of the image that the boards covered. In the worst corner ±0.8°"
    )
    assert said.endswith(f": add images with the board in the corners. 2 notes below; 31 checks ran, {SKIPPED}.")
    assert inspect(single(30, 0.01)).verdict == (
        "Good to ±0.0028° in the 65 % of the image that the boards covered, ±0.018° in the worst corner. "
        f"No problem found; 31 checks ran, {SKIPPED}."
    )


def test_of_many_reasons_the_verdict_gives_two_and_counts_the_rest():
    inspection = inspect(bare())
    reasons = {why for _, why in inspection.skipped}
    assert inspection.verdict.startswith(
        "No problem found. Its accuracy is not known: the file holds no corner detections. 14 checks ran, 28 could not"
    )
    assert inspection.verdict.endswith(f"({len(reasons) - 2} more reasons below).")


@pytest.mark.parametrize(
    ("calibration", "verdict", "claim"),
    [
        (
            changed(fx=1060.0),
            "Most likely pictures resized by different factors in width and height: "
            "rescale fx and cx by the width's factor, and fy and cy by the height's.",
            "1 warning: camera: fx/fy = 1.992, as if pixels were 49.8 % narrower than high.",
        ),
        (
            changed(BrownConrady(k1=-0.3, k2=-0.5)),
            "Most likely a distortion polynomial that turns back inside the image: "
            "solve again with more views that reach the border, with all of the model's radial terms.",
            "1 fault and 1 consequence: the worst, camera: 28% of the pixels have no ray of their own.",
        ),
        (
            sick(),
            "Most likely a board half hidden or cut off by the border: "
            "detect that picture's corners again, or leave the view out, and solve again.",
            "1 warning, 2 notes and 1 consequence: the worst, camera04.jpg: column 1 of the board is off by 3.87 px, "
            "6 of its 6 corners by more than 1.5 px.",
        ),
    ],
)
def test_a_sick_calibration_says_the_likely_cause_and_what_to_do_and_then_what_shows_it(calibration, verdict, claim):
    inspection = inspect(calibration)
    assert (inspection.verdict, inspection.next_step) == (verdict, "")
    assert inspection.as_text().startswith(f"{verdict}\n\n")
    assert json.loads(inspection.as_json())["verdict"] == verdict
    page = report(inspection)
    assert page.index(escape(verdict)) < page.index(escape(claim)) < page.index('id="findings"')


def test_every_number_has_the_deviation_of_the_covariance(solved):
    rows = Summary.of(solved).table()["camera"]
    deviations = np.sqrt(np.diag(solved.intrinsics_covariance["camera"]))
    assert len(deviations) == 9
    for name, sigma in zip(solved.estimated["camera"], deviations, strict=True):
        value, told = (float(part.replace("−", "-")) for part in rows[name].split(" ± "))
        camera = solved.cameras["camera"]
        true = getattr(camera.intrinsics if hasattr(camera.intrinsics, name) else camera.lens, name)
        assert told == pytest.approx(sigma, rel=0.05), name
        assert abs(value - true) < 0.06 * sigma, name
    assert rows["fx"] == re.search(r"<th[^>]*>fx</th><td[^>]*>([^<]*)<", glance_html(Summary.of(solved)))[1]


def test_a_file_without_corners_has_its_numbers_and_says_what_it_lacks():
    rows = Summary.of(bare()).table()["camera"]
    assert (rows["fx"], rows["k1"]) == ("530", "−0.25")
    assert {rows[key] for key in (RMS, MIDDLE, CORNER)} == {"not in the file"}
    assert "±" not in " ".join(Summary.of(bare()).lines())


def test_the_rms_is_that_of_the_corners_used(solved):
    used = np.isfinite(solved.detections["camera"]).all(axis=-1) & ~solved.set_aside["camera"]
    assert not used[4, 7]
    camera, poses, board = solved.cameras["camera"], solved.cam_from_board["camera"], solved.board
    points = np.einsum("vij,cj->vci", poses.rotation.as_matrix(), board.corners) + poses.translation[:, None]
    off = np.linalg.norm(solved.detections["camera"] - camera.project(points), axis=-1)[used]
    assert solved.rms("camera") == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-9)
    assert Summary.of(solved).table()["camera"][RMS] == f"{np.sqrt(np.mean(off**2)):.3f} px"
    assert Summary.of(replace(solved, per_view_errors={})).rms("camera") == pytest.approx(solved.rms("camera"))


def test_the_uncertainty_at_centre_and_corner_is_that_of_the_map(solved):
    middle, corner = Summary.of(solved).uncertainty["camera"]
    mapped = UncertaintyView.of(solved)
    assert middle == pytest.approx(mapped.numbers()["middle"])
    edges = mapped.values(3, 3)[[0, 0, 2, 2], [0, 2, 0, 2]].max()  # half a pixel further out
    assert 0.97 * edges < corner < edges


def test_pictures_that_were_skipped_count_as_given_and_rejected_ones_as_not_used(solved):
    assert Summary.of(solved).pictures == "10 of 12 pictures used"
    aside = solved.set_aside["camera"].copy()
    aside[2] = True
    assert Summary.of(replace(solved, set_aside={"camera": aside})).pictures == "9 of 12 pictures used"
    assert Summary.of(pair()).pictures == "16 of 16 pictures used"


def test_next_is_where_the_board_takes_most_off_and_nothing_once_the_corners_are_known(solved):
    hold = GuidanceView.of(solved).sentences()[0].removeprefix("H").removesuffix(", as in the picture on the right.")
    assert f": h{hold}. Now, where it is worst, a far point" in inspect(solved).next_step
    sharp = single(30, 0.01)
    assert Summary.of(sharp).largest_errors["camera"] < GOOD
    assert Summary.of(sharp).guidance.startswith(
        "There are enough pictures: where it is worst, a far point is expected"
    )


def test_the_header_names_file_date_camera_and_pictures(solved, tmp_path):
    path = tmp_path / "mine.yaml"
    write(solved, path, "opencv")
    os.utime(path, (1_700_000_000, 1_700_000_000))
    page = report(inspect(camviz_clinic.load(path)))
    header = page[: page.index('id="findings"')]
    assert re.search(r"mine\.yaml · written 2023-11-1[45] \d\d:\d\d · OpenCV FileStorage · one camera, 640 × 480 px · "
                     r"10 of 12 pictures used", header)  # fmt: skip


def test_the_note_on_corners_set_aside_is_in_the_report_and_in_the_notebook(solved):
    (note,) = solved.notes
    assert re.match(r"\d of 540 corners lie more than .* and were set aside: ", note)
    assert note in report(inspect(solved))
    assert note in verdict_html(inspect(solved))


def test_a_finding_names_its_camera_once():
    bent = pair()
    left = replace(bent.cameras["left"], lens=BrownConrady(k1=-0.3, k2=-0.5))
    inspection = inspect(replace(bent, cameras={**bent.cameras, "left": left}))
    words = re.sub("<[^>]*>", "", findings_html(inspection))
    assert "fold: left: " in words
    assert "left: left" not in words


@pytest.mark.thorough
def test_no_view_has_a_control_called_as_a_chooser_above_it():
    live = LiveInspection(inspect(pair()))
    assert {live._view.description, live._camera.description} == {LOOK, CAMERA}
    case = Case(pair())
    for entry in VIEWS.values():
        assert {LOOK, CAMERA}.isdisjoint(control.label for control in entry.view(case).offered().values()), entry.name


def test_numbers_are_told_to_the_second_digit_of_their_deviation():
    assert measured(-0.29474, 0.0055) == "−0.2947 ± 0.0055"
    assert measured(1234.5, 12.3) == "1234 ± 12"
    assert measured(0.1, 0.0) == "0.1 ± 0"


def test_the_pictures_of_a_pair_in_two_folders_are_each_cameras_own(tmp_path):
    import cv2

    names = dict.fromkeys(("left", "right"), ("1.png",) * 8)
    for i, name in enumerate(names):
        (tmp_path / name).mkdir()
        cv2.imwrite(str(tmp_path / name / "1.png"), np.full((480, 640), 60 + 120 * i, np.uint8))
    case = Case(replace(pair(), pictures=names), images={name: tmp_path / name for name in names})
    assert [int(case.photographs(name)(0).mean()) for name in names] == [60, 180]


BARE = """
import sys
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
shell.run_cell("import camviz_clinic; c = camviz_clinic.load({path!r})")
print("camviz_clinic.report" in sys.modules)
data, _ = shell.display_formatter.format(shell.user_ns["c"])
print(sorted(data), data["text/html"].count("<table"), data["text/html"].count("<img"))
print(data["text/plain"])
"""


def test_a_bare_calibration_shows_a_table_and_a_picture_in_a_notebook(solved, tmp_path):
    path = tmp_path / "mine.yaml"
    write(solved, path, "opencv")
    code, home = BARE.format(path=str(path)), {**os.environ, "IPYTHONDIR": str(tmp_path)}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=home,
                          cwd=Path(__file__).parents[1])  # fmt: skip
    assert done.returncode == 0, done.stderr
    early, forms, *lines = done.stdout.strip().splitlines()
    assert early == "False"  # nothing is drawn, or loaded, before it is wanted
    assert forms == "['text/html', 'text/plain'] 1 2"  # a table, and a picture of two tiles
    assert lines[0].startswith("mine.yaml · written 20")
    assert lines[1].startswith("camera: fx = ")
    assert len(lines) <= 5
    assert "Calibration(" not in done.stdout
