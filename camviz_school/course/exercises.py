"""The lessons' exercises: `material/NN/exercises.py` has the references, known mistakes and hints of one lesson's.

from camviz_school.course.exercises import Tutor

check = Tutor()
check("05.distort", distort)
check.hint("05.distort")
"""

from __future__ import annotations

from typing import Any

import numpy as np

from camviz_school.course.checks import Exercise, Verdict, hint, judge
from camviz_school.course.material import material, module
from camviz_school.course.plots import tell_plots


class Tutor:
    """Checks exercises for one notebook and remembers how often each was tried, so that its hints grow stronger.

    It is what every lesson begins with: from then on the notebook's plots are shown with words
    (camviz_school.course.plots).
    """

    def __init__(self, rng: np.random.Generator | None = None) -> None:
        self._rng = np.random.default_rng() if rng is None else rng
        self._tries: dict[str, int] = {}
        tell_plots()

    def __call__(self, name: str, function: Any) -> Verdict:
        """The verdict on a reader's function for the exercise `name`, such as "05.distort"."""
        tries = self._tries.get(name, 0) + 1
        verdict = judge(exercise(name), function, self._rng, tries)
        if verdict.hint:
            self._tries[name] = tries
        return verdict

    def hint(self, name: str) -> Verdict:
        """The next of the exercise's three hints, without a try."""
        tries = self._tries[name] = self._tries.get(name, 0) + 1
        return Verdict(name, "hint", hint(exercise(name), tries))


def exercise(name: str) -> Exercise:
    """The exercise called "LESSON.NAME". Raises ValueError listing the lesson's exercises when there is none."""
    known = exercises(name.partition(".")[0])
    if name not in known:
        raise ValueError(f"no exercise is called {name!r}; this lesson has {', '.join(known) or 'none'}")
    return known[name]


def exercises(lesson: str) -> dict[str, Exercise]:
    """The exercises of a lesson ("05"), by name and in their order; empty for a lesson without any."""
    if not lesson.isalnum() or not material(lesson, "exercises.py").is_file():
        return {}
    return {one.name: one for one in module(lesson).EXERCISES}
