"""symptoms.md: `python docs/engineers/symptoms.py` makes it from symptoms.toml and the clinic's findings."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from camviz_clinic.checks import kinds

SOURCE = Path(__file__).with_suffix(".toml")
PAGE = Path(__file__).with_suffix(".md")
HEAD = """\
# From a symptom to its remedy

<!-- Made from symptoms.toml and camviz_clinic/checks/findings by: python docs/engineers/symptoms.py -->

Find what you see in the first column. The likeliest finding comes first, and `camviz inspect` tells which of them it
is. [The clinic](../clinic.md) says by which number each finding is named and how often that is right.

| you see | it may be | try first |
|---|---|---|
"""


def symptoms() -> list[dict[str, Any]]:
    """Each symptom's title, words, ids of findings and command, as symptoms.toml has them."""
    found: list[dict[str, Any]] = tomllib.loads(SOURCE.read_text(encoding="utf-8"))["symptom"]
    return found


def page() -> str:
    """The page as Markdown; KeyError for a finding that the clinic cannot name."""
    rows = (
        f"| [{each['title']}](#{_anchor(each['title'])}) | {', '.join(map(_link, each['findings']))} "
        f"| {_cell(kinds()[each['findings'][0]].remedy)} |\n"
        for each in symptoms()
    )
    return HEAD + "".join(rows) + "".join(map(_section, symptoms()))


def _section(symptom: dict[str, Any]) -> str:
    rows = (f"| {_link(id)} | {kinds()[id].symptom} | {_cell(kinds()[id].remedy)} |\n" for id in symptom["findings"])
    return (
        f"\n## {symptom['title']}\n\n{symptom['words'].strip()}\n\n```\n{symptom['run']}\n```\n\n"
        f"| finding | what it says | remedy |\n|---|---|---|\n{''.join(rows)}"
    )


def _cell(sentence: str) -> str:
    return sentence.replace("|", "\\|")


def _link(id: str) -> str:
    return f"[`{id}`](../clinic.md#{id})"


def _anchor(title: str) -> str:
    """The name that GitHub and MyST give to a heading."""
    return re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
