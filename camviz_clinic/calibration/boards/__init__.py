"""Kinds of boards: every module of this package that has a KIND.

A kind is one file: where its points are, what of it is black, and how it is found in a picture.
`camviz_clinic/calibration/boards/kind.py` explains the fields. The modules import OpenCV only where they search,
because whoever reads a calibration file needs the points alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from types import MappingProxyType

from camviz_clinic.calibration.boards.kind import BoardKind, Drawing, Shape

__all__ = ["BoardKind", "Drawing", "Shape", "kind_of", "kinds"]

COMMONEST = "chessboard"


@cache
def kinds() -> Mapping[str, BoardKind]:
    """The kinds by name, the chessboard first and the others in alphabetical order.

    Returns: One for each module of this package that has a KIND.

    >>> list(kinds())
    ['chessboard', 'aprilgrid', 'asymmetric-circles', 'charuco', 'circles', 'markers']
    """
    modules = [import_module(f"{__name__}.{each.name}") for each in iter_modules(__path__)]
    found = [module.KIND for module in modules if isinstance(getattr(module, "KIND", None), BoardKind)]
    ordered = sorted(found, key=lambda kind: (kind.name != COMMONEST, kind.name))
    return MappingProxyType({kind.name: kind for kind in ordered})


def kind_of(board: Shape) -> BoardKind:
    """The kind of a board.

    Args:
        board: A `Board`, or what has its fields.

    Returns: The one of its name.
    Raises: ValueError for a name that is none.

    >>> from camviz_clinic.calibration import Board
    >>> board = Board(9, 6, 0.025)
    >>> kind_of(board).says(board)
    'chessboard with 9×6 inner corners (10×7 squares)'
    """
    if board.kind not in kinds():
        raise ValueError(f"kind must be one of {', '.join(kinds())}, got {board.kind!r}")
    return kinds()[board.kind]
