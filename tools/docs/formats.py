"""The tables in docs/formats.md, of calibrations and corners, as formats declare them: python tools/docs/formats.py"""

from __future__ import annotations

import re
from pathlib import Path

from camviz_clinic.files.corners import corner_formats
from camviz_clinic.files.format import Format
from camviz_clinic.files.registry import formats

PAGE = Path(__file__).parents[2] / "docs" / "formats.md"
HEAD = "| `--to` | file | camera models | conventions of its own | not written |\n|---|---|---|---|---|\n"
CORNERS = "| corners | hold | conventions of their own | layout by |\n|---|---|---|---|\n"
_CORNERS = re.compile(r"^\| corners .*\n(?:\|.*\n)*", re.MULTILINE)
_TABLE = re.compile(r"^\| `--to` .*\n(?:\|.*\n)*", re.MULTILINE)


def table() -> str:
    """The formats as rows of Markdown; those that are only read have no `--to`."""
    return HEAD + "".join(f"| {' | '.join(_cells(format))} |\n" for format in formats().values())


def corner_table() -> str:
    """The files of corners as rows of Markdown."""
    rows = [(each.title, each.holds, each.says, each.source) for each in corner_formats().values()]
    return CORNERS + "".join(f"| {' | '.join(row)} |\n" for row in rows)


def renewed(page: str) -> str:
    """The text of the page with both tables as the formats are now; ValueError for a page that lacks one."""
    made, count = _TABLE.subn(lambda _: table(), page)
    if count != 1:
        raise ValueError(f"expected one table that begins with | `--to`, found {count}")
    made, count = _CORNERS.subn(lambda _: corner_table(), made)
    if count != 1:
        raise ValueError(f"expected one table that begins with | corners, found {count}")
    return made


def _cells(format: Format) -> list[str]:
    file = format.title if format.file in format.title else f"{format.title}: {format.file}"
    return [f"`{format.name}`" if format.write else "—", file, format.models, format.says, _not_written(format)]


def _not_written(format: Format) -> str:
    if format.write is None:
        return "anything: it is only read"
    several = {None: "", 1: "several cameras"}.get(format.most_cameras, f"more than {format.most_cameras} cameras")
    return ", ".join(filter(None, [format.lacks, several, "" if format.own_world else "a world of its own"]))


if __name__ == "__main__":
    PAGE.write_text(renewed(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
