"""The pages for engineers: every finding stands under a symptom, and every report shows what its page says."""

import re
import shlex

import gallery
import numpy as np
import pytest
import symptoms
from house import ROOT

from camviz_clinic.checks import kinds
from camviz_clinic.commands.command import parser
from camviz_school.course.reading import too_long

PAGES = sorted((ROOT / "docs/engineers").glob("*.md"))


def test_the_page_of_symptoms_says_what_the_clinic_says():
    """To renew it: python docs/engineers/symptoms.py"""
    assert symptoms.PAGE.read_text(encoding="utf-8") == symptoms.page()


def test_every_finding_stands_under_a_symptom():
    listed = {id for each in symptoms.symptoms() for id in each["findings"]}
    assert set(kinds()) - listed == set(), "name them in docs/engineers/symptoms.toml"
    assert listed - set(kinds()) == set()


@pytest.mark.parametrize("symptom", symptoms.symptoms(), ids=lambda each: each["title"])
def test_a_symptoms_command_can_be_given_and_its_findings_are_named_once(symptom):
    name, *words = shlex.split(symptom["run"])
    assert name == "camviz"
    assert parser().parse_args(words).run
    assert len(set(symptom["findings"])) == len(symptom["findings"])


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_reads_well(page):
    """No sentence above 35 words, no paragraph above 90, as in the lessons."""
    prose = re.sub(r"^\|.*\|$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert too_long(prose) == []


def test_half_a_pixel_is_six_millimetres_at_one_metre_and_sixty_centimetres_at_ten():
    """As the page of symptoms says; here from the disparities themselves, half a pixel to either side."""
    said = " ".join(symptoms.PAGE.read_text(encoding="utf-8").split())
    assert "With f = 800 px and B = 0.1 m, half a pixel is 6 mm at 1 m and 0.6 m at 10 m." in said
    near, far = ((80 / (80 / Z - 0.5) - 80 / (80 / Z + 0.5)) / 2 for Z in (1, 10))
    assert round(1000 * near) == 6
    assert round(far, 1) == 0.6


def test_right_near_and_wrong_far_is_an_offset_of_disparity_and_a_wrong_f_is_a_factor():
    """Points at 0.5 to 10 m, seen by a true pair and located by one in which cx, the right camera's yaw or f is off."""
    far, factor = (
        next(each for each in symptoms.symptoms() if each["title"].startswith(title))
        for title in ("Depth is right near", "Stereo depth is off by one factor")
    )
    assert "parallel-boards" not in far["findings"]
    assert "parallel-boards" in factor["findings"]
    said = " ".join(far["words"].split())
    assert "Such an offset comes from one camera's cx, or from a camera that has turned about its upright axis" in said
    assert "A wrong focal length or baseline errs by the same share at every distance." in said
    f, base, Z = 800.0, 0.1, np.array([0.5, 10.0])
    rows = -base / Z  # x/z of a point straight ahead of the left camera, in the right one

    def share(cx=0.0, yaw=0.0, scale=1.0):
        """How far the distance is off, as a share, where the calibration is off by these and the pictures are not."""
        right = np.tan(np.arctan((f * rows - cx) / f) - yaw)  # the ray that the pair believes in
        return np.abs(base / -right * scale / Z - 1)

    for offset in (share(cx=0.5), share(yaw=0.5 / f)):
        assert offset[0] < 0.005
        assert offset[1] > 15 * offset[0]
    near, away = share(scale=1.08)
    assert near == pytest.approx(away) == pytest.approx(0.08)


def test_the_gallerys_page_has_every_report():
    """To renew it: python docs/engineers/gallery.py"""
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.page()


@pytest.mark.sampled(3)
@pytest.mark.parametrize("patient", gallery.PATIENTS, ids=lambda each: each.name)
def test_a_report_of_the_gallery_shows_the_finding_that_its_page_names(patient):
    inspection = patient.inspection()
    if patient.finding is None:
        assert inspection.healthy
    else:
        assert patient.finding in {finding.id for finding in inspection.findings}


def test_the_gallery_is_written_with_an_index_that_leads_to_every_report(tmp_path, monkeypatch):
    monkeypatch.setattr(gallery, "PATIENTS", [each for each in gallery.PATIENTS if each.name == "fold"])
    gallery.write(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fold.html", "fold.svg", "index.html"]
    assert 'href="fold.html"' in (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<svg" in (tmp_path / "fold.html").read_text(encoding="utf-8")
    assert "pixels for a degree" in (tmp_path / "fold.svg").read_text(encoding="utf-8")
