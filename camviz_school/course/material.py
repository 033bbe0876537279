"""Where the lessons are, and what belongs to one of them alone: `material/NN` beside the notebooks.

A lesson's folder holds its `lesson.toml` (camviz_school.course.catalogue), its `questions.toml`, its `exercises.py`,
the teacher's `plan.toml`, its own terms for the glossary in `glossary.toml`, and the views and other modules that only
that lesson needs, which are imported from `camviz_school.views`.
"""

from __future__ import annotations

import sys
from functools import lru_cache
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

import camviz_school

MATERIAL = "material"
"""The folder beside the notebooks that is no lesson."""


def checkout_lessons() -> Path | None:
    """The lessons folder of the source checkout that this package runs from; None when it is installed."""
    root = Path(camviz_school.__file__).parents[1]
    lessons = root / "lessons"
    return lessons if lessons.is_dir() and (root / "pyproject.toml").is_file() else None


def built_site() -> Path | None:
    """The site that `python start.py site` has built, in a checkout; None where there is none."""
    lessons = checkout_lessons()
    built = lessons.parent / "build" / "site" if lessons else None
    return built if built and (built / "index.html").is_file() else None


def lessons_folder() -> Path:
    """Where the lessons are: in the checkout, or inside the installed package."""
    return checkout_lessons() or Path(camviz_school.__file__).with_name("_lessons")


def material(*parts: str) -> Path:
    """The way to a file or a folder of material, such as `material("05", "plan.toml")`, whether it is there or not."""
    return lessons_folder().joinpath(MATERIAL, *parts)


def lesson_paths(folder: Path | None = None) -> list[Path]:
    """The notebooks of the lessons in a folder, by default all lessons, in the order of their numbers."""
    return sorted((folder or lessons_folder()).glob("*.ipynb"))


@lru_cache
def module(lesson: str) -> ModuleType:
    """A lesson's exercises.py. Raises ValueError when it has none."""
    path = material(lesson, "exercises.py")
    if not (lesson.isalnum() and path.is_file()):
        raise ValueError(f"there is no exercises.py in the material of lesson {lesson!r}")
    full_name = f"camviz_lesson_{lesson}.exercises"
    spec = spec_from_file_location(full_name, path)
    assert spec is not None
    assert spec.loader is not None
    loaded = sys.modules[full_name] = module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded
