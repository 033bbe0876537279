"""A wheel takes the lessons along, and its README leads to the repository; an editable installation needs no copy."""

import re
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

REPOSITORY = "https://github.com/camviz/camviz"
RAW = "https://raw.githubusercontent.com/camviz/camviz"
PICTURE = re.compile(r"!\[([^][]*)\]\((?!https?://)([^)\s]+)\)")
PAGE = re.compile(r"\]\((?!https?://|#|mailto:)([^)\s]+)\)")


class Lessons(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Put lessons/ into the wheel as camviz_school/_lessons."""
        if version != "editable":
            build_data["force_include"]["lessons"] = "camviz_school/_lessons"


class Readme(MetadataHookInterface):
    def update(self, metadata: dict[str, Any]) -> None:
        """The README with links that work from a package index too."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": absolute(text, f"v{metadata['version']}")}


def absolute(text: str, tag: str) -> str:
    """Markdown whose relative links lead to the files of a tag, its pictures to those that can be shown."""
    shown = PICTURE.sub(rf"![\1]({RAW}/{tag}/\2)", text)
    return PAGE.sub(rf"]({REPOSITORY}/blob/{tag}/\1)", shown)
