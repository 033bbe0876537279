"""Links of the repository's Markdown, as the site needs them: to its own pages, to the glossary, or to GitHub."""

from __future__ import annotations

import re
from collections.abc import Set
from html import escape
from pathlib import Path, PurePosixPath
from posixpath import normpath, relpath

REPOSITORY = "https://github.com/camviz/camviz"
PUBLISHED = "https://camviz.github.io/camviz/"
GLOSSARY = "lessons/00_start_here.ipynb"  # where the lessons' links to terms lead
GLOSSARY_PAGE = "docs/glossary"

_CODE = r"(?P<code>```.*?```|`[^`\n]*`)"
_LINK = re.compile(_CODE + r"|(?P<image>!?)\[(?P<words>(?:[^\[\]]|\[[^\[\]]*\])*)\]\((?P<target>[^()\s]+)\)", re.DOTALL)


def on_site(markdown: str, page: str, pages: Set[str], root: Path) -> str:
    """The Markdown of the file `page`, its links made for the site.

    `page` and `pages`, the sources of all of the site's pages, are ways from the top of the repository `root`. A link
    to a term of the glossary gets the class "term". One to a file that is no page leads to the file on GitHub.
    """

    folder = PurePosixPath(page).parent

    def linked(found: re.Match[str]) -> str:
        if found["code"] or found["image"]:
            return found[0]
        if found["target"].startswith(PUBLISHED):
            return f'<a href="{relpath(found["target"].removeprefix(PUBLISHED), folder)}">{found["words"]}</a>'
        if found["target"].startswith("#"):
            return (
                f"[{found['words']}]({found['target'].lower()})"  # JupyterLab's headings keep capitals, Sphinx's do not
            )
        if re.match(r"\w+:", found["target"]):
            return found[0]
        path, _, anchor = found["target"].partition("#")
        way = normpath(str(folder / path))
        if way == GLOSSARY and anchor and page != GLOSSARY:
            address = relpath(GLOSSARY_PAGE + ".html", folder)
            return f'<a class="term" href="{address}#{escape(anchor)}">{found["words"]}</a>'
        if way not in pages and (root / way).exists():
            kind = "tree" if (root / way).is_dir() else "blob"
            return f"[{found['words']}]({REPOSITORY}/{kind}/main/{way})"
        return found[0]

    return _LINK.sub(linked, markdown)
