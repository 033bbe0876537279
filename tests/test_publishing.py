"""What a package index, conda-forge, GitHub and a container need is here, and says the same everywhere."""

import re
import tomllib
from pathlib import Path

import pytest
import yaml
from hatchling.metadata.core import ProjectMetadata
from hatchling.plugin.manager import PluginManager
from packaging.requirements import Requirement

from camviz.scenes.photographs import PHOTOGRAPHS, photograph_credit
from camviz_school import samples

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
REPOSITORY = "https://github.com/camviz/camviz"
LINK = re.compile(r"\]\(([^)\s]+)\)")


def text(path: str) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def shown(path: str) -> dict:
    return yaml.safe_load(text(path))


@pytest.fixture(scope="module")
def described() -> str:
    """The README as the package index shows it."""
    return ProjectMetadata(str(ROOT), PluginManager()).core.readme


def test_the_readme_leads_from_a_package_index_to_the_files_of_its_release(described: str) -> None:
    here, there = (LINK.findall(each) for each in (text("README.md"), described))
    tag, raw = f"v{PROJECT['version']}", "https://raw.githubusercontent.com/camviz/camviz"
    bases = (f"{REPOSITORY}/blob/{tag}/", f"{raw}/{tag}/")
    assert len(here) == len(there)
    for before, after in zip(here, there, strict=True):
        assert after == before if "://" in before else after in [base + before for base in bases]
        if not before.startswith("https://"):
            assert after.startswith(bases[1]) == before.endswith((".svg", ".webp"))
    assert "<img" not in described


def test_the_project_names_its_places_and_all_say_the_same() -> None:
    urls = PROJECT["urls"]
    assert {"Homepage", "Documentation", "Repository", "Issues", "Changelog"} <= set(urls)
    citation = shown("CITATION.cff")
    assert citation["repository-code"] == urls["Repository"] == REPOSITORY
    assert citation["url"] == urls["Documentation"]
    assert "https://github.com/TRI-ML/camviz" in text("README.md")


def test_the_citation_has_what_its_format_asks_for() -> None:
    citation = shown("CITATION.cff")
    assert {"cff-version", "title", "message", "type", "authors", "version", "date-released", "license"} <= set(
        citation
    )
    assert citation["license"] == ["Apache-2.0", "CC-BY-4.0"]
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", str(citation["date-released"]))


def test_the_recipe_for_conda_has_the_dependencies_of_the_package() -> None:
    recipe = shown("tools/recipe/recipe.yaml")
    names = {"opencv-contrib-python-headless": "py-opencv", "PyYAML": "pyyaml"}
    wanted = {f"python {PROJECT['requires-python']}"}
    for each in map(Requirement, PROJECT["dependencies"]):
        wanted.add(f"{names.get(each.name, each.name)} {each.specifier}".replace("4.10.0.84", "4.10.0"))
    assert set(recipe["requirements"]["run"]) == wanted
    assert recipe["context"]["version"] == PROJECT["version"]
    (entry,) = recipe["build"]["python"]["entry_points"]
    assert entry == f"camviz = {PROJECT['scripts']['camviz']}"


def test_the_container_takes_the_readers_lock_and_starts_the_lessons() -> None:
    steps = text("tools/deploy/Dockerfile")
    assert "pip install --no-cache-dir --require-hashes -r requirements.lock" in steps
    assert "COPY tools/locks/requirements.lock ." in steps
    assert "--no-deps --no-build-isolation --editable ." in steps
    for library in text("binder/apt.txt").split():
        assert f" {library} " in steps
    assert f"FROM python:{text('binder/runtime.txt').strip().removeprefix('python-')}-" in steps
    assert 'CMD ["camviz", "lab"' in steps


def test_a_release_is_built_checked_and_published_without_a_password() -> None:
    jobs = shown(".github/workflows/release.yml")["jobs"]
    commands = [step.get("run", "") for step in jobs["build"]["steps"]]
    order = [next(i for i, run in enumerate(commands) if part in run) for part in ("-m build", "twine check --strict")]
    assert order == sorted(order)
    assert jobs["publish"]["needs"] == "build"
    assert jobs["publish"]["permissions"] == {"id-token": "write"}
    assert "secrets." not in text(".github/workflows/release.yml")


FORMS = sorted(path for path in (ROOT / ".github/ISSUE_TEMPLATE").glob("*.yml") if path.stem != "config")


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_a_form_for_issues_has_what_github_asks_for(path: Path) -> None:
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert form["name"]
    assert form["description"]
    ids = [part["id"] for part in form["body"]]
    assert len(set(ids)) == len(ids)
    assert all(part["type"] in ("input", "textarea") and part["attributes"]["label"] for part in form["body"])


@pytest.mark.parametrize("name", PHOTOGRAPHS)
def test_every_photograph_is_credited_with_its_licence(name: str) -> None:
    what, licence = photograph_credit(name).removesuffix(". From scikit-image's data folder.").rsplit("; ", 1)
    (row,) = (line for line in text("lessons/CREDITS.md").splitlines() if line.startswith(f"| `{name}` |"))
    assert what in row
    assert row.endswith(f"| {licence} |")


def test_the_map_of_the_earth_is_credited_where_it_is_named_and_where_it_is_seen() -> None:
    credit = samples.earth_map(64)
    if not credit.real:
        pytest.skip(credit.sentence)
    assert "Solar System Scope, CC BY 4.0" in credit.sentence
    assert credit.sentence in text("lessons/10_omnidirectional.ipynb")
    (row,) = (line for line in text("lessons/CREDITS.md").splitlines() if "2k_earth_daymap.jpg" in line)
    assert row.endswith("| CC BY 4.0 |")
    assert "Solar System Scope" in row


def test_the_table_of_front_ends_says_what_was_tried_and_where_ci_sees_it() -> None:
    rows = [line.strip("|").split("|") for line in text("docs/front-ends.md").splitlines() if line.startswith("| ")][1:]
    found = {cells[0].strip(): cells[2].strip() for cells in rows}
    assert {"Notebook 7", "Voila", "VS Code", "Colab", "marimo", "nbconvert, HTML", "GitHub"} <= set(found)
    for name, _, came, known in rows:
        assert "not tried" in came or "in CI" in known or "tried by hand" in known, name
