"""Words that do not stand over each other: where labels of a picture would collide, the less important one gives way.

How wide words are is known only to the browser that draws them. They are taken to be as wide as in DejaVu Sans, which
is wider than what most systems have, so that what is free here is free there.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from html import escape, unescape
from math import inf

SMALLEST = 12  # CSS pixels, of any word at any size of the picture
SIZES = {"title": 14.0, "note": 12.0, "tick": 12.0, "number": 12.5, "": 13.0}  # picture units, as in style.css
FIXED = -1  # the rank of words that stay beside what they name
ASCENT, DESCENT = 0.93, 0.24  # of the size
LEADING = 1.36  # from line to line of a paragraph, of the size
_WIDTHS = {
    0.29: "'ijlIJ", 0.34: " ,./:;\\|f’·", 0.41: "-()[]t!r²₁", 0.52: '"*_`sz?“”°–⁻', 0.6: "cLFkvxyPTYao",
    0.64: "eESbdghnpqu$0123456789{}σµαθΣπ", 0.7: "KAVBRXZCΔ", 0.78: "UHNDG&OQ", 0.84: "w#+<=>^~×±−→", 1.0: "M%mW@…",
}  # fmt: skip
_WIDTH = {letter: width for width, letters in _WIDTHS.items() for letter in letters}
_BOLD, _MONO, _UNKNOWN = 1.12, 0.61, 0.7
_TOKEN = re.compile(r"<svg ([^>]*)>|</svg>|<text ([^>]*)>((?:[^<]|</?tspan)*)</text>")
_TAG = re.compile(r"<[^>]*>")
_ATTRIBUTE = re.compile(r'([\w-]+)="([^"]*)"')
_STYLED_SIZE = re.compile(r"font-size:([\d.]+)px")

Box = tuple[float, float, float, float]
"""Left, top, right and bottom, in picture units."""


@dataclass(frozen=True)
class Words:
    """One text of a picture: where it stands, what it may do to make room, and the rectangle in which it is seen."""

    start: int
    end: int
    x: float
    y: float
    box: Box
    seen: Box
    rank: int
    moves: tuple[tuple[float, float], ...]
    may_go: bool
    lines: tuple[str, ...] = ()
    step: float = 0.0


def uncluttered(body: str, tile: Box, unit: float = 1.0) -> str:
    """The SVG of a tile with every word clear of the others and within what is seen, where that can be had.

    `tile` is the rectangle of the picture that is shown, `unit` how many picture units make a CSS pixel: where a
    picture is shown small, its words are larger in it. A label in a panel moves up or down; a tick or a hint goes.
    """
    found = sorted(words_of(body, tile, unit), key=lambda words: words.rank)
    taken: list[Box] = []
    edits: list[tuple[int, int, str]] = []
    for words in found:
        shift = _free(words, taken)
        if shift is None:
            edits.append((words.start, words.end, ""))
            continue
        dx, dy = shift
        left, top, right, bottom = words.box
        taken.append((left + dx, top + dy, right + dx, bottom + dy))
        if dx or dy or words.lines:
            edits.append((words.start, words.end, _rewritten(body[words.start : words.end], words, dx, dy)))
    for start, end, text in sorted(edits, reverse=True):
        body = body[:start] + text + body[end:]
    return body


def words_of(body: str, tile: Box, unit: float = 1.0) -> list[Words]:
    """Every text of a tile's SVG with the rectangle that it takes."""
    found: list[Words] = []
    frames: list[tuple[float, float, Box]] = [(0.0, 0.0, tile)]
    for token in _TOKEN.finditer(body):
        panel, attributes, text = token.groups()
        if panel is not None:
            frames.append(_frame(dict(_ATTRIBUTE.findall(panel)), frames[-1]))
        elif attributes is None:
            frames.pop()
        elif text.strip():
            x, y, seen = frames[-1]
            given = dict(_ATTRIBUTE.findall(attributes))
            found.append(
                _words(
                    token.start(),
                    token.end(),
                    given,
                    unescape(_TAG.sub(" ", text)),
                    (x, y),
                    seen,
                    len(frames) > 1,
                    unit,
                )
            )
    return found


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


def _frame(given: dict[str, str], outer: tuple[float, float, Box]) -> tuple[float, float, Box]:
    """Where a panel's own coordinates begin, and what is seen of it."""
    x, y, (left, top, right, bottom) = outer
    x, y = x + float(given.get("x", 0)), y + float(given.get("y", 0))
    wide, high = float(given.get("width", inf)), float(given.get("height", inf))
    return x, y, (max(left, x), max(top, y), min(right, x + wide), min(bottom, y + high))


def _words(
    start: int,
    end: int,
    given: dict[str, str],
    text: str,
    at: tuple[float, float],
    seen: Box,
    inside: bool,
    unit: float,
) -> Words:
    classes = given.get("class", "").split()
    role = next((name for name in SIZES if name in classes), "")
    styled = _STYLED_SIZE.search(given.get("style", ""))
    size = max(float(styled[1]) if styled else SIZES[role], SMALLEST * unit)
    bold = role == "title" or "font-weight:600" in given.get("style", "")
    lines = _wrapped(text, float(given["data-width"]), size) if "data-width" in given else ()
    long = max(width(line, size, bold=bold, mono=role == "number") for line in lines or (text,))
    before = long if "end" in classes else long / 2 if "middle" in classes else 0.0
    x, y = float(given["x"]), float(given["y"])
    if "data-from" in given:  # a legend grows as a whole from a corner
        from_x, from_y = map(float, given["data-from"].split())
        x, y = from_x + unit * (x - from_x), from_y + unit * (y - from_y)
    x, y = at[0] + x, at[1] + y
    turned, step = "rotate(-90" in given.get("transform", ""), LEADING * size
    if turned:
        box = (x - ASCENT * size, y - long + before, x + DESCENT * size, y + before)
    else:
        below = y + DESCENT * size + step * max(len(lines) - 1, 0)
        box = (x - before, y - ASCENT * size, x - before + long, below)
    rank, moves = (FIXED, ()) if "data-from" in given else _manners(role, classes, inside, turned, size)
    may_go = rank > 2 and not lines
    return Words(start, end, float(given["x"]), float(given["y"]), box, seen, rank, moves, may_go, lines, step)


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


def _rewritten(element: str, words: Words, dx: float, dy: float) -> str:
    """The element at its new place, turned words about it, and a paragraph in lines."""
    x, y = f"{words.x + dx:.6g}", f"{words.y + dy:.6g}"
    element = re.sub(r' x="[^"]*" y="[^"]*"', f' x="{x}" y="{y}"', element, count=1)
    element = re.sub(r"rotate\(-90 [^)]*\)", f"rotate(-90 {x} {y})", element)
    if not words.lines:
        return element
    lines = (
        f'<tspan x="{x}" dy="{words.step if i else 0:.6g}">{escape(line, quote=False)}</tspan>'
        for i, line in enumerate(words.lines)
    )
    return f"{element[: element.index('>') + 1]}{''.join(lines)}</text>"
