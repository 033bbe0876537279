"""What a lesson states: a test quotes a sentence and recomputes its number, to half of its last printed digit.

says = claims("05")
says("For k1 = −0.3 this is 1/√0.9 = **1.054**")
assert 1 / np.sqrt(3 * 0.3) == approx(1.054, abs=5e-4)
"""

from collections.abc import Callable, Iterator
from functools import cache

from camviz_school.course import glossary, material, notebooks, questions


def claims(number: str) -> Callable[..., None]:
    """Return `says(*sentences)`, which asserts that each sentence stands in the lesson ("05") of that number."""

    def says(*sentences: str) -> None:
        for sentence in map(_plain, sentences):
            assert any(sentence in text for text in _texts(number)), f"lesson {number} does not say {sentence!r}"

    return says


def _plain(text: str) -> str:  # on one line, without the asterisks of emphasis
    return " ".join(text.replace("*", "").split())


@cache
def _texts(number: str) -> tuple[str, ...]:
    return tuple(map(_plain, _passages(number)))


def _passages(number: str) -> Iterator[str]:
    """Yield the lesson's Markdown cells, its questions with choices and replies, and its terms of the glossary."""
    (path,) = material.lessons_folder().glob(f"{number}_*.ipynb")
    yield from (cell.source for cell in notebooks.read(path).cells if cell.cell_type == "markdown")
    for one in questions.questions(number).values():
        yield from (one.text, *(text for choice in one.choices for text in (choice.text, choice.reply)))
    for term in glossary.glossary().terms:
        yield from (term.sentence, term.formula) if number in term.lessons else ()
