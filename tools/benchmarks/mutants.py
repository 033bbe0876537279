"""Every mutant of every exercise's solution at many seeds, and which of them an exercise accepts.

    python tools/benchmarks/mutants.py [--seeds 50] [05 06.rms …]

A mutant is a solution with one small change (tests/lessons/mutants.py). Prints, for each exercise, how many there are,
how many are named as no mistake (tests/lessons/equivalent_mutants), and each that is accepted at any seed and is not
named. Fails where there is one. Fifty seeds of all lessons take some eight minutes of one core.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parents[2]), str(Path(__file__).parents[2] / "tests" / "lessons")]

from mutants import named, tally  # noqa: E402
from test_exercises import ALL  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("names", nargs="*", help="lessons (05) or exercises (06.rms); all unless given")
    options = parser.parse_args()
    mutants = open_ones = 0
    for one in ALL:
        if options.names and not any(one.name.startswith(name) for name in options.names):
            continue
        found = tally(one, range(options.seeds))
        missed = {change: times for change, times in found.accepted.items() if change not in named(one)}
        mutants, open_ones = mutants + found.mutants, open_ones + len(missed) + len(found.unneeded)
        print(f"{one.name}: {found.mutants} mutants, {len(named(one))} named, {len(missed)} accepted", flush=True)
        for change, times in missed.items():
            print(f"    at {times} of {options.seeds} seeds: {change}")
        for change in found.unneeded:
            print(f"    refused, though a table calls a term in it never negative: {change}")
    print(f"{mutants} mutants × {options.seeds} seeds, {open_ones} accepted without a reason")
    return bool(open_ones)


if __name__ == "__main__":
    sys.exit(main())
