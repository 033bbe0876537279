"""camviz_school: what lessons and classes need. It stands on camviz, and on the clinic where a lesson visits it.

    course     exercises and their checkers, questions, the glossary, the notebooks themselves
    widgets    `ask` and `quiz`: a question in a notebook
    views      the visualizers that one lesson alone uses; their files are in lessons/material
    teaching   a teacher's edition: plans, keys, sheets, slides
    room       a class that votes
    record     widgets that answer without a kernel, for pages
    samples    published photographs and calibrations, fetched once
    commands   what `camviz` does for learners and teachers

The name below is imported when it is first used.
"""

from importlib import import_module
from typing import Any

__all__ = ["join"]


def __getattr__(name: str) -> Any:
    if name == "join":
        return import_module("camviz_school.room.membership").join
    raise AttributeError(f"module 'camviz_school' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
