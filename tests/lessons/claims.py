"""What a lesson states, so that a test can quote a sentence and recompute its number.

def test_the_fold():
    says = claims("05")
    says("For k1 = −0.3 the fold is at r = 1.054")
    assert 1 / np.sqrt(3 * 0.3) == approx(1.054, abs=5e-4)  # half of the last printed digit
"""

from collections.abc import Callable, Iterator
from functools import cache

from camviz_school.course import glossary, material, notebooks, questions


def claims(number: str) -> Callable[[str], None]:
    """Return `says(sentence)`, which asserts that the sentence stands in the lesson ("05") of that number."""

    def says(sentence: str) -> None:
        assert any(_plain(sentence) in text for text in _texts(number)), f"lesson {number} does not say {sentence!r}"

    return says


def _plain(text: str) -> str:
    """Return the text on one line, without the asterisks of emphasis."""
    return " ".join(text.replace("*", "").split())


@cache
def _texts(number: str) -> tuple[str, ...]:
    return tuple(map(_plain, _passages(number)))


def _passages(number: str) -> Iterator[str]:
    """Yield the lesson's Markdown cells, its questions with choices and replies, and its terms of the glossary."""
    (path,) = (path for path in material.lesson_paths() if path.name.startswith(number))
    yield from (cell.source for cell in notebooks.read(path).cells if cell.cell_type == "markdown")
    for one in questions.questions(number).values():
        yield from (one.text, *(text for choice in one.choices for text in (choice.text, choice.reply)))
    for term in glossary.glossary().terms:
        yield from (term.sentence, term.formula) if number in term.lessons else ()
