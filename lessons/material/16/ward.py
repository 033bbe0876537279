"""The ward: sick calibrations to diagnose. Cameras, boards, noise, faults and their order come from one number."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks import Inspection, faults, kinds
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.virtual import healthy
from camviz_school.course.checks import Verdict

if TYPE_CHECKING:
    from camviz_school.views.fault_lab import FaultLabView

HEALTHY = "healthy"


COMPLAINTS = (  # the faults that bring patients, each as strong as is beyond doubt
    "blurred view",
    "column off",
    "parallel boards",
    "warped board",
    "autofocus drift",
    "moved centre",
    "folding polynomial",
    "resized K",
    "crop",
    "boards in the middle",
)
STORIES = (  # any patient may come with any of them: what owners say does not tell what is wrong
    "It worked last year. I changed nothing.",
    "I followed the tutorial to the letter.",
    "The error of the fit is what it always is.",
    "My colleague says that it is fine.",
    "The robot drifts to the left, and I suspect the camera.",
    "Nothing is wrong, I think. I only want to be sure.",
    "The distances that I measure are wrong by a few percent, or so I believe.",
    "It came with the camera.",
    "I calibrated three times and got three answers. Which one is this?",
    "The pictures look odd once they are undistorted. Or is that me?",
    "I took the pictures in a hurry.",
)


class Ward:
    """Patients 1, 2, … of a ward. `ward[3]` shows one, `ward.diagnose(3, "fold")` answers a diagnosis in words.

    The same `number` is the same ward; another number has other cameras with other faults in another order, and one
    patient in every ward is healthy.
    """

    def __init__(self, number: int, patients: int = 8) -> None:
        if not 2 <= patients <= len(COMPLAINTS) + 1:
            raise ValueError(f"patients must be 2 to {len(COMPLAINTS) + 1}, got {patients}")
        self.number = number
        chosen: list[str | None] = [*np.random.default_rng(number).permutation(np.array(COMPLAINTS, object))]
        chosen = [*chosen[: patients - 1], None]
        order = np.random.default_rng([number, 1]).permutation(patients)
        self._complaints = [chosen[i] for i in order]
        self._stories = [STORIES[i] for i in np.random.default_rng([number, 3]).permutation(len(STORIES))]
        self._patients: dict[int, Patient] = {}
        self._tries: dict[int, int] = {}

    def __len__(self) -> int:
        return len(self._complaints)

    def __getitem__(self, patient: int) -> Patient:
        """The patient of that number, from 1."""
        if not isinstance(patient, int) or not 1 <= patient <= len(self):
            raise ValueError(f"patient must be a number from 1 to {len(self)}, got {patient!r}")
        if patient not in self._patients:
            self._patients[patient] = _admitted(
                self.number, patient, self._complaints[patient - 1], self._stories[patient - 1]
            )
        return self._patients[patient]

    def diagnose(self, patient: int, finding: str = "") -> Verdict:
        """What is to be said about a diagnosis: the id of a finding, or "healthy". Never raises for a wrong one."""
        verdict = reply(self[patient], finding, self._tries.get(patient, 0) + 1)
        if verdict.status == "wrong":
            self._tries[patient] = self._tries.get(patient, 0) + 1
        return verdict


@dataclass(frozen=True, eq=False)
class Patient:
    """One calibration with its owner's story, shown with every view of the clinic and none of its findings."""

    name: str
    story: str
    evidence: Evidence
    finding: str

    @property
    def calibration(self) -> Calibration:
        return self.evidence.calibration

    def inspected(self) -> Inspection:
        """What the clinic says."""
        return Inspection.of(self.evidence)

    def _ipython_display_(self) -> None:
        from camviz_clinic.report.notebook import LiveInspection

        words = f"<p><b>{escape(self.name)}.</b> “{escape(self.story)}”</p>"
        shown = replace(self.calibration, pictures={})  # nobody took any: none can be named or missed
        live = LiveInspection(Inspection(shown, (), ()))
        if not self.calibration.detections:
            live.show("numbers")
        live.display({"text/html": words, "text/plain": f"{self.name}. “{self.story}”"})


def anna_and_ben() -> tuple[FaultLabView, FaultLabView]:
    """Two calibrations of one camera: Anna's from sharp corners of boards held parallel, Ben's from tilted ones."""
    from camviz_school.views.fault_lab import FaultLabView

    anna = FaultLabView(fault="parallel boards", strength=1.0, noise=0.14, seed=5, told=False)
    return anna, anna.but(strength=0.0, noise=0.39)


def _admitted(ward: int, patient: int, complaint: str | None, story: str) -> Patient:
    rng = np.random.default_rng([ward, 2, patient])
    name = f"Patient {patient}"
    if complaint is None:
        return Patient(name, story, Evidence(healthy(rng)), HEALTHY)
    fault = faults()[complaint]
    assert fault.beyond_doubt is not None
    strength = float(rng.uniform(*fault.beyond_doubt))
    return Patient(name, story, fault.inject(rng, strength), fault.finding)


def reply(patient: Patient, answer: Any, attempt: int) -> Verdict:
    """Correct; not answered; or what the answer would look like, and where to look for what it is."""
    known = [*kinds(), HEALTHY]
    if answer in ("", None, Ellipsis):
        return Verdict(patient.name, "unsolved", f"{patient.name}: no diagnosis yet.")
    hint = _hint(patient.finding, attempt)
    if answer not in known:
        return Verdict(patient.name, "wrong", f"`{answer}` is no finding. There are {', '.join(known)}.", hint)
    if answer == patient.finding:
        return Verdict(patient.name, "correct", _confirmed(patient))
    if answer == HEALTHY:
        return Verdict(patient.name, "wrong", f"{patient.name} is not well, however good the fit.", hint)
    kind = kinds()[answer]
    if patient.finding == HEALTHY:
        said = f"`{answer}` looks like this: {kind.symptom} Look for it: it is not there."
        return Verdict(patient.name, "wrong", said, "How large would it have to be, to be more than noise?")
    if answer in {finding.id for finding in patient.inspected().findings}:
        said = f"The clinic names `{answer}` too, but as what follows from something else. What would cause it?"
        return Verdict(patient.name, "wrong", said, hint)
    said = (
        f"`{answer}` looks like this: {kind.symptom} {kind.evidence} Here it is not so, or another fault makes it so."
    )
    return Verdict(patient.name, "wrong", said, hint)


def _hint(finding: str, attempt: int) -> str:
    if finding == HEALTHY:
        return "Go through the views one by one. What do you see that noise would not do?"
    from camviz_clinic.views.catalogue import title_of

    kind = kinds()[finding]
    if attempt == 1:
        return f"Look at the view {title_of(kind.view)!r} (`{kind.view}`)."
    return f"There you see this: {kind.symptom}"


def _confirmed(patient: Patient) -> str:
    found: Mapping[str, str] = {finding.id: finding.sentence for finding in patient.inspected().findings}
    if patient.finding == HEALTHY:
        return f"{patient.name} is well: {len(patient.inspected().checked)} checks, nothing found."
    return f"`{patient.finding}`. {found.get(patient.finding, '')} *Remedy:* {kinds()[patient.finding].remedy}"
