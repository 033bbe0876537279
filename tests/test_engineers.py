"""The pages for engineers: every finding stands under a symptom, and every report shows what its page says."""

import re
import shlex

import gallery
import pytest
import symptoms
from house import ROOT

from camviz.clinic import kinds
from camviz.commands.command import parser
from camviz.course.reading import too_long

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


def test_the_gallerys_page_has_every_report():
    """To renew it: python docs/engineers/gallery.py"""
    assert gallery.PAGE.read_text(encoding="utf-8") == gallery.page()


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
    assert sorted(path.name for path in tmp_path.iterdir()) == ["fold.html", "index.html"]
    assert 'href="fold.html"' in (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "<svg" in (tmp_path / "fold.html").read_text(encoding="utf-8")
