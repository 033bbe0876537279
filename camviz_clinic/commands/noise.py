"""`camviz noise`: the EMVA 1288 figures of a camera, measured from its frames."""

from __future__ import annotations

import argparse
from html import escape
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any

from camviz_clinic.commands.common import OK, Refusal, add_command, add_megapixels, refuse_output, write_whole
from camviz_clinic.commands.terminal import tell, tell_json

if TYPE_CHECKING:
    from camviz_clinic.measuring.noise.measurement import Measurement
    from camviz_clinic.measuring.noise.recording import Recording

NOISE = """\
Measures a sensor from its frames, by EMVA Standard 1288 (release 4.0, linear): gain, read noise, quantum efficiency,
signal to noise, dynamic range, full well, fixed patterns and dark current.

A figure is printed where the frames tell it within 3 % (DSNU and PRNU 5 %, decibels 0.26 dB) even if chance is at four
standard errors. Otherwise it is withheld, with its bounds and the reason. So it is where the standard's model does not
hold: noise that neighbours share, a bent response, an offset that drifts, uneven light.

FOLDER holds, for each of several exposures, two frames of the same steady, even light and two with the lens covered,
grey PNG or TIFF straight from the sensor, of 8 or 16 bits, or of 32 with whole numbers up to 65535:
  bright_<exposure ms>_0.png   bright_<exposure ms>_1.png   dark_<exposure ms>_0.png   dark_<exposure ms>_1.png
The exposures should reach beyond saturation. Further frames of one exposure (_2, _3, ...), of both kinds, make a stack,
which splits the patterns into rows, columns and pixels. FOLDER may also be, or hold, an EMVA 1288 descriptor file, a
text of lines
  v <release>   n <bits> <width> <height>   b <exposure ns> <photons>   d <exposure ns>   i <frame>
where the frames (i) of a bright (b) or dark (d) exposure follow it: two are a pair, more a stack.
"""
EPILOG = """\
examples:
  camviz noise shots/
  camviz noise shots/ --photons-per-ms 5200 --report noise.html
  camviz noise EMVA1288_Data.txt --json

exit status:
  0  measured
  2  the frames cannot be measured, or the command cannot be used; one sentence on stderr says why
"""


def add(commands: Any) -> None:
    command = add_command(commands, "noise", noise, "measure a sensor from its frames", NOISE)
    command.epilog = EPILOG
    command.add_argument("folder", metavar="FOLDER", type=Path, help="the frames, or an EMVA 1288 descriptor file")
    command.add_argument(
        "--photons-per-ms", metavar="N", type=_photons, help="photons that reach a pixel in a millisecond of exposure"
    )
    command.add_argument("--json", action="store_true", help="the figures for programs; null if withheld, and why")
    command.add_argument("--report", metavar="OUT.html", type=Path, help="write a page with the curves as well")
    add_megapixels(command)


def noise(options: argparse.Namespace) -> int:
    """Measure, write the page whole or not at all, and only then print."""
    if "\0" in str(options.folder):
        raise Refusal(f"{str(options.folder)!r} is not the name of a folder.")
    if options.report:
        refuse_output(options.report, "page", options.folder)
    from camviz_clinic.measuring.noise.recording import RecordingError, measure, read_recording

    try:
        recording = read_recording(options.folder)
        if options.photons_per_ms is not None:
            recording = recording.with_photons_per_ms(options.photons_per_ms)
        found = measure(recording)
    except RecordingError as error:
        raise Refusal(str(error)) from error
    if options.report:
        _refuse_frame(options.report, recording)
        text = page(found, recording)
        write_whole(options.report, lambda path: path.write_text(text, encoding="utf-8"))
    if options.json:
        tell_json(as_json(found))
        return OK
    tell(as_text(found, recording))
    if options.report:
        tell(f"{options.report}: open it in a browser.")
    return OK


def _photons(text: str) -> float:
    """A number of photons above zero."""
    try:
        photons = float(text)
    except ValueError:
        photons = 0.0
    if not 0 < photons < 1e12:
        raise argparse.ArgumentTypeError(f"expected photons per pixel and millisecond, above 0, got {text!r}")
    return photons


def _refuse_frame(output: Path, recording: Recording) -> None:
    shots = [*recording.pairs, *filter(None, (recording.bright_stack, recording.dark_stack))]
    refuse_output(output, "page", *(frame for shot in shots for frame in shot.frames))


def as_json(found: Measurement) -> str:
    """All figures as one JSON object: null for those withheld, with the reason under "why"; bounds under "bounds"."""
    from camviz_clinic.files.output import json_text

    judged = found.judged
    figures: dict[str, Any] = {name: one.value for name, one in judged.items()}
    figures["bounds"] = {name: [one.low, one.high] for name, one in judged.items() if one.bounded}
    figures["why"] = {name: one.why for name, one in judged.items() if one.why}
    return json_text(figures)


def as_text(found: Measurement, recording: Recording) -> str:
    """The figures in words, with the reason where one is withheld."""
    lines = [f"{recording.source}: {len(found.levels)} levels of exposure, {found.levels[0].bright.pixels} pixels."]
    lines += [f"  {words:24} {value}" + (f": {why}" if why else "") for words, value, why in rows(found)]
    return "\n".join([*lines, *remarks(found)])


def rows(found: Measurement) -> list[tuple[str, str, str]]:
    """Each figure's words, its value or bounds, and why it is withheld; the patterns' parts where there are stacks."""
    from camviz_clinic.views.measured_noise import FIGURES, PARTS, told

    shown = FIGURES | PARTS if found.bright and found.dark else FIGURES
    judged = found.judged
    return [(words, told(name, judged[name]), judged[name].why) for name, (words, _, _) in shown.items()]


def remarks(found: Measurement) -> list[str]:
    """What else a reader should know, one sentence each."""
    smallest, largest, mean = (found.judged[f"linearity_error{end}"].value for end in ("_min", "_max", ""))
    if isfinite(mean):
        said = [f"Off a straight line by {mean:.2%} on average, from {smallest:+.2%} to {largest:+.2%}."]
    else:
        said = [f"How far the response is off a straight line is not known: {found.why('linearity_error')}."]
    said.append("At the threshold, ½ + √(σ² + ¼), signal and noise are equal; the standard's σ + ½ approximates it.")
    lines = [name for name, noisy in (("Rows", found.noisy_rows), ("Columns", found.noisy_columns)) if noisy]
    if lines and not found.estimates.smoothed:
        said.append(
            f"{' and '.join(lines).capitalize()} have noise of their own in every frame: it is part of the dark noise, "
            "and taken out of the gain and of the patterns."
        )
    if not (found.bright and found.dark):
        said.append("The patterns come from pairs of frames; a stack of 16 or more of one exposure tells them better.")
    if found.flicker_counts:
        said.append(
            "By release 3 of the standard, as the descriptor says: flicker of the light between frames counts as noise."
        )
    return said


def page(found: Measurement, recording: Recording) -> str:
    """The measurement as one page of HTML that needs no network: the figures, then the curves."""
    from camviz.draw.page import document, figure
    from camviz_clinic.views.measured_noise import MeasuredNoiseView

    table = "".join(
        f"<tr><th>{escape(words)}</th><td>{escape(value)}</td><td>{escape(why)}</td></tr>"
        for words, value, why in rows(found)
    )
    notes = "".join(f"<p>{escape(sentence)}</p>" for sentence in remarks(found))
    body = (
        f"<p>{len(found.levels)} levels of exposure, {found.levels[0].bright.pixels} pixels. "
        "EMVA Standard 1288, linear model.</p>"
        f'<div class="scroll"><table>{table}</table></div>{notes}'
        + figure("", MeasuredNoiseView(measurement=found, name=recording.source.name).figure())
    )
    return document(recording.source.name, body)
