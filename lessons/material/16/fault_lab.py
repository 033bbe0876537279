"""The fault lab: one virtual camera, one fault of any strength, and everything that moves when it is solved again.

A reader's own functions can measure every view and name what is off, beside the right answers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from camviz.draw import plot, svg
from camviz.draw.flow import Cell, rows
from camviz.draw.panel import Panel, image_in
from camviz.draw.picture import Picture
from camviz.draw.readout import listed, true_minus
from camviz.views.base import choice, slider, switch
from camviz.views.marks import arrows, shortened
from camviz.views.view_bars import LABEL, ViewChooser
from camviz.views.yours import placeholder, tried
from camviz_clinic.checks.registry import Finding
from camviz_school.views.laboratory import BOARD, VIEWS, Experiment, experiment, lab_faults

_COLOURS = {"fault": "red", "warning": "orange", "note": "muted"}
_MOST = 3  # findings that have room
_FAR = 4.0  # standard deviations
_LONGEST = 90.0  # picture units of an arrow
_ROWS = (366, {"residuals": 440, "bars": 300, "numbers": 220}), (272, {"estimates": 340, "findings": 620})
_WIDE = {name: wide for _, row in _ROWS for name, wide in row.items()}
"""The panels in their order, and how wide each is in picture units; the height of each row stands before it."""
_VERDICTS = ("0, nothing is off", "1, a corner is off", "2, a row or a column is off", "3, a whole view is off")


@dataclass(frozen=True)
class FaultLabView(ViewChooser):
    """What a fault does to a calibration, and what it does not: the fit, the estimates against the truth, the findings.

    Strength 0 is a healthy calibration. The corners have Gaussian noise of `noise` pixels; `seed` chooses camera,
    boards and noise. Arrows lead from where the camera projects a corner of the chosen view
    towards where it was detected. A click on a bar chooses its view.

    `panels` names what is drawn: any of residuals, bars, numbers, estimates and findings. `yours` is a reader's
    function of residuals (views, corners, 2) to the RMS (views,) of every view, and `verdict` one of residuals (views,
    rows, columns, 2) to 0 … 3, for nothing, a corner, a line or a whole view; what they answer is orange.
    """

    title: ClassVar[str] = "Fault lab"
    openable: ClassVar[Mapping[str, str]] = {name: name for name in _WIDE}

    fault: str = choice(*lab_faults(), help="what is wrong")
    strength: float = slider(0.5, 0, 1, 0.01, help="0 is healthy, 1 is gross")
    noise: float = slider(0.15, 0.02, 0.5, 0.01, unit="px", help="standard deviation of a corner's coordinates")
    seed: int = slider(1, 1, 20, 1, label="camera", help="another camera, other boards, other noise")
    view: int = slider(1, 1, VIEWS, 1, label="view", help="whose residuals are shown; or click its bar")
    told: bool = switch(True, label="show the findings", help="hide them to make a diagnosis of your own")

    panels: str = " ".join(_WIDE)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    verdict: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be one or more of {', '.join(_WIDE)}, got {self.panels!r}")

    @cached_property
    def experiment(self) -> Experiment:
        """The calibration shown, and its truth."""
        return experiment(self.fault, float(self.strength), float(self.noise), round(self.seed))

    @property
    def count(self) -> int:
        return VIEWS

    def worst(self) -> Self:
        """The same, with the view of the largest error chosen."""
        return self.but(view=int(np.nanargmax(self.experiment.errors)) + 1)

    def numbers(self) -> dict[str, str]:
        """How well it fits, how far off it takes itself to be, and how far off it is."""
        made = self.experiment
        return {
            "error of the fit": f"{made.solved.rms:.2f} px",
            "believes to be off by": f"{figures(float(np.nanmedian(made.believed)))} px",
            "is off by": f"{figures(float(np.nanmedian(made.off.length)))} px",
        }

    def description(self) -> str:
        told = [f"{self.fault}, strength {self.strength:g}: {self.experiment.words}"] if self.told else []
        told += [listed(dict([*self.numbers().items()][: 3 if self._has("numbers") else 1]))]
        if self._has("estimates"):
            estimates = (f"{k} {_signed(e, s)} px" for k, (e, s) in self.experiment.estimates.items())
            told += [f"estimated less true: {'; '.join(estimates)}"]
        if self._has("findings"):
            told += [self._diagnosis() if self.told else "findings hidden"]
        return "; ".join(told).rstrip(".") + "."

    def _diagnosis(self) -> str:
        findings = self.experiment.inspection.findings
        return " ".join(f"{one.severity} {one.id}: {one.sentence}" for one in findings) or "Nothing found."

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        draw = self._image_panel, self._bars_panel, self._headline, self._estimates_panel
        parts = {name: panel() for name, panel in zip(_WIDE, draw, strict=False) if self._has(name)}
        layout, tiles = self._layout, self._findings(draft) if self._has("findings") else []
        for i, body in enumerate(tiles):
            x, y, wide, tall = layout["findings"]
            parts[f"finding {i + 1}"] = body
            layout[f"finding {i + 1}"] = (x + wide / len(tiles) * i, y, wide / len(tiles), tall)
        words = f"{self.fault}, strength {self.strength:g}" if draft else self.description()
        return self.tiled(layout, parts, described=words)

    @property
    def _layout(self) -> dict[str, Cell]:
        shown = [(tall, {name: wide for name, wide in row.items() if self._has(name)}) for tall, row in _ROWS]
        return rows(*(line for line in shown if line[1]))

    def _corner(self, tile: str, right: float, down: float) -> tuple[float, float]:
        """A place in a tile, from its upper left corner."""
        x, y, *_ = self._layout[tile]
        return x + right, y + down

    def _headline(self) -> svg.Marks:
        told = {"error of the fit": "RMS of all residuals", "believes to be off by": "1σ, by its covariance",
                "is off by": "against the true camera"}  # fmt: skip
        parts = []
        shown = 3 if self.verdict is None else 1
        for i, (name, value) in enumerate(list(self.numbers().items())[:shown]):
            x, y = self._corner("numbers", 10, 26 + 72 * i)
            parts.append(svg.text((x, y), name, "title"))
            parts.append(svg.text((x, y + 29), value, f"label{' red' if i == 2 and self._astray else ''}",
                                  font_size=26, font_weight=600))  # fmt: skip
            parts.append(svg.text((x, y + 48), told[name], "note"))
        words = f"In this calibration, {self.experiment.words}." if self.strength else "A healthy calibration."
        words = words if self.told else "What is wrong here?"
        place = self._corner("numbers", 10, 32 + 72 * shown)
        return svg.join(parts) + svg.paragraph(place, words, 200, "label") + self._your_verdict()

    def _your_verdict(self) -> svg.Marks:
        """What the reader's triage says of all residuals together."""
        if self.verdict is None:
            return svg.NOTHING
        residuals = self.experiment.residuals.reshape(VIEWS, BOARD.rows, BOARD.columns, 2)
        answer, problem = tried(self.verdict, (residuals,), 0.0)
        x, y = self._corner("numbers", 10, 322)
        if problem:
            return svg.paragraph((x, y), placeholder(problem), 200)
        known = answer in range(len(_VERDICTS))
        words = _VERDICTS[int(answer)] if known else f"{answer:g}, which is none of 0 to {len(_VERDICTS) - 1}"
        return svg.text((x, y), "Your verdict", "title") + svg.paragraph((x, y + 20), words, 200, "orange")

    @property
    def _astray(self) -> bool:
        made = self.experiment
        return bool(np.nanmedian(made.off.length) > 3 * np.nanmedian(made.believed))

    @property
    def _bars(self) -> Panel:
        tallest = 1.15 * max(float(np.nanmax(self.experiment.errors)), 3 * self.noise)
        return plot.plot_panel("bars", *self._corner("bars", 58, 34), 232, 288, (0.5, VIEWS + 0.5), (0, tallest))

    def _bars_panel(self) -> svg.Marks:
        panel, errors = self._bars, self.experiment.errors
        x = np.arange(1, VIEWS + 1)
        content = plot.grid(panel, xticks=[])
        right, chosen = (0.38, "fill-orange") if self.yours is None else (0.0, "fill-sky")
        for mask, class_ in ((x != self.index + 1, "fill-blue"), (x == self.index + 1, chosen)):
            content += plot.bars(panel, x - 0.38, x + right, np.where(mask, errors, np.nan), class_)
        content += self._your_bars(panel, x)
        median = float(np.nanmedian(errors))
        content += plot.level(panel, median, "ink dashed")
        shown = panel.show(content, title="Error of every view", hint="click a bar", drag="bars", label=LABEL)
        names = [(float(i), f"{i}") for i in x.tolist()]
        return shown + plot.axes(panel, "", "RMS [px]", xticks=names)

    def _your_bars(self, panel: Panel, x: np.ndarray) -> svg.Marks:
        """The reader's own bars beside the right ones; each that lies above the panel ends at its edge."""
        if self.yours is None:
            return svg.NOTHING
        answer, problem = tried(self.yours, (self.experiment.residuals,), self.experiment.errors)
        if problem:
            return svg.paragraph((10, 18), placeholder(problem), panel.width - 20, "note halo")
        names = [("blue thick", "RMS of the view"), ("orange thick", "yours")]
        return plot.bars(panel, x, x + 0.38, answer, "fill-orange") + plot.legend(panel, names)

    def _image_panel(self) -> svg.Marks:
        made, i = self.experiment, self.index
        k = made.camera.intrinsics
        panel = image_in(self._layout["residuals"], "picture", k.width, k.height)
        seen, residuals, scale = made.solved.detections["camera"][i], made.residuals[i], self.arrow_scale
        projected = seen - residuals
        starts = panel.place(projected)
        ends, cut = shortened(starts, panel.place(projected + scale * residuals), _LONGEST)
        grid = starts.reshape(BOARD.rows, BOARD.columns, 2)
        content = svg.path([*grid, *grid.swapaxes(0, 1)], "muted thin")
        content += arrows(starts[~cut], ends[~cut], "orange") + arrows(starts[cut], ends[cut], "red")
        content += svg.dots(panel.place(seen), "green", 3.5)
        note = "red: longer than drawn" if cut.any() else "from projected to detected"
        return panel.show(content, title=f"View {i + 1}: residuals × {scale:g}", note=note)

    @property
    def arrow_scale(self) -> float:
        """How much longer arrows are than residuals: by the noise alone, so that a fault makes them grow."""
        return float(max(1, round(1.8 / self.noise) * 5))

    def _estimates_panel(self) -> svg.Marks:
        estimates = self.experiment.estimates
        values = np.array(list(estimates.values()))
        reach = 1.15 * max(float(np.max(np.abs(values[:, 0]) + values[:, 1])), 3.0)
        x, top = self._corner("estimates", 46, 34)
        panel = Panel("estimates", x, top, 150, 26.0 * len(estimates) + 6, -reach, reach, 0, len(estimates) + 0.2)
        content = svg.line(panel.place([(0, 0), (0, panel.bottom)]), "ink")
        beside = svg.NOTHING
        for i, (name, (error, sigma)) in enumerate(estimates.items()):
            y, far = i + 0.6, abs(error) > _FAR * sigma
            class_ = "red" if far else "green"
            content += svg.line(panel.place([(error - sigma, y), (error + sigma, y)]), f"{class_} thick")
            content += svg.dots(panel.place([(error, y)]), class_, 8)
            level = panel.y + panel.place((0, y))[1] + 4
            beside += svg.text((panel.x - 10, level), name, "label end")
            words, class_ = _signed(error, sigma), f"number{' red' if far else ''}"  # in pixels, as the note says
            beside += svg.text((panel.x + panel.width + 10, level), words, class_)
        shown = panel.show(content, title="Estimate ± 1σ, less the truth")
        ticks = [(float(t), true_minus(f"{t:g}")) for t in plot.ticks(-reach, reach, 3)]
        below = svg.join(
            svg.text((panel.x + px, panel.y + panel.height + 16), words, "tick middle")
            for px, (_, words) in zip(panel.place([(t, 0) for t, _ in ticks])[:, 0], ticks, strict=True)
        )
        note = "In pixels; k1 and k2 at the corner. Red: more than 4σ off."
        return shown + beside + below + svg.paragraph((x - 36, panel.y + panel.height + 38), note, 310)

    def _findings(self, draft: bool) -> list[svg.Marks]:
        """What the clinic finds, a tile for each, the worst first."""
        (x, y), whole = self._corner("findings", 10, 26), _WIDE["findings"]
        room = whole - 20
        head = svg.text((x, y), "What the clinic finds", "title")
        if not self.told:
            return [
                head + svg.paragraph((x, y + 30), "Hidden. Make your diagnosis, then switch them on.", room, "label")
            ]
        if draft:
            return [head + svg.text((x, y + 34), "measuring …", "label", font_size=20)]
        inspection = self.experiment.inspection
        if not inspection.findings:
            words = f"{len(inspection.checked)} checks were made."
            return [head + svg.text((x, y + 36), "Nothing found.", "green", font_size=22, font_weight=600)
                    + svg.paragraph((x, y + 62), words, room)]  # fmt: skip
        found = grouped(inspection.findings)
        width = whole / min(len(found), _MOST)
        tiles = [self._finding(x + width * i, y + 28, width, *one) for i, one in enumerate(found[:_MOST])]
        if len(found) > _MOST:
            more = f"and {len(found) - _MOST} more"
            tiles[-1] += svg.text((x + width * (_MOST - 1), y), more, "note")
        return [head + tiles[0], *tiles[1:]]

    def _finding(self, x: float, y: float, width: float, finding: Finding, count: int) -> svg.Marks:
        times, colour = f" × {count}" if count > 1 else "", _COLOURS[finding.severity]
        return (
            svg.rectangle(x, y - 14, 4, 60 + 154 * _WIDE["findings"] / width / _MOST, f"fill-{colour}")
            + svg.text((x + 12, y), f"{finding.id}{times}", f"title {colour}")
            + svg.paragraph((x + 12, y + 30), f"{finding.severity}: {_short(finding.sentence)}", width - 28, "label")
        )


def grouped(findings: tuple[Finding, ...]) -> list[tuple[Finding, int]]:
    """The first finding of every id, and how many there are of it."""
    ids = [finding.id for finding in findings]
    return [(finding, ids.count(finding.id)) for i, finding in enumerate(findings) if finding.id not in ids[:i]]


def figures(value: float) -> str:
    """A length in two figures, and never in powers of ten."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}" if value >= 0.01 else "0"


def _signed(error: float, sigma: float) -> str:
    return f"{'+' if error > 0 else '−'}{figures(abs(error))} ± {figures(sigma)}"


def _short(sentence: str, letters: int = 176) -> str:
    """A sentence that fits its tile, cut between words where it does not."""
    return sentence if len(sentence) <= letters else sentence[:letters].rsplit(" ", 1)[0] + " …"
