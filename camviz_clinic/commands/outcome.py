"""What becomes of a calibration on a command line: stamped, written, inspected, shown on a page."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from camviz_clinic.commands.common import (
    FOUND,
    OK,
    Refusal,
    narrator,
    refuse_exhausted,
    write_calibration,
    write_whole,
)
from camviz_clinic.commands.gate import write_junit

if TYPE_CHECKING:
    from camviz_clinic.checks import Inspection
    from camviz_clinic.checks.gate import Gate
    from camviz_clinic.files import Calibration


def stamped(
    calibration: Calibration, seen: Calibration, shots: list[list[Path]], options: argparse.Namespace
) -> Calibration:
    """With what the calibration of each camera holds for; and a note where the setting changed between its pictures.

    `seen` is the calibration with its views.
    """
    from camviz import __version__
    from camviz_clinic.calibration.stamp import Stamp, now
    from camviz_clinic.checks.stamps import settings_differ

    made = {"made": now(), "program": f"camviz {__version__}", "model": options.model, "conditions": options.conditions}
    models = dict(word.split("=", 1) for word in options.model_of)
    stamps = {
        name: Stamp.of(
            pictures,
            views=int(seen.used(name).any(axis=1).sum()),
            **made | {"model": models.get(name, options.model)},
        )
        for name, pictures in zip(calibration.cameras, shots, strict=False)
    }
    notes = [f"{name}: {said}" for name, stamp in stamps.items() for said in settings_differ(stamp)]
    return replace(calibration, stamps=stamps, notes=(*calibration.notes, *notes))


def refuse_parallel(calibration: Calibration) -> None:
    """Refuses a camera whose boards are all parallel, so that any focal length fits its corners."""
    from camviz_clinic.checks.evidence import Evidence
    from camviz_clinic.checks.findings.boards import leave_focal_length_open, parallel_boards, tilt_spread_deg

    evidence = Evidence(calibration)
    for name, poses in evidence.cam_from_board.items():
        if leave_focal_length_open(evidence, name):
            raise Refusal(
                f"{name}: all {len(poses)} boards are parallel within {tilt_spread_deg(evidence, name):.1f}°, so that "
                f"the corners do not determine the focal length. {parallel_boards.remedy}"
            )


def written(calibration: Calibration, options: argparse.Namespace, form: str) -> str:
    """Writes it; what the format could not hold, as the end of the sentence that says "written"."""
    from camviz_clinic.files import CalibrationError
    from camviz_clinic.files.writing import without

    try:
        return without(write_calibration(calibration, options.output, form))
    except CalibrationError as error:
        raise Refusal(str(error)) from error
    except OSError as error:
        refuse_exhausted(error)
        raise Refusal(f"{options.output}: cannot be written ({error.strerror or error}).") from error


def judged(calibration: Calibration, folders: Mapping[str, Path], options: argparse.Namespace, gate: Gate) -> int:
    """Inspects it and writes the page, where that is asked for; the exit status."""
    from camviz_clinic.checks import inspect

    decides = gate.asked or options.junit is not None
    if not (options.report or decides):
        return OK
    outcome, told = gate.judge(inspect(calibration)), narrator(options.output)
    told("\n".join(["", outcome.inspection.as_text(), *outcome.lines()]))
    if options.report:
        _page(outcome.inspection, folders, options.report)
        told(f"{options.report}: open it in a browser.")
    write_junit(options, {str(options.output): outcome})
    return OK if outcome.passed or not decides else FOUND


def _page(inspection: Inspection, folders: Mapping[str, Path], page: Path) -> None:
    from camviz_clinic.report.inspection import write_report

    write_whole(page, lambda path: write_report(inspection, path, images=folders))
