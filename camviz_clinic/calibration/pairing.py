"""Which picture of the left camera was taken together with which of the right one."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from camviz_clinic.calibration.detection import CannotCalibrate, Detections


@dataclass(frozen=True)
class Pairs:
    """Pictures of two cameras in the order of their moments, and those without a partner, with the reason."""

    left: tuple[Path, ...]
    right: tuple[Path, ...]
    lonely: tuple[tuple[str, str], ...] = ()


def paired(left: Sequence[Path], right: Sequence[Path], *, by_order: bool = True) -> Pairs:
    """Pictures of the same name are of one moment, else those with the same last number in their names, else by order.

    Order decides only where there are as many pictures of one camera as of the other, and `by_order` lets it. Raises
    CannotCalibrate where nothing tells the partners.
    """
    for key in (_name, last_number):
        first, second = _by_key(left, key), _by_key(right, key)
        if first and second and first.keys() & second.keys():
            together = [each for each in first if each in second]
            alone = [(path, "right") for each, path in first.items() if each not in second]
            alone += [(path, "left") for each, path in second.items() if each not in first]
            return Pairs(
                tuple(first[each] for each in together),
                tuple(second[each] for each in together),
                tuple(
                    (path.name, f"it has no partner among the pictures of the {other} camera") for path, other in alone
                ),
            )
    if len(left) != len(right) or not by_order:
        raise CannotCalibrate(
            f"there are {len(left)} pictures of the left camera and {len(right)} of the right one, and their names do "
            "not tell the pairs: give pictures of one moment the same number, as in left01.jpg and right01.jpg"
        )
    return Pairs(tuple(left), tuple(right))


def paired_detections(left: Detections, right: Detections) -> tuple[Detections, Detections]:
    """The views of two cameras with the same `places` for those of one moment; views without a partner are skipped.

    Views are paired as `paired` has it, by their names alone: where corners come from files, nothing is known of their
    order. Raises CannotCalibrate where the names do not tell the partners.
    """
    both = [_names(left), _names(right)]
    pairs = paired(*both, by_order=False)
    alone = dict(pairs.lonely)
    first, second = (
        _placed(detections, partners, alone) for detections, partners in ((left, pairs.left), (right, pairs.right))
    )
    return first, second


def _names(detections: Detections) -> list[Path]:
    """The pictures with a view, and then those without."""
    return [Path(name) for name in (*detections.pictures, *(name for name, _ in detections.skipped))]


def _placed(detections: Detections, partners: Sequence[Path], alone: Mapping[str, str]) -> Detections:
    """The views that have partners, at their places among these."""
    places = {path: place for place, path in enumerate(partners)}
    kept = [view for view, name in enumerate(detections.pictures) if Path(name) in places]
    names = tuple(detections.pictures[view] for view in kept)
    lonely = tuple((name, alone[Path(name).name]) for name in detections.pictures if name not in names)
    return replace(
        detections,
        pictures=names,
        corners=detections.corners[kept],
        skipped=detections.skipped + lonely,
        places=tuple(places[Path(name)] for name in names),
    )


def _by_key(paths: Sequence[Path], key: Callable[[Path], str]) -> dict[str, Path] | None:
    """The pictures by their keys; None unless every one has a key of its own."""
    found = {key(path): path for path in paths}
    return found if len(found) == len(paths) and "" not in found else None


def _name(path: Path) -> str:
    return path.stem


def last_number(path: Path) -> str:
    """The last number in a file's name, without leading zeros; nothing where there is none."""
    numbers = re.findall(r"\d+", path.stem)
    return str(int(numbers[-1])) if numbers else ""
