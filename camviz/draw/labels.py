"""Words that do not stand over each other: where labels of a picture would collide, the less important one gives way.

How wide words are is known only to the browser that draws them. They are taken to be as wide as in DejaVu Sans, which
is wider than what most systems have, so that what is free here is free there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

from camviz.draw import styles
from camviz.draw.marks import Group, Inset, Mark, Marks, Text

SMALLEST = 12  # CSS pixels, of any word at any size of the picture
SIZES = {**styles.SIZES, "": styles.SIZE}  # picture units
FIXED = -1  # the rank of words that stay beside what they name
ASCENT, DESCENT = 0.93, 0.24  # of the size
LEADING = 1.36  # from line to line of a paragraph, of the size
_WIDTHS = {
    0.29: "'ijlIJ", 0.34: " ,./:;\\|f’·", 0.41: "-()[]t!r²₁", 0.52: '"*_`sz?“”°–⁻', 0.6: "cLFkvxyPTYao",
    0.64: "eESbdghnpqu$0123456789{}σµαθΣπ", 0.7: "KAVBRXZCΔ", 0.78: "UHNDG&OQ", 0.84: "w#+<=>^~×±−→", 1.0: "M%mW@…",
}  # fmt: skip
_WIDTH = {letter: width for width, letters in _WIDTHS.items() for letter in letters}
_BOLD, _MONO, _UNKNOWN = 1.12, 0.61, 0.7
Box = tuple[float, float, float, float]
"""Left, top, right and bottom, in picture units."""


@dataclass(frozen=True)
class Words:
    """One text of a picture: the rectangles that it takes and is seen in, and what it may do to make room."""

    mark: Text
    box: Box
    seen: Box
    rank: int
    moves: tuple[tuple[float, float], ...]
    may_go: bool
    lines: tuple[str, ...] = ()
    leading: float = 0.0

    @property
    def text(self) -> str:
        return self.mark.words

    def moved(self, dx: float, dy: float) -> Text:
        """The mark at its new place, a paragraph in lines."""
        return replace(self.mark, x=self.mark.x + dx, y=self.mark.y + dy, lines=self.lines, leading=self.leading)


def uncluttered(marks: Marks, tile: Box, unit: float = 1.0) -> Marks:
    """The marks of a tile with every word clear of the others and within what is seen, where that can be had.

    `tile` is the rectangle of the picture that is shown, `unit` how many picture units make a CSS pixel: where a
    picture is shown small, its words are larger in it. A label in a panel moves up or down; a tick or a hint goes.
    """
    found = words_of(marks, tile, unit)
    taken: list[Box] = []
    placed: dict[int, Text | None] = {}
    for index, words in sorted(enumerate(found), key=lambda each: each[1].rank):
        shift = _free(words, taken)
        placed[index] = words.moved(*shift) if shift else None
        if shift:
            taken.append(_shifted(words.box, *shift))
    return _with_texts(marks, iter([placed[index] for index in range(len(found))]))


def _with_texts(marks: Marks, texts: Iterator[Text | None]) -> Marks:
    """The marks with their texts replaced, in order; without those that are None."""
    kept: list[Mark] = []
    for mark in marks:
        if isinstance(mark, Group | Inset):
            kept.append(replace(mark, marks=_with_texts(mark.marks, texts)))
        elif not isinstance(mark, Text) or not mark.words.strip():
            kept.append(mark)
        elif (text := next(texts)) is not None:
            kept.append(text)
    return Marks(kept)


def words_of(marks: Marks, tile: Box, unit: float = 1.0) -> list[Words]:
    """Every text of a tile with the rectangle that it takes, in the order in which they are drawn."""
    return list(_words_within(marks, (0.0, 0.0), tile, unit, False))


def _words_within(marks: Marks, origin: tuple[float, float], seen: Box, unit: float, inside: bool) -> Iterator[Words]:
    """The texts of marks whose coordinates begin at `origin`; `inside` a panel or not."""
    for mark in marks:
        if isinstance(mark, Inset):
            x, y = origin[0] + mark.x, origin[1] + mark.y
            left, top, right, bottom = seen
            within = max(left, x), max(top, y), min(right, x + mark.width), min(bottom, y + mark.height)
            yield from _words_within(mark.marks, (x, y), within, unit, True)
        elif isinstance(mark, Group):
            yield from _words_within(mark.marks, origin, seen, unit, inside)
        elif isinstance(mark, Text) and mark.words.strip():
            yield _words(mark, origin, seen, inside, unit)


def overlap(one: Box, other: Box, least: float = 0.5) -> bool:
    """Whether two rectangles share more than `least` units both ways."""
    return (
        min(one[2], other[2]) - max(one[0], other[0]) > least and min(one[3], other[3]) - max(one[1], other[1]) > least
    )


@lru_cache(maxsize=1000)
def width(words: str, size: float, *, bold: bool = False, mono: bool = False) -> float:
    """How wide words of a size are, in the same units.

    >>> round(width("focal length", 13))
    78
    """
    if mono:
        return _MONO * size * len(words)
    return sum([_WIDTH.get(letter, _UNKNOWN) for letter in words]) * size * (_BOLD if bold else 1.0)


def _words(mark: Text, origin: tuple[float, float], seen: Box, inside: bool, unit: float) -> Words:
    classes = mark.class_.split()
    role = next((name for name in SIZES if name in classes), "")
    size = max(float(mark.style.get("font_size", SIZES[role])), SMALLEST * unit)
    bold = role == "title" or mark.style.get("font_weight") == 600
    lines = _wrapped(mark.words, mark.wrap_width, size) if mark.wrap_width is not None else ()
    long = max(width(line, size, bold=bold, mono=role == "number") for line in lines or (mark.words,))
    before = long if "end" in classes else long / 2 if "middle" in classes else 0.0
    x, y = mark.x, mark.y
    if mark.grows_from:  # a legend grows as a whole from a corner
        from_x, from_y = mark.grows_from
        x, y = from_x + unit * (x - from_x), from_y + unit * (y - from_y)
    x, y = origin[0] + x, origin[1] + y
    leading = LEADING * size
    upright = mark.turned_deg == -90
    if upright:
        box = (x - ASCENT * size, y - long + before, x + DESCENT * size, y + before)
    else:
        below = y + DESCENT * size + leading * max(len(lines) - 1, 0)
        box = (x - before, y - ASCENT * size, x - before + long, below)
    rank, moves = (FIXED, ()) if mark.grows_from else _manners(role, classes, inside, upright, size)
    may_go = rank > 2 and not lines
    return Words(mark, box, seen, rank, moves, may_go, lines, leading)


def _wrapped(text: str, room: float, size: float) -> tuple[str, ...]:
    """The lines of a paragraph, none longer than `room` units where its words allow."""
    lines = []
    for given in text.splitlines():
        line = ""
        for word in given.split():
            longer = f"{line} {word}".strip()
            if line and width(longer, size) > room:
                lines.append(line)
                longer = word
            line = longer
        lines.append(line)
    return tuple(lines)


def _manners(
    role: str, classes: list[str], inside: bool, turned: bool, size: float
) -> tuple[int, tuple[tuple[float, float], ...]]:
    """How much a text matters (0 is the most; above 2 it may go), and where else it may stand."""
    if "hint" in classes:
        return 6, ()
    if role == "tick" or (role == "note" and "end" in classes and not inside):  # a note beside a panel's title
        return 5, ()
    if turned:
        return 2, tuple((-step * size / 4, 0.0) for step in range(1, 6))
    if role in ("title", "number") or not inside:
        return (0 if role == "title" else 1), tuple((0.0, step * size / 4) for step in (1, 2, -1))
    line = (ASCENT + DESCENT) * size
    around = tuple((dx, dy * line) for dy in (-1, 1, -2, 2) for dx in (0.0,))
    return (4 if role == "note" else 3), around


def _free(words: Words, taken: list[Box]) -> tuple[float, float] | None:
    """By how much the words move to stand free; (0, 0) where they cannot but matter, None where they go."""
    if words.rank == FIXED:
        return 0.0, 0.0
    for dx, dy in ((0.0, 0.0), *words.moves):
        inward = _inward(words, dx, dy)
        if inward is None:
            continue
        here = _shifted(words.box, *inward)
        if not any(overlap(here, box) for box in taken):
            return inward
    return None if words.may_go else _inward(words, 0.0, 0.0) or (0.0, 0.0)


def _inward(words: Words, dx: float, dy: float) -> tuple[float, float] | None:
    """The shift with what brings the words wholly into view; None where they are too long for that, or turned away."""
    left, top, right, bottom = _shifted(words.box, dx, dy)
    low_x, low_y, high_x, high_y = words.seen
    if right - left > high_x - low_x or bottom - top > high_y - low_y:
        return None
    dx += max(low_x - left, 0.0) + min(high_x - right, 0.0)
    dy += max(low_y - top, 0.0) + min(high_y - bottom, 0.0)
    return dx, dy


def _shifted(box: Box, dx: float, dy: float) -> Box:
    return box[0] + dx, box[1] + dy, box[2] + dx, box[3] + dy
