"""Whether new pictures were taken as those of the calibration were: with the same camera, lens, focus and zoom."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.stamps import contradictions
from camviz_clinic.checks.virtual import alone, healthy


@finding(
    "other-settings",
    severity="warning",
    view="numbers",
    symptom="The pictures were taken with another camera, lens, focal length, focus or digital zoom.",
    causes=("a zoom or focus ring that was moved", "autofocus", "pictures of another camera"),
    remedy="Calibrate again with the settings of these pictures, or take the pictures with those of the calibration.",
    threshold="Names differ, or a focal length or digital zoom by more than 0.5 %, or a focus distance by more than "
    "10 %. A focus that a thin lens would answer with less than 0.2 % of f is a note.",
    explains=WRONG_NUMBERS,
)
def other_settings(evidence: Evidence) -> Iterator[Finding]:
    """The check compares the pictures' EXIF with the calibration's stamp."""
    calibration = evidence.calibration
    if len(calibration.cameras) > 1:
        raise NotChecked("the file holds several cameras, and pictures do not say which of them took them")
    ((name, _),) = calibration.cameras.items()
    stamp = calibration.stamps.get(name, Stamp())
    if not _says(stamp):
        raise NotChecked("the file does not say with what camera, lens, focus and zoom its pictures were taken")
    if evidence.taken is None or not _says(evidence.taken):
        raise NotChecked("no new pictures with EXIF were given")
    for each in contradictions(stamp, evidence.taken):
        severity = "note" if each.harmless else other_settings.severity
        sentence = f"{name}: the pictures contradict the calibration: {each.sentence}."
        yield other_settings.found(sentence, each.value, each.unit, name, severity=severity)


def _says(stamp: Stamp) -> bool:
    return any((stamp.cameras, stamp.lenses, stamp.focal_lengths, stamp.focus_distances, stamp.digital_zooms))


@other_settings.fault("moved zoom", "times", (1.002, 1.05, 1.5), promised=1.05)
def zoomed(rng: Rng, strength: float) -> Evidence:
    """The new pictures have another focal length in their EXIF."""
    calibration = replace(alone(healthy(rng)), stamps={"camera": Stamp(focal_lengths=(35.0,))})
    return Evidence(calibration, taken=Stamp(focal_lengths=(35.0 * strength,)))
