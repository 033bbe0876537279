"""Every number of a lesson with a file test_NN_*.py is recomputed there, or stands in its list of exceptions."""

import importlib

import pytest
from quoting import HERE, LESSONS, NOT_STATED, Passage, Said, numbers_in, numbers_left, passages, plain, quotations

HELD = sorted(path.name for path in HERE.glob("test_[0-9][0-9]_*.py"))
MOST_EXCEPTIONS = 0.05


def test_every_lesson_has_its_test_file():
    claims = {path.stem.removeprefix("test_claims_") for path in HERE.glob("test_claims_*.py")}
    assert claims | {name.split("_")[1] for name in HELD} == {path.name[:2] for path in LESSONS.glob("*.ipynb")}


@pytest.mark.parametrize("name", HELD)
def test_every_number_in_the_prose_is_recomputed(name):
    """Write a test that quotes the sentence, `says("…")`, and recomputes its numbers."""
    number = name.split("_")[1]
    exceptions = importlib.import_module(name.removesuffix(".py")).EXCEPTIONS
    held = quotations(number) + tuple(plain(quote) for quote in exceptions)
    left = [(one.where, words) for one in passages(number) for words in numbers_left(one, held)]
    assert not left, "\n".join(f"{where}: {words}" for where, words in left)


@pytest.mark.parametrize("name", HELD)
def test_the_exceptions_are_few_have_reasons_and_are_all_needed(name):
    number = name.split("_")[1]
    exceptions = importlib.import_module(name.removesuffix(".py")).EXCEPTIONS
    assert all(len(reason.split()) > 2 for reason in exceptions.values())
    every = sum(len(numbers_in(one.text)) for one in passages(number))
    excepted = sum(len(numbers_in(plain(quote))) for quote in exceptions)
    assert excepted <= MOST_EXCEPTIONS * every, f"{excepted} exceptions among {every} numbers"
    for quote in exceptions:
        assert any(plain(quote) in one.text for one in passages(number)), f"{quote!r} is not said any more"
        assert not any(plain(quote) in one for one in quotations(number)), f"{quote!r} is recomputed by now"


@pytest.mark.parametrize(
    ("text", "numbers"),
    [
        ("k1 = −0.3 folds at 1/√0.9 = 1.054, that is 46.5°", ["−0.3", "1", "0.9", "1.054", "46.5"]),
        ("from 5–95 % of 30,000 e⁻ in 3D, r² and x_1", ["5", "95", "30,000"]),
        ("9−5 is 4, (2)-1 too, and −2 is negative", ["9", "5", "4", "2", "1", "−2"]),
        ("2e-13 px in 12×8 squares", ["2e-13", "12", "8"]),
        ("100,000, and 30,000", ["100,000", "30,000"]),
    ],
)
def test_numbers_are_found_as_they_are_written(text, numbers):
    assert numbers_in(text) == numbers


def test_only_what_states_nothing_is_left_out():
    from quoting import _stated

    text = (
        "# 5 · A `k1 = 3` and $r^2 = 4$\n## Exercise 2: [05 Lens distortion](05.ipynb#6)\n"
        "Brown (1971), in 1966, section 7.4, ISO 12233: 1 + 3 k1 r² at 2000 K, 640 × 480 px and 3 points."
    )
    assert numbers_in(_stated(text)) == ["2000", "640", "480", "3"]
    assert numbers_in(_stated("views 25 mm apart in view 2; 1e-6 off")) == ["25", "1e-6"]
    assert all(reason for _, reason in NOT_STATED)


def test_a_number_outside_every_quotation_is_left():
    passage = Passage("cell 1", "The fold is at 1.054, and the image ends at 0.703.")
    assert numbers_left(passage, ("fold is at 1.054",)) == ["fold is at 1.054, and the image ends at 0.703."]
    assert numbers_left(passage, (passage.text,)) == []


def test_a_number_is_compared_to_the_digits_it_is_printed_with():
    assert Said("1.054") == 1.05409
    assert Said("1.054") != 1.0546
    assert Said("60") == 59.6
    assert Said("−1.5e-3") == -0.00154
    assert Said("30,000") == 30000
    assert Said("200").about(190)
    assert not Said("200").about(150)
