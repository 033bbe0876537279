"""A picture for other programs: every style stands at its element, with no style sheet and no variable.

A browser resolves the variables of the style sheet and follows its theme. Inkscape, LaTeX, Word and cairosvg do not:
they draw black what they cannot resolve. Five more things that only browsers draw are replaced by plain ones:

- a nested `<svg>` by a group under a clip path;
- words with a halo (`paint-order`) by the halo and, over it, the words;
- a photograph under a mask by one photograph with transparency;
- a photograph with few pixels by one with more, so that a program's own smoothing does not show;
- system fonts by fonts with names.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Mapping
from copy import deepcopy
from functools import cache
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import cv2
import numpy as np

THEMES = ("light", "dark")
SANS = "DejaVu Sans, Verdana, Segoe UI, Helvetica Neue, Arial, sans-serif"
MONO = "DejaVu Sans Mono, Menlo, Consolas, Courier New, monospace"
_NAMESPACE = ' xmlns="http://www.w3.org/2000/svg"'
_SPACE = "{http://www.w3.org/XML/1998/namespace}space"
_SHARP = 4  # pixels a picture unit that keep hard pixels hard when a program smooths them
_SMOOTH = 2  # units a pixel beyond which smooth pictures get more pixels
_KEPT = frozenset({
    "clip-path", "cx", "cy", "d", "dy", "fill", "fill-opacity", "fill-rule", "font-family", "font-size",
    "font-weight", "height", "href", "id", "opacity", "points", "preserveAspectRatio", "r", "rx", "ry",
    "shape-rendering", "stroke", "stroke-dasharray", "stroke-linecap", "stroke-linejoin", "stroke-opacity",
    "stroke-width", "text-anchor", "transform", "viewBox", "width", "x", "x1", "x2", "y", "y1", "y2", _SPACE,
})  # fmt: skip

Style = dict[str, str]


def portable(svg: str, photographs: Mapping[str, bytes], css: str, theme: str = "light") -> str:
    """The `<svg>` element of a picture as a document in colours of the "light" or "dark" theme that needs no browser.

    `photographs` are PNG or JPEG by the names under which `svg` has them attached; `css` is the style sheet of all
    pictures. Raises ValueError for another theme.
    """
    if theme not in THEMES:
        raise ValueError(f"theme must be one of {', '.join(map(repr, THEMES))}, got {theme!r}")
    root = ElementTree.fromstring(svg.replace(_NAMESPACE, "", 1))
    _styled(root, _rules(css, theme))
    _photographs(root, dict(photographs))
    _halos(root)
    _panels(root)
    for element in root.iter():
        for name in set(element.attrib) - _KEPT:
            del element.attrib[name]
    for image in root.iter("image"):
        image.set("xlink:href", image.attrib.pop("href"))
    _paper(root, _variables(css, theme)["paper"])
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode")


def _paper(root: Element, colour: str) -> None:
    """Name the document's size and namespaces, and put paper behind everything."""
    _, _, width, height = root.attrib["viewBox"].split()
    root.attrib.update({"xmlns": "http://www.w3.org/2000/svg", "xmlns:xlink": "http://www.w3.org/1999/xlink"})
    root.attrib.update({"version": "1.1", "width": width, "height": height})
    described = sum(child.tag in ("title", "desc") for child in root)
    root.insert(described, Element("rect", width=width, height=height, fill=colour))


# The style sheet ------------------------------------------------------------------------------------------------------


@cache
def _rules(css: str, theme: str) -> list[tuple[str, frozenset[str], Style]]:
    """Tag ("" for any), classes and style of every rule, the weaker ones first, all variables resolved."""
    variables = _variables(css, theme)
    resolved = re.sub(r"var\(--(\w+)\)", lambda found: variables[found[1]], _without_media(css))
    rules = []
    for selectors, declarations in re.findall(r"([^{}]+)\{([^{}]*)\}", resolved):
        for selector in selectors.split(","):
            plain = re.fullmatch(r"\.camviz-svg (\w*)((?:\.[\w-]+)*)", selector.strip())
            if plain:
                rules.append((plain[1], frozenset(plain[2].split(".")[1:]), _declared(declarations)))
    return sorted(rules, key=lambda rule: (len(rule[1]), bool(rule[0])))


@cache
def _variables(css: str, theme: str) -> Style:
    block = re.search(rf'\[data-theme="{theme}"\] \.camviz-svg \{{([^}}]*)\}}', css)
    return dict(re.findall(r"--(\w+): *(#\w+)", block[1] if block else ""))


def _without_media(css: str) -> str:
    return re.sub(r"@media[^{]*\{(?:[^{}]*\{[^{}]*\})*[^{}]*\}", "", css)


def _declared(declarations: str) -> Style:
    pairs = (declaration.split(":", 1) for declaration in declarations.split(";") if ":" in declaration)
    return {name.strip(): value.strip() for name, value in pairs}


def _styled(root: Element, rules: list[tuple[str, frozenset[str], Style]]) -> None:
    """Write the style of every element into its attributes, and drop the elements that are not shown."""
    for parent in list(root.iter()):
        for child in list(parent):
            style = _style(child, rules)
            if style.get("display") == "none":
                parent.remove(child)
            else:
                child.attrib.update(style)
    root.attrib.update({"font-family": SANS, "font-size": "13"})


def _style(element: Element, rules: list[tuple[str, frozenset[str], Style]]) -> Style:
    """What holds for an element: rules, then what it says itself, then what a rule calls important."""
    classes = set(element.get("class", "").split())
    style: Style = {}
    for tag, wanted, declared in rules:
        if tag in ("", element.tag) and wanted <= classes:
            style.update(declared)
    important = {name: value.split("!")[0].strip() for name, value in style.items() if value.endswith("!important")}
    style |= _declared(element.get("style", "")) | important
    return {name: _value(name, value) for name, value in style.items()} | _of_text(style)


def _value(name: str, value: str) -> str:
    if name == "font-family":
        return MONO if "monospace" in value else SANS
    if name == "font-weight":
        return "bold" if value == "600" else value
    return re.sub(r"(?<=\d)px\b", "", value)


def _of_text(style: Style) -> Style:
    return {_SPACE: "preserve"} if style.get("white-space") == "pre" else {}


# What only browsers draw ----------------------------------------------------------------------------------------------


def _halos(root: Element) -> None:
    """Words whose stroke is painted first become two elements: the stroke, and the words over it."""
    for parent in list(root.iter()):
        for place, child in reversed(list(enumerate(parent))):
            if child.tag == "text" and child.get("paint-order") == "stroke":
                halo = deepcopy(child)
                halo.set("fill", child.attrib["stroke"])
                for name in [name for name in child.attrib if name.startswith("stroke")]:
                    del child.attrib[name]
                parent.insert(place, halo)


def _panels(root: Element) -> None:
    """Nested `<svg>` elements, all of which keep their scale, become groups that are moved and clipped."""
    for count, panel in enumerate(list(root.iter("svg"))[1:], 1):
        x, y = panel.attrib.pop("x"), panel.attrib.pop("y")
        size = {"width": panel.attrib.pop("width"), "height": panel.attrib.pop("height")}
        content = list(panel)
        for child in content:
            panel.remove(child)
        panel.tag = "g"
        panel.attrib = {"transform": f"translate({x} {y})"}
        clip = SubElement(panel, "clipPath", id=f"panel-{count}")
        SubElement(clip, "rect", {"x": "0", "y": "0"} | size)
        SubElement(panel, "g", {"clip-path": f"url(#panel-{count})"}).extend(content)


def _photographs(root: Element, photographs: dict[str, bytes]) -> None:
    """Put the photographs inside, those under a mask with the mask as transparency."""
    masks = {mask.attrib["id"]: _attached(mask[0]) for mask in root.iter("mask")}
    for parent in list(root.iter()):
        for mask in parent.findall("mask"):
            parent.remove(mask)
    for image in root.iter("image"):
        if image.get("href", "").startswith("attached:"):
            data = photographs[_attached(image)]
            if "mask" in image.attrib:
                data = _masked(data, photographs[masks[image.attrib["mask"][5:-1]]])
            else:
                data = _enlarged(data, image)
            kind = "png" if data.startswith(b"\x89PNG") else "jpeg"
            image.set("href", f"data:image/{kind};base64,{b64encode(data).decode()}")


def _attached(image: Element) -> str:
    return image.attrib["href"].removeprefix("attached:")


def _masked(photograph: bytes, mask: bytes) -> bytes:
    """The photograph with the brightness of the mask as its transparency, PNG."""
    colour, alpha = _decoded(photograph, cv2.IMREAD_COLOR), _decoded(mask, cv2.IMREAD_GRAYSCALE)
    return _png(np.dstack([colour, alpha]))


def _enlarged(photograph: bytes, image: Element) -> bytes:
    """The photograph with more pixels, as PNG, where it has few for its place.

    Hard pixels are repeated. Smooth ones are interpolated, for Cairo fades the outermost half of a pixel away.
    """
    hard = image.get("image-rendering") == "pixelated"
    pixels = _decoded(photograph, cv2.IMREAD_UNCHANGED)
    size = np.array([float(image.attrib["width"]), float(image.attrib["height"])])
    stretch = size / pixels.shape[1::-1]
    if stretch.max() <= (1 if hard else _SMOOTH):
        return photograph
    fx, fy = np.maximum(np.ceil((_SHARP if hard else 1) * stretch), 1)
    way = cv2.INTER_NEAREST if hard else cv2.INTER_LINEAR
    return _png(np.asarray(cv2.resize(pixels, None, fx=fx, fy=fy, interpolation=way)))


def _decoded(data: bytes, flags: int) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), flags))


def _png(pixels: np.ndarray) -> bytes:
    return cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 6])[1].tobytes()
