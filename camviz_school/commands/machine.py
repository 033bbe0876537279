"""What this machine can do: each finding says what was found, whether that will do, and what to do if not."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from typing import Literal
from urllib.request import Request, urlopen

from packaging.requirements import Requirement

from camviz_clinic.commands import entry
from camviz_school import server

Status = Literal["ok", "warn", "missing"]
OLDEST_PYTHON = (3, 11)
ENOUGH_MEMORY = 10**9  # bytes: JupyterLab, a browser tab and one lesson drawn solid
WIDGET_EXTENSIONS = {"@jupyter-widgets/jupyterlab-manager": "jupyterlab_widgets", "anywidget": "anywidget"}
OPENCV = "opencv-contrib-python-headless"
OPENCV_WHEELS = frozenset(f"opencv-{kind}python{head}" for kind in ("", "contrib-") for head in ("", "-headless"))
OPENCV_FUNCTIONS = (
    "omnidir.calibrate",
    "ximgproc.createDisparityWLSFilter",
    "aruco.CharucoDetector",
    "fisheye.calibrate",
    "mcc.CCheckerDetector",
    "findChessboardCornersSB",
)
EXTRAS = {"": "missing", "lab": "warn"}  # what it means that a package of this extra is not there


@dataclass(frozen=True)
class ReportLine:
    """One line of the report. `remedy` is empty when all is well."""

    name: str
    status: Status
    detail: str
    remedy: str = ""


def examine() -> list[ReportLine]:
    """Everything, in the order of the report. Takes some seconds where OpenGL is tried."""
    packages = [package(requirement, extra) for extra, requirement in requirements()]
    return [
        python(),
        namesake(),
        *packages,
        opencv(),
        *widgets(),
        promptness(),
        renderer(),
        opengl(),
        memory(),
        samples(),
    ]


def as_text(findings: list[ReportLine]) -> str:
    """A report for people: one line for each finding, with the remedy under it."""
    width = max(len(finding.name) for finding in findings)
    lines = []
    for finding in findings:
        lines.append(f"{finding.status:8}{finding.name:{width + 2}}{finding.detail}")
        if finding.remedy:
            lines.append(f"{'':8}{'':{width + 2}}→ {finding.remedy}")
    return "\n".join([*lines, "", _summary(findings)])


def as_json(findings: list[ReportLine]) -> str:
    """A report for programs."""
    good = all(finding.status != "missing" for finding in findings)
    return json.dumps({"ok": good, "findings": [asdict(finding) for finding in findings]}, indent=2, allow_nan=False)


def _summary(findings: list[ReportLine]) -> str:
    missing = sum(finding.status == "missing" for finding in findings)
    warned = sum(finding.status == "warn" for finding in findings)
    if missing:
        return f"{missing} missing: camviz will not work until this is mended."
    return f"Everything needed is here; {warned} could be better." if warned else "Everything is here."


def python() -> ReportLine:
    """The interpreter."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.version_info >= OLDEST_PYTHON:
        return ReportLine("Python", "ok", version)
    return ReportLine("Python", "missing", version, f"install Python {'.'.join(map(str, OLDEST_PYTHON))} or newer")


def namesake() -> ReportLine:
    """Whether another project's package `camviz` hides this one, or writes into its folder."""
    if other := entry.other_package():
        return ReportLine("camviz", "missing", f"another project's package of the same name: {other}", entry.REMEDY)
    if others := entry.other_distributions():
        return ReportLine("camviz", "warn", f"{', '.join(others)} has a package of the same name", entry.REMEDY)
    return ReportLine("camviz", "ok", "no other project of the same name")


def requirements() -> list[tuple[str, Requirement]]:
    """(extra, requirement) of this package, from its metadata or, in a checkout, from pyproject.toml."""
    with suppress(metadata.PackageNotFoundError):
        listed = [Requirement(line) for line in metadata.requires("camviz") or []]
        return [(extra, each) for extra in EXTRAS for each in listed if _belongs(each, extra)]
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {"": project["dependencies"], **project["optional-dependencies"]}
    return [(extra, Requirement(line)) for extra in EXTRAS for line in groups[extra]]


def _belongs(requirement: Requirement, extra: str) -> bool:
    if requirement.marker is None:
        return extra == ""
    return requirement.marker.evaluate({"extra": extra}) and not (extra and requirement.marker.evaluate({"extra": ""}))


def package(requirement: Requirement, extra: str = "") -> ReportLine:
    """Whether a required package is here, in a version that is in range."""
    absent: Status = "warn" if EXTRAS[extra] == "warn" else "missing"
    remedy = f"pip install '{requirement.name}{requirement.specifier}'"
    try:
        version = metadata.version(requirement.name)
    except metadata.PackageNotFoundError:
        if requirement.name.startswith("opencv") and find_spec("cv2"):
            return ReportLine(requirement.name, "warn", "another OpenCV is installed in its place", remedy)
        return ReportLine(requirement.name, absent, "not installed", remedy)
    if requirement.specifier.contains(version, prereleases=True):
        return ReportLine(requirement.name, "ok", version)
    return ReportLine(requirement.name, absent, f"{version}, needs {requirement.specifier}", remedy)


def opencv() -> ReportLine:
    """Whether OpenCV has the functions that camviz calls: of several wheels side by side, the last one's files stay."""
    wheels = sorted(
        {each.metadata["Name"].lower() for each in metadata.distributions() if each.metadata["Name"]} & OPENCV_WHEELS
    )
    program = f"import cv2\nfrom operator import attrgetter\nfor name in {OPENCV_FUNCTIONS}: attrgetter(name)(cv2)"
    tried = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    remedy = f"pip uninstall --yes {' '.join(wheels)}, then pip install --no-deps {OPENCV}"
    if tried.returncode:
        why = (tried.stderr.strip().splitlines() or ["it ended at once"])[-1]
        return ReportLine("OpenCV's functions", "missing", f"{why} (installed: {', '.join(wheels) or 'none'})", remedy)
    if len(wheels) > 1:
        return ReportLine("OpenCV's functions", "warn", f"{', '.join(wheels)} overwrite each other's files", remedy)
    return ReportLine("OpenCV's functions", "ok", "omnidir, ximgproc, aruco, fisheye and mcc answer")


def promptness() -> ReportLine:
    """How a Jupyter server that `camviz lab` does not start sends a slider's pictures without delay."""
    return ReportLine(
        "Jupyter server",
        "ok",
        f"`camviz lab` is prompt; others after `jupyter server extension enable {server.__name__}`",
    )


def widgets() -> Iterator[ReportLine]:
    """Whether JupyterLab will find the browser's half of the widgets."""
    try:
        from jupyter_core.paths import jupyter_path
    except ImportError:
        return
    folders, off = jupyter_path("labextensions"), _disabled()
    for extension, distribution in WIDGET_EXTENSIONS.items():
        yield _widget(extension, distribution, folders, extension in off)


def _disabled() -> set[str]:
    """The extensions that are switched off. A process of its own asks JupyterLab, whose import takes 30 MB."""
    program = (
        "import json, jupyter_core.paths as paths, jupyterlab_server.config as config\n"
        "page = config.get_page_config(paths.jupyter_path('labextensions'))\n"
        "print(json.dumps(page.get('disabledExtensions', [])))"
    )
    asked = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    if asked.returncode:
        return set()
    disabled = json.loads(asked.stdout)  # a list, or truth values by name
    return {name for name in disabled if not isinstance(disabled, dict) or disabled[name]}


def _widget(extension: str, distribution: str, folders: list[str], disabled: bool) -> ReportLine:
    name = f"widgets: {extension}"
    if disabled:
        return ReportLine(name, "warn", "disabled in JupyterLab", f"jupyter labextension enable {extension}")
    if any((Path(folder) / extension / "package.json").is_file() for folder in folders):
        return ReportLine(name, "ok", "JupyterLab finds it")
    remedy = f"pip install --force-reinstall {distribution}, into the environment that JupyterLab runs from"
    return ReportLine(name, "warn", "JupyterLab does not find it", remedy)


def renderer() -> ReportLine:
    """What CAMVIZ_RENDERER asks for."""
    asked = os.environ.get("CAMVIZ_RENDERER")
    if asked in (None, "", "solid", "wire"):
        return ReportLine("CAMVIZ_RENDERER", "ok", asked or "not set: solid where OpenGL works, wireframe elsewhere")
    return ReportLine("CAMVIZ_RENDERER", "warn", f"{asked!r} is no renderer", "set it to solid or wire, or not at all")


def opengl() -> ReportLine:
    """Whether solid 3D can be drawn, tried in another process: without the right libraries the attempt is fatal."""
    from camviz.draw.opengl import opengl_works

    works, answer = opengl_works()
    if works:
        return ReportLine("OpenGL", "ok", f"draws solid 3D ({answer})")
    return ReportLine("OpenGL", "warn", "3D is drawn as wireframes", answer)


def memory() -> ReportLine:
    """Whether there is room for JupyterLab and a lesson."""
    free = _free_memory()
    if free is None:
        return ReportLine("memory", "ok", "this system does not say")
    detail = f"{free / 1e9:.1f} GB free"
    if free >= ENOUGH_MEMORY:
        return ReportLine("memory", "ok", detail)
    return ReportLine(
        "memory", "warn", detail, "close other programs, or set CAMVIZ_RENDERER=wire: it takes 150 MB a lesson"
    )


def _free_memory() -> int | None:
    """Bytes that a new program can have; None where the system does not say."""
    with suppress(ImportError, OSError):  # without /proc
        import psutil  # type: ignore[import-untyped, unused-ignore]

        return int(psutil.virtual_memory().available)
    with suppress(OSError, ValueError, AttributeError):
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    return None


def samples() -> ReportLine:
    """Whether the chessboard photographs are here or can be fetched."""
    from camviz_school.samples import BASE_URL, REGISTRY, SampleUnavailable, local_sample

    try:
        here = sum(local_sample(name) is not None for name in REGISTRY)
    except SampleUnavailable as problem:
        return ReportLine(
            "sample data", "warn", str(problem), "point CAMVIZ_SAMPLES to the published files, or unset it"
        )
    if here == len(REGISTRY):
        return ReportLine("sample data", "ok", f"all {here} files are on this machine")
    if _reachable(BASE_URL + "left01.jpg"):
        return ReportLine("sample data", "ok", f"{here} of {len(REGISTRY)} files here, the rest within reach")
    detail = f"{here} of {len(REGISTRY)} files here, the network is out of reach: the virtual camera's pictures serve"
    return ReportLine("sample data", "warn", detail, "connect once, or let CAMVIZ_SAMPLES name a folder that has them")


def _reachable(url: str) -> bool:
    try:
        with urlopen(Request(url, method="HEAD"), timeout=3):
            return True
    except OSError:
        return False
