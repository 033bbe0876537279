"""The repository keeps its promises: light imports, a lock without hosts, live links, a Binder that builds."""

import os
import re
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from importlib import import_module
from itertools import chain
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).resolve().parent.parent
LOCKS = ("requirements.lock", "requirements-site.lock", "requirements-test.lock")
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)|(?:src|href)=\"([^\"#]+)\"")


def python(code: str) -> str:
    """What a fresh interpreter prints for `code`."""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_import_of_camviz_loads_not_even_numpy() -> None:
    assert python("import sys, camviz; print('numpy' in sys.modules)").strip() == "False"


def first_cells() -> set[str]:
    """The setup cell of every lesson, each different one once."""
    notebooks = (nbformat.read(path, 4) for path in (ROOT / "lessons").glob("*.ipynb"))
    cells = chain.from_iterable(notebook.cells for notebook in notebooks)
    return {cell.source for cell in cells if "setup" in cell.metadata.get("tags", [])}


@pytest.mark.parametrize("code", sorted(first_cells()))
def test_a_lesson_begins_with_scipys_rotations_and_without_its_solvers(code: str) -> None:
    parts = ("scipy.spatial", "scipy.optimize", "scipy.stats", "scipy.signal", "scipy.interpolate")
    loaded = f"print(*[name for name in {parts} if name in sys.modules])"
    assert python(f"{code}\nimport sys; {loaded}").split() == ["scipy.spatial"]


def test_camviz_leaves_numpy_as_it_found_it() -> None:
    code = "import numpy; before = dir(numpy), list(numpy.__all__); import camviz.poses; "
    code += "print(before == (dir(numpy), numpy.__all__), numpy.ma.sum([1, 2]))"
    assert python(code).split() == ["True", "3"]


def test_every_public_name_of_camviz_can_be_had() -> None:
    assert python("import camviz; [getattr(camviz, name) for name in camviz.__all__]") == ""


def test_the_first_floors_modules_are_had_from_the_package_itself() -> None:
    assert (
        python("import camviz; print(camviz.lenses.Perspective.__name__, 'explore' in dir(camviz))")
        == "Perspective True\n"
    )


@pytest.mark.parametrize("name", LOCKS)
def test_the_lock_pins_every_dependency_with_hashes_and_names_no_host(name: str) -> None:
    lock = (ROOT / "tools/locks" / name).read_text()
    assert "://" not in lock
    assert not re.search(r"^\s*-[a-z-]", lock.replace("--hash=", ""), flags=re.MULTILINE)
    entries = re.split(r"\n(?=\S)", lock.strip())
    assert [entry.split()[0] for entry in entries if "==" not in entry or "--hash=sha256:" not in entry] == []


def test_the_lock_covers_every_dependency_that_the_package_declares() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    declared = chain(project["dependencies"], *project["optional-dependencies"].values())
    names = {re.match(r"[\w.-]+", one)[0].lower().replace("_", "-") for one in declared} - {"camviz"}  # type: ignore[index]
    locks = (
        set(re.findall(r"^([\w.-]+)==", (ROOT / "tools/locks" / name).read_text(), flags=re.MULTILINE))
        for name in LOCKS
    )
    reader, site, tester = locks
    assert names <= reader | site | tester
    assert {"jupyterlab", "vtk", "hatchling", "editables"} <= reader
    assert {"pytest", "playwright", "mypy"} <= tester
    assert {"sphinx", "myst-nb", "pydata-sphinx-theme"} <= site
    assert not (reader | site) & tester
    assert not reader & site


def test_light_leaves_out_what_draws_solid_3d_and_nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(ROOT)
    start = import_module("start")
    monkeypatch.setattr(start, "VENV", tmp_path)
    (light,) = start.locked("light")
    names = [set(re.findall(r"^([\w.-]+)==", lock.read_text(), flags=re.MULTILINE)) for lock in (start.READER, light)]
    assert names[0] - names[1] == {"vtk", "pyvista"}
    assert not names[1] - names[0]
    assert start.locked("site") == [start.READER, start.SITE]
    assert start.locked("test") == [start.READER, start.SITE, start.TESTER]


def test_ci_names_every_action_by_its_commit() -> None:
    workflows = [path.read_text() for path in (ROOT / ".github/workflows").glob("*.yml")]
    used = re.findall(r"uses: (\S+)", "".join(workflows))
    assert used
    assert [each for each in used if not re.fullmatch(r"[\w/-]+@[0-9a-f]{40}", each)] == []


PAGES = chain.from_iterable(
    map(ROOT.glob, ("*.md", ".github/*.md", "docs/**/*.md", "lessons/*.md", "tools/deploy/*.md"))
)


@pytest.mark.parametrize("page", sorted(path.relative_to(ROOT).as_posix() for path in PAGES))
def test_links_and_pictures_of_a_page_lead_to_files_that_exist(page: str) -> None:
    text = re.sub(r"```.*?```", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL)
    targets = [first or second for first, second in LINK.findall(text)]
    local = [target for target in targets if "://" not in target and not target.startswith("mailto:")]
    assert [target for target in local if not ((ROOT / page).parent / target).exists()] == []


def test_repo2docker_builds_binder_with_the_libraries_that_3d_needs() -> None:
    """Asked for the Dockerfile only (no Docker, no network), it takes our Python, libraries, package and start."""
    command = [
        sys.executable,
        "-m",
        "repo2docker",
        "--no-build",
        "--debug",
        "--user-id",
        "1000",
        "--user-name",
        "reader",
        ".",
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    dockerfile = done.stdout + done.stderr
    assert done.returncode == 0, dockerfile
    python_version = (ROOT / "binder/runtime.txt").read_text().strip().removeprefix("python-")
    assert f"environment.py-{python_version}" in dockerfile.replace("-2d", "-").replace("-2e", ".")
    assert "apt-get install --yes --no-install-recommends libcairo2 libegl1 libgl1" in dockerfile
    assert 'pip install --no-cache-dir -r "binder/requirements.txt"' in dockerfile
    assert "./binder/postBuild" in dockerfile
    assert 'R2D_ENTRYPOINT="${REPO_DIR}/binder/start"' in dockerfile


def test_binder_starts_the_server_with_vtk_drawing_off_screen() -> None:
    start = ROOT / "binder/start"
    assert os.access(start, os.X_OK)
    shown = subprocess.run(
        [start, "printenv", "VTK_DEFAULT_OPENGL_WINDOW"],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": os.environ["PATH"]},
    )
    assert shown.stdout == "vtkEGLRenderWindow\n"


def test_start_says_in_one_sentence_what_it_does() -> None:
    shown = subprocess.run([sys.executable, "start.py", "--help"], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "python start.py test" in shown.stdout


def test_the_version_is_the_same_everywhere() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(), flags=re.MULTILINE)
    assert cited
    assert cited[1] == project["version"] == python("import camviz; print(camviz.__version__)").strip()


def test_the_top_level_is_small() -> None:
    """What a newcomer sees first: the three packages, the lessons, and little beside them."""
    made = [line.rstrip("/") for line in (ROOT / ".gitignore").read_text().splitlines()]
    names = sorted(path.name for path in ROOT.iterdir() if not path.name.startswith("."))
    shown = [name for name in names if not any(fnmatch(name, pattern) for pattern in made)]
    assert len(shown) <= 14, shown
