"""Every exercise refuses its own solution with one small change, or equivalent_mutants/NN.toml says why it may not."""

import ast

import pytest
from mutants import TABLES, approaches, named, never_negative, tally
from mutation import mutants
from test_exercises import EACH, HELD


@pytest.mark.sampled(12)
@EACH
def test_every_mutant_of_the_solution_is_refused_or_named_as_equivalent(one, thorough):
    seeds = range(50 if thorough else 1)
    found = tally(one, seeds)
    print(f"{one.name}: {found.mutants} mutants × {len(seeds)} seeds, {len(found.accepted)} accepted and named")
    always = {change for change, times in found.accepted.items() if times == len(seeds)}
    assert sorted(always - set(named(one))) == [], "accepted, though nobody says why"
    assert sorted(set(named(one)) - always) == [], "named as accepted, and is refused or no mutant any more"
    assert sorted(found.approached) == sorted(approaches(one)), "no line of the solution"
    assert all(found.approached.values()), f"every change of a line is refused: {found.approached}"
    assert found.unneeded == [], f"the absolute value of one of {never_negative(one)} is refused"


CODE = """
def f(x, k):
    r = np.sqrt(x**2 + k)
    r = r - 1
    return np.where(x > 0, np.sum(r, axis=-1, keepdims=True), x.T @ k)
"""


@pytest.mark.parametrize(
    "change",
    [
        "r = np.sqrt(x ** 2 - k)",  # an operator
        "r = np.sqrt(x ** 2)",  # a term
        "r = np.sqrt(k ** 2 + k)",  # an argument
        "r = np.sqrt(x ** 3 + k)",  # a constant
        "r = x ** 2 + k",  # a function
        "without r = r - 1",  # a statement
        "r = 1 - r",  # a sign
        "return np.where(x >= 0, np.sum(r, axis=-1, keepdims=True), x.T @ k)",
        "return np.where(x < 0, np.sum(r, axis=-1, keepdims=True), x.T @ k)",
        "return np.where(x > 0, np.sum(r, axis=None, keepdims=True), x.T @ k)",
        "return np.where(x > 0, np.sum(r, axis=-1), x.T @ k)",
        "return np.where(x > 0, np.sum(np.maximum(r, 0), axis=-1, keepdims=True), x.T @ k)",
        "return np.where(x > 0, np.sum(np.abs(r), axis=-1, keepdims=True), x.T @ k)",
        "return np.where(x > 0, np.sum(r, axis=-1, keepdims=True), x @ k)",
        "return np.where(x > 0, np.sum(r, axis=-1, keepdims=True), k @ x.T)",
        "the first answer again and again",
    ],
)
def test_each_kind_of_slip_is_among_the_mutants(change):
    made = list(mutants(CODE, "f", ["x", "k"], []))
    assert change in {mutant.change for mutant in made}
    assert len({mutant.source for mutant in made}) == len(made)
    assert CODE.strip() not in {ast.unparse(ast.parse(mutant.source)) for mutant in made}


def test_what_is_the_same_by_the_code_alone_is_no_mutant_and_what_a_table_declares_is_marked():
    made = {mutant.change: mutant for mutant in mutants(CODE, "f", ["x", "k"], ["k"])}
    assert "r = np.sqrt((-x) ** 2 + k)" not in made
    assert "r = np.sqrt(np.abs(x ** 2) + k)" not in made
    assert made["r = np.sqrt(x ** 2 + np.abs(k))"].declared
    assert made["r = np.sqrt(np.maximum(x ** 2 + k, 0))"].declared
    assert not made["return np.where(x > 0, np.sum(np.abs(r), axis=-1, keepdims=True), x.T @ k)"].declared


def test_the_tables_are_of_lessons_and_their_exercises():
    assert {path.stem for path in TABLES.glob("*.toml")} <= set(HELD)
