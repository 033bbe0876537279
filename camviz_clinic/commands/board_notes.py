"""What several boards show of each other, in sentences: one that fits worse, has another size or hardly has a place."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from camviz_clinic.commands.rig import pm

if TYPE_CHECKING:
    from camviz_clinic.rigs.boards import SolvedBoards
    from camviz_clinic.rigs.target import TargetAdjustment

CERTAIN = 4.0  # times its σ must a board be off the size that is said
WORTH = 0.002  # of its size: less is as good as a printer is
WORSE = 1.5  # times the scatter of the other boards' corners
FEWEST = 3  # frames that tell where a board is: with two, nothing contradicts a mistake in one
PART = 0.05  # of a board's length: a place with a larger ± is not decided


def board_sentences(solved: SolvedBoards) -> tuple[str, ...]:
    """What is to be said of single boards.

    Args:
        solved: The solution.

    Returns: A sentence for each board with which something is wrong: of its size, else its corners, else its place.
    """
    sizes = {name: said for name, size in solved.sizes.items() if (said := size_sentence(name, *size))}
    worse = {name: said for name, said in _worse(solved.adjustment) if name not in sizes}
    placed = {name: said for name, said in _hardly_placed(solved) if name not in {*sizes, *worse}}
    return (*sizes.values(), *worse.values(), *placed.values())


def size_sentence(name: str, size: float, sigma: float) -> str:
    """That a board has not the size that is said, where this is certain and matters; empty otherwise.

    Args:
        name: The board.
        size: How many times larger it is than said.
        sigma: Standard deviation of that.

    Returns: The sentence.

    >>> size_sentence("back", 1.0041, 0.001)[:54]
    'back is 0.41 ± 0.10 % larger than it is said to be, be'
    """
    if not (abs(size - 1) > CERTAIN * sigma and abs(size - 1) > WORTH):
        return ""
    word = "larger" if size > 1 else "smaller"
    return (
        f"{name} is {pm(100 * abs(size - 1), 100 * sigma)} % {word} than it is said to be, beside the other boards: "
        "measure them, and give the true sizes."
    )


def _worse(adjustment: TargetAdjustment) -> Iterator[tuple[str, str]]:
    """Boards whose corners, also those that were set aside, scatter more than those of the others, by the median."""
    import numpy as np

    off = np.concatenate([np.linalg.norm(each, axis=-1) for each in adjustment.residuals.values()])
    if len(adjustment.boards) < 2:
        return
    for name, rows in zip(adjustment.board.names, adjustment.boards, strict=True):
        own, others = (
            float(np.nanmedian(each) / np.sqrt(2 * np.log(2))) for each in (off[:, rows], np.delete(off, rows, axis=1))
        )
        if own > WORSE * others:
            yield (
                name,
                f"{name}: its corners scatter by {own:.2g} px in each coordinate, those of the other boards by "
                f"{others:.2g} px. It may be bent, be another board than is said, or have moved against the others.",
            )


def _hardly_placed(solved: SolvedBoards) -> Iterator[tuple[str, str]]:
    """Boards of whose place a few frames tell, or whose place is not known to a part of their length."""
    import numpy as np

    from camviz_clinic.calibration.detection import seen

    target = solved.adjustment.board
    for group in solved.groups:
        for name in group[1:]:
            place, part = solved.place(name), target.names.index(name)
            corners = [each[:, target.rows_of(part)] for each in solved.adjustment.detections.values()]
            frames = int(np.any([seen(each).any(axis=1) for each in corners], axis=0).sum())
            sigma = float(np.sqrt(np.trace(place.covariance[3:, 3:])))
            if place.covariance.any() and (frames < FEWEST or not sigma < PART * target.parts[part].length):
                yield (
                    name,
                    f"{name}: {frames} frame{'s' * (frames != 1)} show{'s' * (frames == 1)} it, and its place is known "
                    f"to {1000 * sigma:.2g} mm: take more pictures of it together with {group[0]}.",
                )
