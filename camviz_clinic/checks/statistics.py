"""How often the clinic is right: false alarms over healthy calibrations, and hits over faults of several strengths.

python -m camviz_clinic.checks.statistics          counts anew and writes docs/clinic.md (half an hour)
python -m camviz_clinic.checks.statistics --page   writes docs/clinic.md with the tables that it has
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import faults, kinds
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.checks.registry import Fault, Finding, Kind
from camviz_clinic.checks.virtual import healthy, healthy_pair

PAGE = Path(__file__).parents[2] / "docs" / "clinic.md"
TABLES = "<!-- The tables below are counted by: python -m camviz_clinic.checks.statistics -->"
BELOW = "\n## Standard deviations\n"  # the tables; by hand, and by benchmarks/intervals.py and field.py
HEALTHY, REPEATS = 120, 12
SEED = 20_000
RATED = ("fault", "warning")  # a note is a fact about a lens, not an alarm


@dataclass(frozen=True)
class Hits:
    """In how many of `count` set-ups a fault of this strength was named, and in how many something else was, too."""

    strength: float
    hits: int
    count: int
    others: Counter[str]


def false_alarms(
    make: Callable[[np.random.Generator], Calibration], count: int = HEALTHY, seed: int = SEED
) -> Counter[str]:
    """In how many of `count` healthy calibrations each id was found, notes left out."""
    found: Counter[str] = Counter()
    for number in range(count):
        evidence = Evidence(make(np.random.default_rng(seed + number)))
        found.update({finding.id for finding in alarms(evidence)})
    return found


def alarms(evidence: Evidence) -> list[Finding]:
    """The findings that are worse than notes."""
    return [finding for finding in Inspection.of(evidence).findings if finding.severity in RATED]


def hits(fault: Fault, strength: float, count: int = REPEATS, seed: int = SEED) -> Hits:
    """How often a fault is named."""
    named, others = 0, Counter[str]()
    for number in range(count):
        evidence = fault.inject(np.random.default_rng(seed + number), strength)
        ids = {finding.id for finding in Inspection.of(evidence).findings}
        named += fault.finding in ids
        others.update(ids - {fault.finding})
    return Hits(strength, named, count, others)


def count_all(progress: Callable[[str], object] = print) -> str:
    """Both tables as Markdown."""
    single, stereo = (false_alarms(make) for make in (healthy, healthy_pair))
    progress(f"healthy: {dict(single)}, {dict(stereo)}")
    rows = []
    for fault in faults().values():
        results = [hits(fault, strength) for strength in fault.strengths]
        progress(f"{fault.name}: {[(each.strength, each.hits, dict(each.others)) for each in results]}")
        rows.append(_row(fault, results))
    return "\n".join([*_healthy_table(single, stereo), "", *_faults_table(rows)]) + "\n"


def _healthy_table(single: Counter[str], stereo: Counter[str]) -> Iterator[str]:
    yield f"### {2 * HEALTHY} healthy calibrations"
    yield ""
    yield (
        f"These are {HEALTHY} cameras and {HEALTHY} pairs at random, of 0.3 to 2 megapixels. "
        "Their lenses are 50° to 70° wide, with barrel to slightly pincushion distortion. The noise is 0.05 to 0.3 px. "
        "There are three boards, and 10 to 20 views. All are solved with the standard model. "
        "Findings worse than a note are counted."
    )
    yield ""
    yield "| finding | false alarms, one camera | false alarms, pair |"
    yield "|---|---|---|"
    for id in kinds():
        yield f"| `{id}` | {single[id]} of {HEALTHY} | {stereo[id]} of {HEALTHY} |"


def _faults_table(rows: list[str]) -> Iterator[str]:
    yield "### Faults"
    yield ""
    yield (
        f"Each fault and strength is put into {REPEATS} set-ups. **Bold** is the strength at which the tests hold that "
        "the fault is named. *Also found* counts, at that strength, what else an inspection names."
    )
    yield ""
    yield "| fault | must be named | strength: named | also found |"
    yield "|---|---|---|---|"
    yield from rows


def _row(fault: Fault, results: list[Hits]) -> str:
    shown = []
    for result in results:
        said = f"{result.strength:g}: {result.hits}/{result.count}"
        shown.append(f"**{said}**" if result.strength == fault.promised else said)
    promised = next(result for result in results if result.strength == fault.promised)
    others = ", ".join(f"`{id}` {count}" for id, count in promised.others.most_common())
    unit = f" [{fault.unit}]" if fault.unit else ""
    return f"| {fault.name}{unit}: {fault.sentence} | `{fault.finding}` | {', '.join(shown)} | {others} |"


def page(tables: str) -> str:
    """docs/clinic.md: what every finding means, then the tables."""
    entries = "\n\n".join(_entry(kind) for kind in kinds().values())
    return f"{HEAD}\n{entries}\n\n{MIDDLE}\n{TABLES}\n\n{tables}"


def below(tables: str) -> str:
    """What stands below the counted tables, which counting anew leaves as it is."""
    _, heading, rest = tables.partition(BELOW)
    return heading + rest


def _entry(kind: Kind) -> str:
    explains = ", ".join(f"`{id}`" for id in kind.explains)
    return (
        f'<a id="{kind.id}"></a>\n### `{kind.id}`\n\n'
        f"**{kind.severity.capitalize()}.** {kind.symptom} View: `{kind.view}`.\n\n"
        f"- Likely: {'; '.join(kind.causes)}.\n"
        f"- Evidence: {kind.evidence}\n"
        f"- Named when: {kind.threshold}\n"
        f"- Remedy: {kind.remedy}" + (f"\n- Explains: {explains}." if explains else "")
    )


HEAD = """\
# The clinic

<!-- Made from camviz_clinic/checks/findings by: python -m camviz_clinic.checks.statistics --page -->

`camviz inspect FILE` and `camviz_clinic.inspect(camviz_clinic.load(path))` say what is wrong with a calibration. Every
finding has a stable id, one sentence, the number that shows it, the view that shows it, its likely causes and a remedy.

The clinic does not guess. A check whose evidence the file does not hold is listed as not made, with the reason. The
command `camviz calibrate` writes files that hold all of it: corners, poses of the board, what was estimated and how
well. With `--images` and `--board` the corners are looked for in pictures, and with `--corners` they are read from
another program's file. `--compare` holds a second calibration of the same cameras beside the first. How far the two
differ is then the first thing that is said.

A *fault* makes the calibration wrong. A *warning* makes it doubtful. A *note* is something to know when it is used.
The exit status of `camviz inspect` is 0 when nothing is worse than a note, 1 when something is, and 2 when a file
cannot be read. [A gate](#a-gate-in-ci) says otherwise where a project wants it.

Findings are told by their causes. What follows from a wrong model, such as outliers and folds, stands under
`model-too-simple` and has its remedy; `model-too-simple` is then as severe as the worst of it. "Explains" below lists
what may follow from what, in the same camera. More than three findings of one kind that say the same of several
cameras, frames or pictures are one, with the `count` of them.

With `--json` the output is `{"verdict": sentence, "cameras": [{name, model, width, height, fx, fy, cx, cy, distortion,
rms, stamp}], "task": [{cameras, sentence, values}], "findings": [{id, severity, sentence, value, unit, camera, view,
causes, remedy, consequence_of, count}], "checked": [id, …], "skipped": [{id, why}], "ignored": [{id, count}]}`. A
`stamp` is there where the file has one. The command adds `"gate": {passed, fail_on, ignore, failed_by,
limits: [{name, camera, most, value}]}`. With `--compare` there are also `"differences"`. Of several files it is a list
of these, each with its `file`.

## The report in ten seconds

`camviz inspect FILE --report page.html`, `camviz calibrate … --report page.html` and a notebook's
`camviz_clinic.inspect(calibration)` begin alike. The terminal has the same words.

- **The verdict.** The most likely cause and the one thing to do now, and below it what shows it. Or "Nothing wrong was
  found", how many checks ran, how many could not and why. That is an answer, not a want of data.
- **Next.** Where nothing is wrong, how to hold the board for the picture that would help most, or that there are enough
  pictures. There are enough when a far point is expected to be at most 1 px off where it is worst. That is the Max ERE
  of AprilCal (Richardson, Strom & Olson 2013). `camviz calibrate --goal PX` asks for another limit.
- **The file.** Its date is the calibration's, where the file says it, else that of the file on this disk. Pictures used
  of those given: one that was skipped, or whose corners were all set aside, was not used. Below it stands what the
  calibration holds for.
- **The numbers, each ± one standard deviation.** From the covariance in the file, or else from its corners, by
  [the scatter of the views](#standard-deviations). The RMS is over the corners used. The uncertainty is that of the
  pixel at which a far point is seen, at the centre of the image and in its worst corner. What is wrong alike in all
  views is not in it, such as a bent board.
- **What it is worth.** How well the direction to a far point is known, in degrees. With `--at 2m` the error of a place
  at that distance. Of a pair the depth error at 1, 2, 5 and 10 m, where matches are to ±0.25 px, and the calibration's
  own part of it. One standard deviation each.
- **Notes.** How many corners were set aside, and in which pictures.

Each bar of "Residuals, view by view" is as high as the RMS written on it: blue over the corners used, pale red with
those that were set aside. A bar of more than ten times the median is cut, with a break and its number.

A bare `calibration` as the last line of a notebook's cell shows the same table and a still picture. Views show
photographs where their folder is named: `--images FOLDER`, or
`camviz_clinic.inspect(calibration).explore(images=FOLDER)`.

## Does it still hold?

`camviz check CALIBRATION IMAGES…` and `camviz_clinic.checks.check(calibration, detections)` judge a calibration in use
by new pictures of a board. The camera is held as it is, and only the poses are solved for. Poses make up for much of
what is wrong, so small residuals prove nothing. The check also solves for fx, fy, cx, cy and the lens's first
coefficient. How far that moves far points over the image is the *change* (RMS, in pixels), once a turn of the whole
camera is taken out. A smooth pattern in what remains counts with it, such as that of a tilted sensor. The board's bend
is always free.

| verdict | status | when, with 99 % confidence |
|---|---|---|
| pass | 0 | the change is below the limit (`--limit-px`, 1 px), and corners reach every part of the image |
| warn | 1 | the change is above half of the limit; or the calibration's own uncertainty explains it; or a resize |
| fail | 1 | the change is above the limit; or corners lie where the calibration has no image; or a crop |
| inconclusive | 4 | neither: too few views, corners or parts of the image, or too much noise; what would settle it |

A part of the image is a ninth of it with fewer than 4 corners, or a border strip of an eighth without any. The
uncertainty of the change comes from the covariance, times the ratio by which views differ more than their noise
explains. That ratio is about 1 in simulation and 6 to 12 in OpenCV's photographs, whose F-tests mean nothing for it.

With `--right` the pair is judged as well. Rows and disparities of points at the boards' distance are held against the
same limit. The baseline is held against the board, within 1 % (a quarter of a millimetre on a 25 mm square).

**What it cannot see.** A turn of the whole camera in its mount looks like another pose. So does most of a moved
principal point: in the cameras below 13 px of it (median; 6 to 27) are a change of 1 px. A pair does see it, in its
rows. Pictures cropped to the calibration's own size look like a moved principal point, binned ones like resized ones.

Of 198 virtual deployments none that was healthy failed, and none that was off by 1 px or more passed. They have noise
of 0.05 to 0.3 px, 0.3 to 2 megapixels and 15 to 40 new views (`python benchmarks/deployments.py`):

| deployment | pass | warn | inconclusive | fail |
|---|---|---|---|---|
| healthy | 28 | 2 | 30 | 0 |
| knocked by 0.2 px | 5 | 0 | 5 | 0 |
| knocked by 0.5 px | 5 | 1 | 4 | 0 |
| knocked by 1 px | 0 | 10 | 0 | 0 |
| knocked by 1.5 px | 0 | 0 | 0 | 10 |
| knocked by 2 px | 0 | 0 | 0 | 10 |
| focused anew by 0.2 px | 5 | 0 | 3 | 0 |
| focused anew by 0.5 px | 3 | 1 | 4 | 0 |
| focused anew by 1 px | 0 | 4 | 4 | 0 |
| focused anew by 1.5 px | 0 | 5 | 2 | 1 |
| focused anew by 2 px | 0 | 1 | 1 | 6 |
| resized 0.5 times | 0 | 6 | 4 | 0 |
| resized 2 times | 0 | 9 | 1 | 0 |
| thin: 2 views | 0 | 0 | 10 | 0 |
| thin: 4 views | 0 | 0 | 10 | 0 |
| thin: boards in the middle half | 0 | 0 | 10 | 0 |

Healthy ones are inconclusive where 1 px is less than the noise allows. The right
cameras of 40 pairs were turned about their x axis. By 0 and 0.3 px all passed, by 1 px (where rows are off by 1.00 to
1.10 px) 6 of 10 failed and the rest were warned of, by 2 px all failed.

On OpenCV's photographs, the left camera solved from every other picture and checked with the rest is inconclusive: the
upper left is empty, and the board bends. Checked with the right camera's pictures it fails, by 2.7 px.

With `--json` the output is `{"verdict", "limit_px", "judgements": [{of, verdict, reason, settle, facts, numbers}],
"contradictions": [{of, what, sentence, value, unit, harmless}], "holds", "notes"}`, one judgement for each camera and
pair. Cropped or turned pictures have `size_change` alone. The `numbers` of a camera are `views`, `corners`, `set_aside`
(a share) and `residual_px` (σ of a coordinate). Its change is `change_px` between `least_px` and `most_px`, with
`median_px` and `p95_px` over the image. `chance_px` is what noise alone may show. More are `pattern_px`, `F` and
`F_chance`, `scatter` (the ratio above), `parameters` (calibrated, now, sigma) and `gaps`. Those of a pair are
`views`, `distance_m`, `rows_px`, `disparity_px`, `depth_error` and `scale` (shares), `scale_sigma` and
`rectified_rows_px` (rms and median of the corners themselves).

## What a calibration holds for

A calibration holds for one size, crop and binning of the picture, one camera and lens, one focus and zoom. The file of
`camviz calibrate` keeps when it was made, by which version and model, and from how many views. It keeps what the
EXIF of the pictures tells: camera with its number, lens, focal length, focus distance, digital zoom, first and last
time. `--conditions "21 °C, focus taped at 2 m, binning 2x2"` keeps what EXIF does not tell. Where the zoom or the
camera changed among the pictures, a note says so.

`camviz inspect` and `camviz check` show this *stamp*, and say where new pictures contradict it.

| new pictures | what is said |
|---|---|
| both sides 1/2, 1/3 … or 2, 3 … times as long | binning or resizing fits; f' = s f and c' = s c + (s − 1)/2 |
| both sides longer or shorter by another factor | resizing fits; the same formula |
| another aspect, no side longer | a crop fits: c' = c − (x0, y0) of its first pixel; f stays |
| another aspect, one side 1/2, 1/3 … as long | binning and then a crop fits |
| another aspect, one side longer and one shorter | neither explains it: another mode, or another camera |
| another camera, lens, focal length, focus or digital zoom in EXIF | `other-settings`, with the factor of f if known |

A verdict of `check` rests on the corners alone: EXIF can be wrong, and what contradicts the stamp is told beside it.
Pictures without EXIF, such as PNG from a machine's camera, tell nothing but their size. With SOURCE_DATE_EPOCH in the
environment the stamp has that time, so that a file can be made again bit by bit.

## A gate in CI

`camviz inspect`, `camviz calibrate` and `camviz check` take the same four options. A finding that is ignored neither
counts nor explains others; one line says how many there are. `calibrate` exits with 1 only where one of the four is
given, or the project has a gate.

| option | in the file | says |
|---|---|---|
| `--fail-on ID,…` | `fail-on` | what makes the status 1: ids, or a severity, which means itself and what is worse |
| `--ignore ID,…` | `ignore` | ids of findings that are left out of verdict and status |
| `--limit NAME=PX,…` | `[limits]` | `rms-px`, `expected-error-px` (Max ERE): the status is 1 above it; `change-px` |
| `--junit FILE` | | JUnit XML of every check: passed, failed with the finding's sentence, or skipped and why |

To `camviz check` a verdict of fail is as a fault, and warn as a warning; ids do not concern it. `change-px` is its
`--limit-px`. Inconclusive stays status 4, and is an error in JUnit's XML.

Without `--fail-on` it is `warning`. A limit that the file cannot be held against is said to be not checked, and does
not fail. Status 2 and 3 (a file that cannot be read, a part that is missing) stay what they are.

The file is `camviz.toml`, or `[tool.camviz]` in `pyproject.toml`. It is looked for in the working directory and above
it, up to the repository's root; the nearest one counts, and the command line wins over it. A name that means nothing
is refused, with the one that may have been meant.

```toml
fail-on = ["fault", "low-coverage"]
ignore = ["aspect"]

[limits]
rms-px = 0.5
expected-error-px = 1
change-px = 1
```

GitLab and Jenkins show the JUnit file as tests (`artifacts: reports: junit`, and the step `junit`). On GitHub an action
does:

```yaml
- run: pip install git+https://github.com/camviz/camviz
- run: camviz inspect calibration/*.yaml --fail-on fault --junit clinic.xml
- uses: mikepenz/action-junit-report@v5
  if: always()
  with:
    report_paths: clinic.xml
```

In Python: `camviz_clinic.checks.Gate(fail_on=("fault",),
ignore=("aspect",)).judge(camviz_clinic.inspect(calibration)).passed`.

## What a file says twice

Programs differ in which of two places they read, so a file that disagrees with itself is two cameras. `contradiction`
holds against each other:

| file | what | beside |
|---|---|---|
| Kalibr camchain | `T_cn_cnm1`; `T_cam_imu` | `T_cam_imu` (or `T_imu_cam`) of both cameras; `T_imu_cam` |
| OpenCV pair | E; F | R and T; the camera matrices, R and T |
| | R; P2 | R1 and R2; P1, and R2 and T |
| | Q | P1 and P2 |
| ORB-SLAM2 pair | `LEFT.P`; `RIGHT.P` | `Camera.fx` …; `Camera.bf` |
| transforms.json | `fl_x`, `fl_y` | `camera_angle_x`, `camera_angle_y` and the image size |
| MATLAB | `K` | `IntrinsicMatrix`, `FocalLength` and `PrincipalPoint` |
| EasyMocap | `R_` | `Rot_` |

Each number is moved by half a unit of its last printed digit, and what that changes is added up. That is how far
rounding can put apart two that agree. An exact zero counts as exact.

## Is the board as described?

`camviz calibrate` and `camviz inspect` with pictures say what of a board is not as it was described, with the option
that mends it. This is the board doctor, one file a fault in `camviz_clinic/checks/doctor`. It counts how many squares
the markers of a ChArUco board are apart, in up to twelve pictures. Each marker's own outline gives the length of a
square, so that no camera needs to be known. The board is the one whose layout has these steps.

| what is wrong | how it is seen | option |
|---|---|---|
| OpenCV before 4.6 drew the board | the steps between markers | `--legacy` |
| columns and rows are swapped | the steps between markers | `--board 6x9` |
| the markers have Kalibr's border of two cells | they are read with it | `--border-bits 2` |
| the markers are numbered from N | the steps between markers | `--first-id N` |
| the square is in another unit | its size, or a known baseline | `--square-mm`, `--baseline-mm` |
| a symmetric chessboard turned in one camera of a pair | the pair stands otherwise in some views | `--board 9x6` |
| corners by a homography, not by a finder | they are smoothly off the saddle points | `camviz calibrate` |
| the search in a picture does not end | its time is over, and the picture is skipped | `--seconds` |

The first four are the finding `wrong-board`, the others `baseline-scale`, `corner-order` and `interpolated-corners`.
A chessboard has no wrong order of its sides. Whether its views are turned does not matter to one camera alone.

These are rendered by `python benchmarks/doctor.py`. Pictures have 480 to 720 pixels along the longer side and noise of
1 to 8 grey levels. The boards have 4×3 to 10×6 inner corners, and lenses barrel distortion up to k1 = -0.4. Healthy
sets are ChArUco boards, whole and in part, chessboards, AprilGrids, grids of circles, and pairs.

| board | named | what else was named |
|---|---|---|
| legacy ChArUco pattern | 50 of 50 | |
| columns and rows swapped | 50 of 50 | |
| border of two cells | 50 of 50 | |
| first id other than 0 | 50 of 50 | |
| square in another unit, 1000 times | 50 of 50 | |
| square in cm or inches, baseline known | 50 of 50 | |
| symmetric board, views turned in a pair | 50 of 50 | |
| corners by a homography | 50 of 50 | |
| a search that does not end | 50 of 50 | |
| healthy, of all kinds | 0 of 48 | |

## Findings
"""
MIDDLE = """\
## How often it is right

Where the theory of least squares gives the chance of a false alarm, the threshold is that chance. It is one in a
million for every F- and χ²-test: `model-too-simple`, `board-warp`, `split-disagreement`, `rolling-shutter` and
`views-differ`. It is also one of the two limits of `views-disagree`. It is one in ten thousand for a whole set of views
with few corners (`outlier-view`).

The chance holds for independent Gaussian noise, and real corners are neither. In a large set, every small error of a
real lens is also beyond chance. So each threshold has a least effect beside it, which decides in practice. Rules about
the numbers of a file have no chance in them.

`split-disagreement` also takes views, and not corners, for the independent units. A drift of the focal length is held
against the focal lengths of single views: a regression on time, by chance once in a thousand. Two halves are held
against cameras of every view's own, a nested analysis of variance with the same limit. Both are then ranked among 500
orders or halves of the same views by lot, and at most one of these may differ more. That holds however the views
scatter. Without an order, halves must be two pixels apart both ways. Of 180 virtual changes in an order that noise
alone would name, these tests lose 3. Of 31 sets with another camera's views mixed in at random they lose 12 (`python
benchmarks/halves.py`).

What a real healthy set looks like is measured on OpenCV's photographs of a global shutter, 13 views by each of two
cameras, two finders and three models. Free velocities explain 0.5 to 0.6 of the noise there, by chance once in 10⁴⁰.
Rows leave at most 1.5 to 2 % less of the squares than columns and diagonals do, and often more. A shutter is named from
3 % on. To first order a shear by rows cannot be told from one by columns. Of 30 shutters of 30 px from the first row
to the last, all were named. Of 8 shutters of 6 px, which leave a quarter of a pixel behind the poses, two were.

No alarm in 120 means a rate below 2.5 % with 95 % confidence (1 - 0.05^(1/120)).
"""


def main() -> None:
    """Write docs/clinic.md."""
    tables = PAGE.read_text(encoding="utf-8").split(TABLES)[1].lstrip()
    if "--page" not in sys.argv:
        tables = count_all(lambda line: print(line, flush=True)) + below(tables)
    PAGE.write_text(page(tables), encoding="utf-8")


if __name__ == "__main__":
    main()
