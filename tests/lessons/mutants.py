"""Small changes of an exercise's own solution, each of which the exercise has to refuse or somebody has to explain.

mutation.py makes them. `equivalent_mutants/NN.toml` names those that are no mistake, and why.
"""

from __future__ import annotations

import tomllib
import warnings
from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from mutation import mutants

from camviz_school.course import notebooks
from camviz_school.course.checks import judge
from camviz_school.course.material import lessons_folder
from camviz_school.course.trials import Exercise, quiet

TABLES = Path(__file__).parent / "equivalent_mutants"

# What is equivalent, and says so -------------------------------------------------------------------------------------


@cache
def _table(lesson: str) -> dict[str, Any]:
    path = TABLES / f"{lesson}.toml"
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}


def named(exercise: Exercise) -> dict[str, str]:
    """The reason for each change of the solution that is no mistake."""
    rows = _table(exercise.name.partition(".")[0]).get("equivalent", [])
    mine = [row for row in rows if row["exercise"] == exercise.name]
    return {line: row["reason"] for row in mine for line in row.get("lines", [])}


def approaches(exercise: Exercise) -> dict[str, str]:
    """The reason for each line of the solution in which it does not matter by which steps the answer is approached."""
    rows = _table(exercise.name.partition(".")[0]).get("equivalent", [])
    return {row["of"]: row["reason"] for row in rows if row["exercise"] == exercise.name and "of" in row}


def never_negative(exercise: Exercise) -> list[str]:
    """The parameters, names and terms of the solution that are never negative in what the task's text asks for."""
    return _table(exercise.name.partition(".")[0]).get("never_negative", {}).get(exercise.name, [])


# What a mutant does --------------------------------------------------------------------------------------------------


@cache
def _lesson(number: str) -> tuple[dict[str, str], dict[str, Any]]:
    """The solutions of a lesson, and what its cells define for them."""
    (path,) = lessons_folder().glob(f"{number}_*.ipynb")
    notebook = notebooks.read(path)
    solutions = notebooks.solutions(notebook)
    namespace: dict[str, Any] = {"np": np, "__name__": "lesson"}
    for cell in notebook.cells:
        if "build" in cell.metadata.get("tags", []):
            exec(cell.source, namespace)
        elif "stub" in cell.metadata.get("tags", []):
            exec(solutions[notebooks.exercise_of(cell)], namespace)
    return solutions, namespace


def solution_of(exercise: Exercise) -> str:
    """The code of the folded solution in the exercise's notebook."""
    return _lesson(exercise.name.partition(".")[0])[0][exercise.name]


def function_of(exercise: Exercise, source: str) -> Callable[..., Any]:
    """The exercise's function as some code defines it, among what the lesson defines for it."""
    namespace = dict(_lesson(exercise.name.partition(".")[0])[1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SyntaxWarning)
        code = compile(source, f"<mutant of {exercise.name}>", "exec")
    exec(code, namespace)
    return namespace[exercise.name.partition(".")[2]]


class Jury:
    """Whether a checker accepts a function, at one seed; the right answers are worked out once for all functions."""

    def __init__(self, exercise: Exercise, seed: int) -> None:
        self.exercise, self.seed = exercise, seed
        self.cases = list(exercise.cases(np.random.default_rng(seed)))
        self.answers = [exercise.answer(case) for case in self.cases]

    def accepts(self, function: Callable[..., Any]) -> bool:
        """What `judge` says. One answer that does not agree is enough for "wrong", and saves the rest."""
        fits = all(self._fits(function, *pair) for pair in zip(self.cases, self.answers, strict=True))
        return fits and judge(self.exercise, function, np.random.default_rng(self.seed)).correct

    def _fits(self, function: Callable[..., Any], case: tuple[Any, ...], answer: tuple[Any, ...]) -> bool:
        try:
            with quiet():
                result = self.exercise.normalised(function(*deepcopy(case)))
        except Exception:  # a mutant may raise whatever it likes: it is refused
            return False
        return self.exercise.same(result, answer)


@dataclass
class Tally:
    """How many mutants there are, and at how many seeds those are accepted that are accepted at all.

    `approached` counts the accepted changes of each line that only says how the answer is approached. `unneeded` are
    mutants that a table calls no mistake because a term is never negative, and that are refused.
    """

    mutants: int = 0
    accepted: dict[str, int] = field(default_factory=dict)
    approached: dict[str, int] = field(default_factory=dict)
    unneeded: list[str] = field(default_factory=list)


def tally(exercise: Exercise, seeds: range) -> Tally:
    """What the checker says of all mutants at all seeds."""
    juries = [Jury(exercise, seed) for seed in seeds]
    found = Tally()
    _, _, name = exercise.name.partition(".")
    for mutant in mutants(solution_of(exercise), name, exercise.parameters, never_negative(exercise)):
        found.mutants += 1
        times = sum(jury.accepts(function_of(exercise, mutant.source)) for jury in juries)
        if mutant.line in approaches(exercise):
            found.approached[mutant.line] = found.approached.get(mutant.line, 0) + bool(times)
        elif mutant.declared and times < len(seeds):
            found.unneeded.append(mutant.change)
        elif times and not mutant.declared:
            found.accepted[mutant.change] = max(times, found.accepted.get(mutant.change, 0))
    return found
