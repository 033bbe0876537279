"""`inspect`: what is wrong with a calibration, in words, with the number that shows it, and what to do."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Self

from camviz.cameras import Camera
from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks import words
from camviz_clinic.checks.accuracy import UNREAD, Accuracy
from camviz_clinic.checks.camera_difference import CameraDifference, differences
from camviz_clinic.checks.causes import by_causes
from camviz_clinic.checks.doctor import Shown
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings import kinds
from camviz_clinic.checks.findings.described import described_wrong
from camviz_clinic.checks.pair_difference import PairDifference, pair_differences
from camviz_clinic.checks.registry import Finding
from camviz_clinic.checks.summary import Summary, bend_mm
from camviz_clinic.files import CalibrationError, load
from camviz_clinic.files.output import json_text


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found in a calibration, what was checked, and what could not be, each with the reason.

    The worst cause comes first, and what follows from a cause comes after it: see `camviz_clinic.checks.causes`.

    Attributes:
        calibration: None where the file has a fault that leaves nothing to look at.
        findings: What was found, and is not ignored.
        checked: Ids of the findings that were looked for.
        skipped: tuple of (str, str), ids of the others, each with the reason.
        compare: What it was compared with.
        source: The file, where it could not be read.
        differences: By camera, from the calibration that it is compared with.
        pair_differences: By stereo pair, likewise.
        at: A distance in metres at which errors are told.
        ignored: What was found and is left out of `findings`.
        made: What the checks made, before causes are told.
        evidence: What they were asked of.

    >>> from pathlib import Path
    >>> from camviz_clinic.calibration import Calibration
    >>> from camviz.cameras import Camera, Intrinsics
    >>> camera = Camera(Intrinsics.from_fov(640, 480, 60))
    >>> inspect(Calibration({"camera": camera}, Path(), "a data sheet")).healthy
    True
    """

    calibration: Calibration | None
    findings: tuple[Finding, ...]
    checked: tuple[str, ...]
    skipped: tuple[tuple[str, str], ...] = ()
    compare: Calibration | None = field(default=None, repr=False)
    source: Path | None = None
    differences: tuple[CameraDifference, ...] = ()
    pair_differences: tuple[PairDifference, ...] = ()
    at: float | None = None
    ignored: tuple[Finding, ...] = ()
    made: tuple[Finding, ...] = field(default=(), repr=False)
    evidence: Evidence | None = field(default=None, repr=False)

    @classmethod
    def of(cls, evidence: Evidence) -> Self:
        """Make every check for which there is evidence.

        Args:
            evidence: The calibration, and what is known beside it.

        Returns: Inspection, what they found.
        """
        findings: list[Finding] = []
        checked, skipped = [], []
        for id, kind in kinds().items():
            if kind.asked_of and not kind.asked_of(evidence):
                continue
            try:
                findings += kind.check(evidence)
                checked.append(id)
            except NotChecked as missing:
                skipped.append((id, str(missing)))
        return cls(
            evidence.calibration,
            by_causes(findings, kinds()),
            tuple(checked),
            tuple(skipped),
            evidence.compare,
            differences=tuple(differences(evidence)),
            pair_differences=tuple(pair_differences(evidence)),
            at=evidence.at,
            made=tuple(findings),
            evidence=evidence,
        )

    def ignoring(self, ids: Collection[str]) -> Self:
        """The same without the findings of some ids, which neither count nor explain others; `ignored` has them.

        Args:
            ids: What to leave out.

        Returns: Inspection without them.
        """
        kept = tuple(each for each in self.made if each.id not in ids)
        left = by_causes((each for each in self.made if each.id in ids), kinds())
        return replace(self, findings=by_causes(kept, kinds()), ignored=left)

    @property
    def healthy(self) -> bool:
        """True where nothing worse than a note was found."""
        return words.worst_of(self.findings) is None

    def as_json(self) -> str:
        """For programs, as strict JSON: cameras, findings, checked, skipped, ignored, as docs/clinic.md has them.

        Returns: JSON.
        """
        return json_text(self.as_tree())

    def as_tree(self) -> dict[str, Any]:
        """What `as_json` writes, as dicts and lists.

        Returns: A dict of what JSON can hold.
        """
        cameras = self.calibration.cameras if self.calibration else {}
        return {
            "verdict": self.verdict,
            **self._compared(),
            "cameras": [self._camera(name, camera) for name, camera in cameras.items()],
            **self._board_warp(),
            "accuracy": list(self.summary.accuracy.values) if self.summary else [],
            "task": [asdict(each) for each in self.summary.task] if self.summary else [],
            "findings": [words.tree(finding) for finding in self.findings],
            "checked": list(self.checked),
            "skipped": [{"id": id, "why": why} for id, why in self.skipped],
            **self._notes(),
            "ignored": [{"id": id, "count": count} for id, count in words.count_of_each(self.ignored).items()],
        }

    def _compared(self) -> dict[str, Any]:
        """What differs from another calibration; nothing where there is none."""
        if self.compare is None:
            return {}
        by_pair = [asdict(each) for each in self.pair_differences]
        return {"differences": [asdict(each) for each in self.differences], "pair_differences": by_pair}

    @property
    def compared(self) -> tuple[str, ...]:
        """How far it is from the calibration that it is compared with, in sentences."""
        by_pair = (each.sentence for each in self.pair_differences)
        return (*(each.sentence for each in self.differences), *by_pair)

    def _board_warp(self) -> dict[str, Any]:
        """The board's two sagittas and their σ in mm, where they were solved for."""
        if self.calibration is None or (found := bend_mm(self.calibration)) is None:
            return {}
        return {"board_warp": dict(zip(("mm", "sigma_mm"), found, strict=True))}

    def _notes(self) -> dict[str, Any]:
        """What whoever solved or read it had to say, in sentences; nothing where there is none."""
        return {"notes": list(self.calibration.notes)} if self.calibration and self.calibration.notes else {}

    def _camera(self, name: str, camera: Camera) -> dict[str, Any]:
        grid = camera.intrinsics
        lens: Any = camera.lens
        rms = self.calibration.rms(name) if self.calibration else None
        pinhole = {key: getattr(grid, key) for key in ("width", "height", "fx", "fy", "cx", "cy")}
        distortion = {key: float(value) for key, value in asdict(lens).items()}
        stamp = self.calibration.stamps.get(name) if self.calibration else None
        told: dict[str, object] = {"distortion": distortion, "rms": rms}
        if undecided := self.summary.undecided(name) if self.summary else ():
            told["undecided"] = list(undecided)
        if stamp:
            told["stamp"] = stamp.known()
        if delay := self.calibration.line_delays.get(name) if self.calibration else None:
            told["line_delay"] = {"us": 1e6 * delay.seconds, "sigma_us": delay.sigma and 1e6 * delay.sigma}
        return {"name": name, "model": type(lens).__name__} | pinhole | told

    @cached_property
    def summary(self) -> Summary | None:
        """The calibration at a glance; None where there is nothing to look at."""
        return None if self.calibration is None else Summary.of(self.calibration, self.at)

    @property
    def verdict(self) -> str:
        """The most likely cause and what to do now; or what the calibration is good for, and by how many checks."""
        return words.verdict(self.findings, self.checked, self.skipped, self.ignored, self._accuracy)

    @property
    def sufficient(self) -> bool:
        """True where nothing worse than a note was found, and no accuracy is known to be useless."""
        return self.healthy and self._accuracy.sufficient is not False

    @property
    def _accuracy(self) -> Accuracy:
        """What it is good for, where there is no finding that comes first."""
        return self.summary.accuracy if self.healthy and self.summary else UNREAD

    @property
    def next_step(self) -> str:
        """Where nothing is wrong: where to hold the board next, or why nothing needs doing. Else nothing."""
        return self.summary.guidance if self.healthy and self.summary else ""

    def as_text(self) -> str:
        """For people: the findings or that there are none, the calibration at a glance, and what was checked.

        Returns: Several lines.
        """
        glance = tuple(self.summary.lines(below_verdict=self.healthy)) if self.summary else ()
        said = words.text(
            self.findings, self.checked, self.skipped, self.next_step, glance, self.ignored, self._accuracy
        )
        return "".join(f"{each}\n" for each in self.compared) + "\n" * bool(self.compared) + said

    def __str__(self) -> str:
        return self.as_text()


def inspect(
    calibration: Calibration,
    *,
    compare: Calibration | None = None,
    pictures: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
    at: float | None = None,
    baseline: float | None = None,
    photographs: Sequence[str | PathLike[str]] = (),
) -> Inspection:
    """What is wrong with a calibration.

    Args:
        calibration: What to look at.
        compare: Another calibration of the same cameras.
        pictures: Sizes (width, height) in pixels of pictures, by their names, that the calibration is meant for.
        board: The board as it was measured, where that is known.
        at: A distance in metres at which the error of a place is told.
        baseline: The length in metres of a pair's baseline as it was measured.
        photographs: Files that show the board.

    Returns: Findings, with their remedies, and what was checked.
    Raises: ValueError for what is no Calibration, such as a path.

    >>> from pathlib import Path
    >>> from camviz_clinic.calibration import Calibration
    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> camera = Camera(Intrinsics.from_fov(640, 480, 100), BrownConrady(k1=-0.3))  # it folds where 1 - 0.9 r² = 0
    >>> (finding,) = inspect(Calibration({"camera": camera}, Path(), "a data sheet")).findings
    >>> finding.id, round(finding.value, 3)
    ('fold', 1.054)
    """
    if not isinstance(calibration, Calibration):
        raise ValueError(
            f"calibration must be a Calibration, as `load` reads one, got {type(calibration).__name__}; `inspect_file` "
            "takes a path"
        )
    printed = board or calibration.board
    shown = Shown.of(photographs, printed) if photographs and printed else None
    taken = Stamp.of(photographs) if photographs else None
    return Inspection.of(Evidence(calibration, compare, pictures or {}, board, at, baseline, shown, taken))


def inspect_board(
    photographs: Sequence[str | PathLike[str]], board: Board, source: Path | None = None
) -> Inspection | None:
    """What is wrong with the description of a board where its pictures give no calibration; None where nothing is."""
    findings = tuple(described_wrong(Shown.of(photographs, board)))
    if not findings:
        return None
    why = "the board is not as described, and there is no calibration"
    skipped = tuple((id, why) for id in _asked_of_all() if id != findings[0].id)
    return Inspection(None, findings, (findings[0].id,), skipped, source=source, made=findings)


def inspect_file(
    path: str | PathLike[str],
    *,
    size: tuple[int, int] | None = None,
    compare: Calibration | None = None,
    pictures: Mapping[str, tuple[int, int]] | None = None,
    board: Board | None = None,
    at: float | None = None,
    baseline: float | None = None,
    photographs: Sequence[str | PathLike[str]] = (),
    prepare: Callable[[Calibration], Calibration] | None = None,
) -> Inspection:
    """What is wrong with a calibration file, also with one that every other command refuses.

    Args:
        path: The file.
        size: Width and height in pixels, for files that do not hold them.
        compare, pictures, board, at, baseline, photographs: As of `inspect`.
        prepare: May add to the Calibration that was read, such as the corners in pictures.

    Returns: As of `inspect`; without a calibration where a fault leaves nothing to look at.
    Raises: CalibrationError where the file is not a calibration at all.

    >>> from pathlib import Path
    >>> _ = Path("calib.txt").write_text("P0: 700 0 600 0 0 700 180 0 0 0 1 0")
    >>> [finding.severity for finding in inspect_file("calib.txt", size=(1242, 375)).findings]
    ['note']
    """
    try:
        calibration = load(path, size=size, mend=True)
    except CalibrationError as error:
        if not error.id:
            raise
        text = str(error).removeprefix(f"{Path(path)}: ")
        finding = kinds()[error.id].of_file(CalibrationError(text, error.id, error.value, error.remedy))
        why = "the file could not be read beyond the fault above"
        skipped = tuple((id, why) for id in _asked_of_all() if id != error.id)
        return Inspection(None, (finding,), (error.id,), skipped, source=Path(path), made=(finding,))
    calibration = prepare(calibration) if prepare else calibration
    return inspect(
        calibration,
        compare=compare,
        pictures=pictures,
        board=board,
        at=at,
        baseline=baseline,
        photographs=photographs,
    )


def _asked_of_all() -> list[str]:
    """The ids of the findings that are looked for in every calibration."""
    return [id for id, kind in kinds().items() if kind.asked_of is None]
