"""A finished picture: marks with photographs attached, that can show itself anywhere."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np

from camviz.draw import styles, svg
from camviz.draw.flow import FLOW_WIDTH, Tile
from camviz.draw.marks import Marks, join
from camviz.draw.writing import FileWriter, PageWriter, element

Part = TypeVar("Part")


@dataclass(frozen=True)
class Picture:
    """What a view looks like now. `description` states the present state in words and numbers (the alternative text).

    The tiles refer to photographs as `attached:name`; a live pane receives them as bytes, a file carries them inside.
    """

    tiles: tuple[Tile, ...]
    title: str
    description: str
    photographs: dict[str, bytes] = field(default_factory=dict)

    @classmethod
    def whole(
        cls,
        marks: Marks,
        width: float,
        height: float,
        title: str,
        description: str,
        photographs: dict[str, bytes] | None = None,
    ) -> Picture:
        """A picture of one tile."""
        return cls((Tile(title, (0, 0, width, height), marks),), title, description, photographs or {})

    @property
    def width(self) -> float:
        """Picture units."""
        return max(x + width for x, _, width, _ in (tile.cell for tile in self.tiles))

    @property
    def height(self) -> float:
        """Picture units."""
        return max(y + height for _, y, _, height in (tile.cell for tile in self.tiles))

    @cached_property
    def marks(self) -> Marks:
        """All tiles at their places, their words clear of each other."""
        paper = svg.rectangle(0, 0, self.width, self.height, "paper")
        return paper + join(tile.uncluttered() for tile in self.tiles)

    @property
    def body(self) -> str:
        """All tiles at their places, as SVG for a page with the style sheet."""
        return PageWriter().write(self.marks)

    def svg(self) -> str:
        """The body as an `<svg>` element whose photographs are still `attached:name`."""
        words = f"<title>{escape(self.title)}</title><desc>{escape(self.description)}</desc>"
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" class="camviz-svg" role="img" '
            f'aria-label="{escape(self.title)}. {escape(self.description)}" '
            f'viewBox="0 0 {self.width:g} {self.height:g}">{words}{self.body}</svg>'
        )

    def flow(self, units: Mapping[str, float] | None = None) -> str:
        """HTML whose tiles flow, for a page with the style sheet `flow.css`; photographs are still `attached:name`.

        `units` says how many picture units make a CSS pixel in the tile of a name, where it is not one.
        """
        return "".join(self.around(tile.html((units or {}).get(tile.name, 1.0)) for tile in self.tiles))

    def around(self, tiles: Iterable[Part]) -> tuple[Part | str, ...]:
        """The parts of `flow`: what stands before the tiles, the tiles in the form that they have, and what follows."""
        named = f'aria-label="{escape(self.title)}" aria-description="{escape(self.description)}"'
        return (f'<div class="camviz-flow" role="group" {named}>', *tiles, "</div>")

    def embedded(self) -> str:
        """The flowing tiles with their photographs inside, for a page that has the style sheets."""
        return self._with_photographs(self.flow())

    def _with_photographs(self, markup: str) -> str:
        for name, data in self.photographs.items():
            markup = markup.replace(f'"attached:{name}"', f'"data:{_mime(data)};base64,{b64encode(data).decode()}"')
        return markup

    def standalone(self) -> str:
        """One SVG document with style and photographs inside, for browsers: it follows their light or dark theme."""
        svg = self._with_photographs(self.svg()).replace(
            "viewBox=", f'width="{self.width:g}" height="{self.height:g}" viewBox=', 1
        )
        return svg.replace("<title>", f"<style>{styles.sheet()}</style><title>", 1)

    def figure(self, address: Callable[[Tile], str] | None = None) -> str:
        """An HTML figure whose tiles flow, each an image; the first has the whole alternative text.

        The images are inside the figure unless `address` says where a tile's `document` is: then they are loaded when
        they come near the screen, and have their sizes before.
        """
        alternatives = [f"{self.title}. {self.description}", *(tile.name for tile in self.tiles[1:])]
        images = "".join(
            f'<div style="flex:1 1 100%">{tile.sentences}</div>'
            if tile.words
            else (tile.image(address(tile), words, later=True) if address else tile.image(self._alone(tile), words))
            for tile, words in zip(self.tiles, alternatives, strict=True)
        )
        return f'<figure style="margin:0;display:flex;flex-wrap:wrap;max-width:{FLOW_WIDTH}">{images}</figure>'

    def _alone(self, tile: Tile) -> str:
        """A tile as the address of its document."""
        return f"data:image/svg+xml;base64,{b64encode(self.document(tile).encode()).decode()}"

    def document(self, tile: Tile) -> str:
        """A tile as an SVG document with style and photographs inside; its words grow where it is shown small."""
        return self._with_photographs(tile.document(f"<style>{page_style()}</style>"))

    def save(self, path: str | Path, *, theme: str = "light", dpi: float = 192) -> None:
        """Write the picture to a file that ends in .svg, .png or .pdf.

        `theme` is "light" or "dark"; an SVG of the theme "browser" follows the theme of the browser that shows it, and
        only browsers show it right. A unit of the picture is 1/96 inch: a PNG has `dpi` pixels an inch, so that 192
        makes two pixels of a unit. Fonts are embedded in a PDF. Raises ValueError for another ending or theme, and
        ModuleNotFoundError with the remedy where PNG or PDF needs cairosvg and it does not work.
        """
        path = Path(path)
        if path.suffix not in (".svg", ".png", ".pdf"):
            raise ValueError(f"path must end in .svg, .png or .pdf, got {path.name!r}")
        if path.suffix == ".svg":
            text = self.standalone() if theme == "browser" else self.portable(theme)
            path.write_text(text, encoding="utf-8")
        else:
            path.write_bytes(_converted(self.portable(theme), path.suffix, dpi))

    def portable(self, theme: str = "light") -> str:
        """One SVG document in colours of the "light" or "dark" theme, for programs that are no browser."""
        size = {"width": self.width, "height": self.height}
        words = element("title", escape(self.title)) + element("desc", escape(self.description))
        content = FileWriter(theme, self.photographs).write(self.marks)
        return '<?xml version="1.0" encoding="UTF-8"?>\n' + element(
            "svg", words + content, xmlns="http://www.w3.org/2000/svg", version="1.1", **size,
            viewBox=f"0 0 {self.width:g} {self.height:g}", font_family=styles.SANS, font_size=styles.SIZE,
            **{"xmlns:xlink": "http://www.w3.org/1999/xlink"},
        )  # fmt: skip

    def _repr_mimebundle_(self, **_: Any) -> dict[str, str]:
        return {"text/html": self.figure(), "text/plain": f"{self.title}. {self.description}"}


def jpeg(image: np.ndarray, quality: int = 85) -> bytes:
    """A uint8 image, RGB (height, width, 3) or grey (height, width), as JPEG."""
    return _encode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])


def png(image: np.ndarray) -> bytes:
    """A uint8 image, RGB, RGBA or grey, as PNG: for masks, maps and few colours."""
    return _encode(".png", image, [])  # OpenCV's own settings are the quickest: half the time of compression 1


@cache
def page_style() -> str:
    """The style sheets of a page on which tiles flow: no word on it is below 12 CSS pixels."""
    return styles.sheet() + (files("camviz.draw") / "flow.css").read_text(encoding="utf-8")


def _converted(svg: str, suffix: str, dpi: float) -> bytes:
    """An SVG document as PNG or PDF."""
    try:
        import cairosvg
    except (ImportError, OSError) as error:  # OSError where the Cairo library of the system is not found
        raise ModuleNotFoundError(
            "PNG and PDF need cairosvg and the Cairo library: `pip install camviz[figures]`, and on Debian and Ubuntu "
            "`apt install libcairo2`, on macOS `brew install cairo`; SVG needs neither."
        ) from error
    convert = cairosvg.svg2png if suffix == ".png" else cairosvg.svg2pdf
    return bytes(convert(bytestring=svg.encode(), scale=dpi / 96 if suffix == ".png" else 1))


def _encode(extension: str, image: np.ndarray, options: list[int]) -> bytes:
    if image.dtype != np.uint8 or image.ndim not in (2, 3) or not image.size:
        raise ValueError(f"a picture is uint8 (height, width) or (height, width, 3), got {image.dtype} {image.shape}")
    swap = {3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}
    pixels = cv2.cvtColor(image, swap[image.shape[2]]) if image.ndim == 3 else image
    done, data = cv2.imencode(extension, pixels, options)
    if not done:
        raise ValueError(f"OpenCV cannot write an image of shape {image.shape} as {extension}")
    return data.tobytes()


def _mime(data: bytes) -> str:
    kinds = {b"\x89PNG": "image/png", b"RIFF": "image/webp"}
    return kinds.get(data[:4], "image/jpeg")
