"""What thousands of calibrations look like: every lens profile of Gyroflow's users, read and inspected by camviz.

    git clone https://github.com/gyroflow/lens_profiles
    python tools/benchmarks/profiles.py lens_profiles --commit 886fc616           prints the figures
    python tools/benchmarks/profiles.py lens_profiles --commit 886fc616 --page    and writes page and pictures

The profiles are CC0 and are not in this repository. The page is docs/engineers/what-calibrations-look-like.md; it says
no number but those of profiles.json beside this file, which are the ones that were printed.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf, tan
from pathlib import Path
from typing import Any

import numpy as np

from camviz.cameras import Camera
from camviz.distortion import image_corner_radius, valid_region
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.files import CalibrationError, load

ROOT = Path(__file__).resolve().parents[2]
FIGURES = Path(__file__).with_suffix(".json")
PAGE = ROOT / "docs/engineers/what-calibrations-look-like.md"
TEMPLATE = Path(__file__).with_suffix(".template.md")
PICTURES = ROOT / "docs/images"
NEVER_SOLVED = 999  # the RMS that Gyroflow writes where its solver has failed
LOST = 0.01  # of the pixels
SHARES = (5, 25, 50, 75, 95)
WIDTHS = (0.5, 1.0)  # focal lengths from the middle to the corner: narrower, between, wider
RMS_EDGES = [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 5, 10, 20, 50, inf]  # pixels
TIME_EDGES = [*range(0, 42, 2), inf]  # milliseconds


@dataclass(frozen=True)
class Row:
    """One file. Lengths are in pixels, times in milliseconds; what a file does not say is None."""

    refused: str = ""
    traceback: str = ""
    findings: tuple[str, ...] = ()
    lost: float = 0.0  # share of the pixels that have no ray of their own
    fold: str = ""  # the severity of the finding
    limited: bool = False  # whether radial_distortion_limit ends before the fold
    corner: float = 0.0  # focal lengths
    off_centre: float = 0.0  # share of the width
    asymmetrical: bool = False
    rms: float | None = None
    readout: float | None = None
    longer_than_a_frame: bool = False
    pictures: int = 0
    solution: tuple[float, ...] = ()


def row(path: Path) -> Row:
    """What one file is; whatever is no calibration and no sentence is a traceback."""
    try:
        calibration = load(path)
        (camera,) = calibration.cameras.values()
        found = {each.id: each.severity for each in Inspection.of(Evidence(calibration)).findings}
        tree = json.loads(path.read_text(encoding="utf-8"))
        return Row(findings=tuple(sorted(found)), **_folded(camera, found, tree), **_said(tree))
    except CalibrationError as error:
        return Row(refused=str(error).removeprefix(f"{path}: "))
    except Exception as error:  # is what is counted here
        return Row(traceback=f"{path.name}: {type(error).__name__}: {error}")


def _folded(camera: Camera, found: Mapping[str, str], tree: Mapping[str, Any]) -> dict[str, Any]:
    held: dict[str, Any] = {"corner": image_corner_radius(camera.intrinsics)}
    if "fold" in found:
        limit, turn = tree["fisheye_params"].get("radial_distortion_limit") or inf, camera.lens.fold
        ends = turn is not None and turn.angle < np.pi / 2 and limit <= tan(turn.angle)
        lost = 1 - float(valid_region(camera, max(1, camera.intrinsics.width // 256)).mean())
        held |= {"fold": found["fold"], "lost": lost, "limited": bool(ends)}
    return held


def _said(tree: Mapping[str, Any]) -> dict[str, Any]:
    """What the file itself says, read with nothing of camviz."""
    held, size = tree["fisheye_params"], tree["calib_dimension"]
    (fx, _, cx), (_, fy, cy), _ = held["camera_matrix"]
    readout, fps = tree.get("frame_readout_time") or None, tree.get("fps") or 0
    return {
        "off_centre": hypot(cx - size["w"] / 2, cy - size["h"] / 2) / size["w"],
        "asymmetrical": bool(tree.get("asymmetrical")),
        "rms": held.get("RMS_error") or None,
        "readout": readout,
        "longer_than_a_frame": bool(readout and fps and abs(readout) > 1000 / fps),
        "pictures": tree.get("num_images") or 0,
        "solution": (fx, fy, cx, cy, *held["distortion_coeffs"]),
    }


def figures(rows: Iterable[Row]) -> dict[str, Any]:
    """All numbers of the page but those of the run, as they are printed."""
    rows = list(rows)
    read = [each for each in rows if not each.refused and not each.traceback]
    rms = np.array([each.rms for each in read if each.rms and each.rms < NEVER_SOLVED])
    times = np.array([abs(each.readout) for each in read if each.readout])
    return {
        "files": len(rows),
        "read": len(read),
        "refused": len([each for each in rows if each.refused]),
        "reasons": dict(Counter(_kind(each.refused) for each in rows if each.refused).most_common()),
        "tracebacks": len([each for each in rows if each.traceback]),
        "solutions": len({each.solution for each in read}),
        "findings": dict(Counter(id for each in read for id in each.findings).most_common()),
        "fold": _fold_figures(read),
        "rms": _distribution(rms, RMS_EDGES)
        | {"below_half": _share(rms < 0.5), "above_one": _share(rms > 1), "above_five": _share(rms > 5)},
        "readout": _distribution(times, TIME_EDGES)
        | {
            "not_said": len(read) - len(times),
            "from_the_end": len([each for each in read if each.readout and each.readout < 0]),
            "longer_than_a_frame": len([each for each in read if each.longer_than_a_frame]),
        },
        "centre": {
            "asymmetrical": len([each for each in read if each.asymmetrical]),
            "median": _percent(float(np.median([each.off_centre for each in read]))),
            "above_5": _share(np.array([each.off_centre for each in read]) > 0.05),
        },
        "pictures": {
            "median": int(np.median([each.pictures for each in read])),
            "below_ten": _share(np.array([each.pictures for each in read]) < 10),
        },
    }


def _fold_figures(read: list[Row]) -> dict[str, Any]:
    folded = [each for each in read if each.fold]
    bands = zip((0, *WIDTHS), (*WIDTHS, inf), strict=True)
    inside = [[each for each in read if low <= each.corner < high] for low, high in bands]
    return {
        "any": len(folded),
        "share": _percent(len(folded) / len(read)),
        "faults": len([each for each in folded if each.fold == "fault"]),
        "lost_1": len([each for each in folded if each.lost >= LOST]),
        "lost_10": len([each for each in folded if each.lost >= 10 * LOST]),
        "limits": len([each for each in folded if each.limited]),
        "bands": [[len(band), _share(np.array([bool(each.fold) for each in band]))] for band in inside],
    }


def _kind(sentence: str) -> str:
    """A sentence without its numbers, so that equal reasons are counted together."""
    plain = re.sub(r"\[\d+\]", "", sentence)
    return re.sub(r"(?<![A-Za-z0-9])[-+]?\d[\d.]*(e[-+]?\d+)?(?=$|[ ,;])", "…", plain)


def _distribution(values: np.ndarray, edges: list[float]) -> dict[str, Any]:
    counts, _ = np.histogram(values, edges)
    told = {f"p{share}": float(f"{np.percentile(values, share):.3g}") if len(values) else None for share in SHARES}
    return {"count": len(values), **told, "histogram": counts.tolist()}


def _share(mask: np.ndarray) -> str:
    return _percent(float(np.mean(mask))) if len(mask) else "0 %"


def _percent(share: float) -> str:
    """Two digits below 10 %, as a share is read."""
    return f"{100 * share:.1f} %" if 0 < share < 0.1 else f"{100 * share:.0f} %"


def page(held: Mapping[str, Any]) -> str:
    """The template with the figures in place: {fold.share} is held["fold"]["share"]."""

    def told(match: re.Match[str]) -> str:
        value: Any = held
        for key in match[1].split("."):
            value = value[int(key)] if isinstance(value, list) else value[key]
        return f"{value:,}" if isinstance(value, int) else str(value)

    text = TEMPLATE.read_text(encoding="utf-8").replace("{reasons}", _table("why", held["reasons"]))
    return re.sub(r"\{([a-z_0-9.]+)\}", told, text.replace("{found}", _table("finding", held["findings"])))


def _table(head: str, counts: Mapping[str, int]) -> str:
    return "\n".join([f"| {head} | files |", "|---|---|", *(f"| {key} | {count:,} |" for key, count in counts.items())])


def draw(held: Mapping[str, Any]) -> None:
    """The two histograms of the page."""
    _histogram("profiles_rms.svg", held["rms"]["histogram"], RMS_EDGES, "RMS error of the solution, px")
    _histogram("profiles_readout.svg", held["readout"]["histogram"], TIME_EDGES, "read-out of a frame, ms")


def _histogram(name: str, counts: list[int], edges: list[float], title: str) -> None:
    import matplotlib.pyplot as plt

    with plt.rc_context({"svg.hashsalt": name, "font.size": 9}):
        figure, ax = plt.subplots(figsize=(7, 2.6), layout="constrained", facecolor="white")
        bars = ax.bar(range(len(counts)), counts, width=0.92, color="#3b6ea5")
        ax.bar_label(bars, fontsize=7)
        words = [f"{low:g}–{high:g}" if high < inf else f"> {low:g}" for low, high in pairwise(edges)]
        ax.set_xticks(range(len(counts)), words, rotation=45, fontsize=7)
        ax.set(xlabel=title, ylabel="profiles")
        ax.spines[["top", "right"]].set_visible(False)
        figure.savefig(PICTURES / name, metadata={"Date": None})
        plt.close(figure)


def main(words: list[str]) -> int:
    """Prints the figures; the exit status is 1 where a file was neither read nor refused in a sentence."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])  # type: ignore[union-attr]
    parser.add_argument("folder", type=Path, help="the repository's files")
    parser.add_argument("--commit", default="unknown", help="which commit of the repository that is")
    parser.add_argument("--page", action="store_true", help="write the page, its figures and its pictures")
    options = parser.parse_args(words)
    files = sorted(options.folder.rglob("*.json"))
    if not files:
        parser.error(f"{options.folder}: expected lens profiles (*.json), found none")
    start = time.monotonic()
    with ProcessPoolExecutor() as pool:
        rows = list(pool.map(row, files, chunksize=50))
    run = {"commit": options.commit, "cores": os.cpu_count(), "seconds": round(time.monotonic() - start)}
    held = {"run": run, **figures(rows)}
    print(json.dumps(held, indent=2, ensure_ascii=False))
    for each in rows:
        if each.traceback or "\n" in each.refused:
            print(each.traceback or each.refused, file=sys.stderr)
    if options.page:
        FIGURES.write_text(json.dumps(held, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        PAGE.write_text(page(held), encoding="utf-8")
        draw(held)
    return int(bool(held["tracebacks"]) or any("\n" in each.refused for each in rows))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
