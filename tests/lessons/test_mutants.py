"""Every exercise refuses its own solution with one small change, or equivalent_mutants/NN.toml says why it may not."""

from mutants import TABLES, approaches, named, never_negative, tally
from test_exercises import EACH, HELD


@EACH
def test_every_mutant_of_the_solution_is_refused_or_named_as_equivalent(one, thorough):
    seeds = range(50 if thorough else 2)
    found = tally(one, seeds)
    print(f"{one.name}: {found.mutants} mutants × {len(seeds)} seeds, {len(found.accepted)} accepted and named")
    always = {change for change, times in found.accepted.items() if times == len(seeds)}
    assert sorted(always - set(named(one))) == [], "accepted, though nobody says why"
    assert sorted(set(named(one)) - always) == [], "named as accepted, and is refused or no mutant any more"
    assert sorted(found.approached) == sorted(approaches(one)), "no line of the solution"
    assert all(found.approached.values()), f"every change of a line is refused: {found.approached}"
    assert found.unneeded == [], f"the absolute value of one of {never_negative(one)} is refused"


def test_the_tables_are_of_lessons_and_their_exercises():
    assert {path.stem for path in TABLES.glob("*.toml")} <= set(HELD)
