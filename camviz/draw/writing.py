"""From marks to SVG: for pages with classes and a style sheet, for files with every style at its element.

A browser resolves the variables of a style sheet and follows its theme. Inkscape, LaTeX, Word and cairosvg do not: they
draw black what they cannot resolve. `FileWriter` also replaces what only browsers draw:

- a nested `<svg>` by a group under a clip path;
- words with a halo (`paint-order`) by the halo and, over it, the words;
- a photograph under a mask by one photograph with transparency;
- a photograph with few pixels by one with more, so that a program's own smoothing does not show;
- system fonts by fonts with names.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Mapping
from functools import cache
from html import escape
from itertools import count
from math import isfinite
from typing import Any

import cv2
import numpy as np

from camviz.draw import styles
from camviz.draw.marks import Discs, Group, Image, Inset, Lines, Mark, Marks, Rect, Segments, Style, Text

_HARD_PIXELS_A_UNIT = 4  # that keep hard pixels hard when a program smooths them
_SMOOTH_UNITS_A_PIXEL = 2  # beyond which smooth pictures get more pixels


def element(tag: str, content: str = "", **attributes: Any) -> str:
    """`<tag attributes>content</tag>`. Underscores in attribute names become dashes; a trailing one is dropped."""
    written = "".join(
        [f' {_dashed(name)}="{_written(value)}"' for name, value in attributes.items() if value is not None]
    )
    return f"<{tag}{written}>{content}</{tag}>" if content else f"<{tag}{written}/>"


class PageWriter:
    """SVG with classes, for a page that has the style sheet. Photographs stay `attached:name`."""

    def write(self, marks: Marks) -> str:
        return "".join([self._mark(mark) for mark in marks])

    def _mark(self, mark: Mark) -> str:
        match mark:
            case Text():
                return self._text(mark)
            case Lines():
                return self._path("".join([_pieces(line, mark.closed) for line in mark.lines]), mark.class_, mark.style)
            case Segments():
                return self._path(_segments(mark), mark.class_, mark.style)
            case Discs():
                data = "".join(map("M%.1f,%.1fh0".__mod__, map(tuple, mark.points.tolist())))
                return self._path(data, f"{mark.class_} dots", {"stroke_width": mark.diameter})
            case Rect(x, y, width, height):
                look = self._look("rect", mark.class_, mark.style)
                return element("rect", x=x, y=y, width=width, height=height, rx=mark.radius, **look)
            case Image():
                return self._image(mark)
            case Inset():
                return self._inset(mark)
            case Group():
                return self._group(mark)

    def _look(self, tag: str, class_: str, style: Style) -> dict[str, Any]:
        """The attributes that say what an element looks like."""
        return {"class_": class_ or None, "style": styles.css(style, styles.VARIABLES) or None}

    def _path(self, data: str, class_: str, style: Style) -> str:
        return element("path", d=data, **self._look("path", class_, style))

    def _text(self, mark: Text) -> str:
        look = self._look("text", mark.class_, mark.style)
        return element("text", _words(mark), x=mark.x, y=mark.y, **look, transform=_rotation(mark))

    def _image(self, mark: Image) -> str:
        box: dict[str, Any] = {"x": mark.x, "y": mark.y, "width": mark.width, "height": mark.height}
        stretched = {**box, "preserveAspectRatio": "none"}
        look = self._look("image", "", mark.style)
        if not mark.mask:
            return element("image", href=f"attached:{mark.name}", **stretched, **look)
        cover = element("image", href=f"attached:{mark.mask}", **stretched)
        masked = element("image", href=f"attached:{mark.name}", **stretched, **look, mask=f"url(#{mark.mask_id})")
        return element("mask", cover, id=mark.mask_id, maskUnits="userSpaceOnUse", **box) + masked

    def _inset(self, mark: Inset) -> str:
        box = {"x": mark.x, "y": mark.y, "width": mark.width, "height": mark.height}
        named = {"viewBox": f"0 0 {mark.width:g} {mark.height:g}", "data_panel": mark.name or None}
        return element("svg", self.write(mark.marks), **box, **named, overflow="hidden", **mark.attributes)

    def _group(self, mark: Group) -> str:
        tag = "a" if "href" in mark.attributes else "g"
        origin = mark.grows_from and f"transform-origin:{mark.grows_from[0]:g}px {mark.grows_from[1]:g}px"
        return element(tag, self.write(mark.marks) or " ", class_=mark.class_ or None, style=origin, **mark.attributes)


class FileWriter(PageWriter):
    """SVG in the colours of a theme, for a file that any program shows; its photographs are inside."""

    def __init__(self, theme: str, photographs: Mapping[str, bytes]) -> None:
        self._theme, self._photographs, self._number = theme, photographs, count(1)

    def _look(self, tag: str, class_: str, style: Style) -> dict[str, Any]:
        declared = styles.attributes(tag, class_, style, self._theme)
        return {name: value for name, value in declared.items() if name in _KEPT}

    def _text(self, mark: Text) -> str:
        style = styles.attributes("text", mark.class_, mark.style, self._theme)
        if style.get("display") == "none":
            return ""
        look = {name: value for name, value in style.items() if name in _KEPT}
        place = {
            "x": mark.x,
            "y": mark.y,
            "transform": _rotation(mark),
            "xml:space": "preserve" if style.get("white-space") == "pre" else None,
        }
        plain = {name: value for name, value in look.items() if not name.startswith("stroke")}
        words = element("text", _words(mark), **place, **plain)
        if style.get("paint-order") != "stroke":
            return words
        return element("text", _words(mark), **place, **look | {"fill": look["stroke"]}) + words

    def _image(self, mark: Image) -> str:
        data = self._photographs[mark.name]
        hard = mark.style.get("image_rendering") == "pixelated"
        data = _masked(data, self._photographs[mark.mask]) if mark.mask else _enlarged(data, mark, hard)
        kind = "png" if data.startswith(b"\x89PNG") else "jpeg"
        link = {"xlink:href": f"data:image/{kind};base64,{b64encode(data).decode()}"}
        box: dict[str, Any] = {
            "x": mark.x,
            "y": mark.y,
            "width": mark.width,
            "height": mark.height,
            "preserveAspectRatio": "none",
        }
        return element("image", **box, **link, **self._look("image", "", mark.style))

    def _inset(self, mark: Inset) -> str:
        id_ = f"panel-{next(self._number)}"
        clip = element("clipPath", element("rect", x=0, y=0, width=mark.width, height=mark.height), id=id_)
        content = element("g", self.write(mark.marks) or " ", clip_path=f"url(#{id_})")
        return element("g", clip + content, transform=f"translate({mark.x:.6g} {mark.y:.6g})")

    def _group(self, mark: Group) -> str:
        return element("g", self.write(mark.marks) or " ", **self._look("g", mark.class_, {}))


_KEPT = frozenset({
    "fill", "fill-opacity", "font-family", "font-size", "font-weight", "opacity", "stroke", "stroke-dasharray",
    "stroke-linecap", "stroke-linejoin", "stroke-opacity", "stroke-width", "text-anchor",
})  # fmt: skip
"""Of all that a style says, what every program understands."""


@cache
def _dashed(name: str) -> str:
    return name.rstrip("_").replace("_", "-")


def _written(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else escape(str(value))


def _words(mark: Text) -> str:
    if not mark.lines:
        return escape(mark.words, quote=False)
    return "".join(
        f'<tspan x="{mark.x:.6g}" dy="{mark.leading if i else 0:.6g}">{escape(line, quote=False)}</tspan>'
        for i, line in enumerate(mark.lines)
    )


def _rotation(mark: Text) -> str | None:
    return f"rotate({mark.turned_deg:g} {mark.x:.6g} {mark.y:.6g})" if mark.turned_deg else None


def _segments(mark: Segments) -> str:
    corners = map(tuple, mark.ends.reshape(-1, 4).tolist())
    if mark.continues is None:
        return "".join(map("M%.1f,%.1fL%.1f,%.1f".__mod__, corners))
    pairs = zip(corners, mark.continues.tolist(), strict=True)
    return "".join([f"L{c:g},{d:g}" if on else f"M{a:g},{b:g}L{c:g},{d:g}" for (a, b, c, d), on in pairs])


def _pieces(points: np.ndarray, closed: bool) -> str:
    if isfinite(points.sum()):
        return _piece(points, closed)
    exists = np.isfinite(points).all(axis=-1)
    cuts = np.flatnonzero(np.diff(exists.astype(np.int8))) + 1
    runs = zip(np.split(points, cuts), np.split(exists, cuts), strict=True)
    return "".join(_piece(run, False) for run, here in runs if here.size and here[0])


def _piece(points: np.ndarray, closed: bool) -> str:
    if len(points) < 2:
        return ""
    return "M" + " ".join([f"{x:.1f},{y:.1f}" for x, y in points.tolist()]) + ("Z" if closed else "")


def _masked(photograph: bytes, mask: bytes) -> bytes:
    """The photograph with the brightness of the mask as its transparency, PNG."""
    colour, alpha = _decoded(photograph, cv2.IMREAD_COLOR), _decoded(mask, cv2.IMREAD_GRAYSCALE)
    return _png(np.dstack([colour, alpha]))


def _enlarged(photograph: bytes, place: Image, hard: bool) -> bytes:
    """The photograph with more pixels, as PNG, where it has few for its place.

    Hard pixels are repeated. Smooth ones are interpolated, for Cairo fades the outermost half of a pixel away.
    """
    pixels = _decoded(photograph, cv2.IMREAD_UNCHANGED)
    stretch = np.array([place.width, place.height]) / pixels.shape[1::-1]
    if stretch.max() <= (1 if hard else _SMOOTH_UNITS_A_PIXEL):
        return photograph
    fx, fy = np.maximum(np.ceil((_HARD_PIXELS_A_UNIT if hard else 1) * stretch), 1)
    way = cv2.INTER_NEAREST if hard else cv2.INTER_LINEAR
    return _png(np.asarray(cv2.resize(pixels, None, fx=fx, fy=fy, interpolation=way)))


def _decoded(data: bytes, flags: int) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), flags))


def _png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1].tobytes()
