"""A wheel takes the lessons along; an editable installation has them beside it and needs no copy."""

from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Lessons(BuildHookInterface):
    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Put lessons/ into the wheel as camviz/_lessons."""
        if version != "editable":
            build_data["force_include"]["lessons"] = "camviz/_lessons"
