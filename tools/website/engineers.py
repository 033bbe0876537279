"""The pages for engineers: the contents of docs/engineers, and the gallery's reports, written by its own script."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

FOLDER = "docs/engineers"
REPORTS = "engineers/reports"
"""Where the gallery's links say that its reports are."""
MAKERS, MADE_BY = ("camviz", "camviz_clinic"), {".py", ".css", ".js"}
"""Whose files, with which endings, a report comes from."""


def front(root: Path) -> str:
    """The page that *Inspect a calibration* opens."""
    return f"{FOLDER}/README" if (root / FOLDER / "README.md").exists() else "docs/clinic"


def contents(root: Path) -> str:
    """What makes the front page the head of the other pages, as Markdown."""
    pages = [f"/{FOLDER}/{path.stem}" for path in sorted((root / FOLDER).glob("*.md"))]
    others = [page for page in (*pages, "/docs/clinic", "/docs/formats") if page != f"/{front(root)}"]
    listed = "\n".join(others)
    return f"\n```{{toctree}}\n:hidden:\n\n{listed}\n```\n"


def with_pictures(page: str) -> str:
    """A page's table of reports with a picture before each, which `write_reports` has written."""
    image = rf'<img src="../../{REPORTS}/\2.svg" alt="" class="report" loading="lazy"><br>'
    return re.sub(rf"^\| (\[[^\]]+\]\(\S*{REPORTS}/([\w-]+)\.html\))", rf"| {image} \1", page, flags=re.MULTILINE)


def write_reports(root: Path, site: Path) -> None:
    """Write the gallery's reports into the site, unless they are there and newer than all they are made by."""
    script, folder = root / FOLDER / "gallery.py", site / REPORTS
    if not script.exists():
        return
    makers = [script, *(path for name in MAKERS for path in (root / name).rglob("*") if path.suffix in MADE_BY)]
    made = max((path.stat().st_mtime for path in folder.glob("*.html")), default=0)
    if max(path.stat().st_mtime for path in makers) > made:
        subprocess.run([sys.executable, script, folder], check=True, cwd=root)
