"""The lessons' exercises: `material/NN/exercises.py` has the references, known mistakes and hints of one lesson's.

from camviz_school.course.exercises import Tutor

check = Tutor()
check("05.distort", distort)
check.hint("05.distort")
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from camviz.views.yours import was_missed
from camviz_school.course.checks import Exercise, Verdict, hint, judge
from camviz_school.course.material import material, module
from camviz_school.course.plots import tell_plots

LOOK = " Look at the picture below: your function draws it now."
RUN_AGAIN = " Run the cell of the plot below again: it waited for your function."
"""Said after praise where a view, and where a plot waited for the function."""


class Tutor:
    """Checks exercises for one notebook and remembers how often each was tried, so that its hints grow stronger.

    A right function is given at once to the views that were made before it was (camviz.widgets.waiting). It is what
    every lesson begins with: from then on the notebook's plots are shown with words (camviz_school.course.plots).
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
        return self._handed_out(verdict, function) if verdict.correct else verdict

    @staticmethod
    def _handed_out(verdict: Verdict, function: Any) -> Verdict:
        """The verdict on a right function, once the views that wait for it are drawn with it: it says where to look."""
        from camviz.widgets.waiting import hand_out  # the widgets take a second to load, and a notebook has them

        look = LOOK if hand_out(function) else ""
        again = RUN_AGAIN if was_missed(function) else ""
        return replace(verdict, message=f"{verdict.message}{look}{again}")

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
