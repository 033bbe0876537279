"""The findings by their names: how severe each is, which view shows it, where it comes from and what mends it."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from camviz.clinic.evidence import Evidence

SEVERITIES = ("fault", "warning", "note")  # the worst first


@dataclass(frozen=True)
class Kind:
    """One entry of findings.toml: what every finding of this id has in common."""

    id: str
    severity: str
    view: str
    symptom: str
    causes: tuple[str, ...]
    remedy: str
    evidence: str
    threshold: str

    def __post_init__(self) -> None:
        if self.severity not in SEVERITIES:
            raise ValueError(f"severity must be one of {', '.join(SEVERITIES)}, got {self.severity!r}")


@dataclass(frozen=True)
class Finding:
    """What is wrong, in one plain sentence, with the number that shows it.

    `camera` is the camera's name, None where it concerns all of them; `pictures` are the indices of the views that it
    concerns. `view` names the view that shows it.
    """

    id: str
    severity: str
    sentence: str
    value: float | None = None
    unit: str = ""
    camera: str | None = None
    view: str = "numbers"
    causes: tuple[str, ...] = ()
    remedy: str = ""
    pictures: tuple[int, ...] = ()


@dataclass(frozen=True)
class Lacking:
    """Why a check could not be made: what the calibration does not hold."""

    why: str


Outcome = list[Finding] | Lacking
Check = Callable[["Evidence"], Outcome]


@lru_cache
def kinds() -> Mapping[str, Kind]:
    """Every finding there can be, by id."""
    table = tomllib.loads((files("camviz.clinic") / "findings.toml").read_text(encoding="utf-8"))
    return MappingProxyType({id: Kind(id, **_entry(entry)) for id, entry in table.items()})


def _entry(entry: dict[str, Any]) -> dict[str, Any]:
    return entry | {"causes": tuple(entry["causes"])}


def found(
    id: str,
    sentence: str,
    value: float | None = None,
    unit: str = "",
    camera: str | None = None,
    *,
    severity: str | None = None,
    pictures: tuple[int, ...] = (),
) -> Finding:
    """A finding with what findings.toml says of its id; `severity` where this one is milder or worse than most."""
    kind = kinds()[id]
    number = None if value is None else float(value)
    return Finding(
        id, severity or kind.severity, sentence, number, unit, camera, kind.view, kind.causes, kind.remedy, pictures
    )
