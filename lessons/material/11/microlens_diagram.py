"""How the rays of one scene point fall on the microlenses behind a main lens: a diagram, not to scale."""

from __future__ import annotations

import numpy as np

from camviz.draw import svg
from camviz.draw.panel import Panel
from camviz.lenses.base import Array

_WIDTH, _HEIGHT = 440, 165
_LENS_X, _FILM = 150.0, 170.0  # the lens, and how far behind it the microlenses are
_OBJECT = 100.0  # how far before it the focused plane is
_PLACE, _PITCH = 14.0, 5.0  # between places of the aperture, and between microlenses
_MIDDLE = _HEIGHT / 2


def drawn(x: float, y: float, slope: float, shear: float, row: Array, chosen: int, opening: float = 0.0) -> svg.Marks:
    """The panel at (x, y): rays of a point that moves by `slope`, and the film that shearing by `shear` stands for.

    `row` (columns,) are the weights of the aperture's places, `chosen` one of them. At the microlenses, the ray through
    the place j steps from the middle arrives slope · j microlenses from the axis: it is the light of that view's pixel.
    Through an `opening` as wide as so many steps the light of one view spreads over slope · opening microlenses.
    """
    panel = Panel("microlenses", x, y, _WIDTH, _HEIGHT, 0, _WIDTH, 0, _HEIGHT)
    steps = np.arange(len(row)) - (len(row) - 1) / 2
    scale = min(1.0, 8 / max(len(row) - 1, 1))
    content = _camera(scale * steps) + _bundle(scale * (chosen - (len(row) - 1) / 2), scale * opening, slope)
    content += _rays(scale * steps, slope, row, chosen) + _film(shear)
    return panel.show(content, title="Rays of the marked point", note="not to scale")


def _conjugates(slope: float) -> tuple[float, float]:
    """Where a point of this slope lies, and how far behind the lens its rays meet.

    1/object + 1/image is the same for every point: what is near meets behind the microlenses.
    """
    nearer = slope * _PITCH / _PLACE / _FILM
    return _LENS_X - 1 / max(1 / _OBJECT + nearer, 1e-4), 1 / max(1 / _FILM - nearer, 1e-4)


def _bundle(step: float, width: float, slope: float) -> svg.Marks:
    """What comes through one opening, as wide as it is, and the opening itself."""
    if not width:
        return svg.NOTHING
    start, _ = _conjugates(slope)
    edges = step + np.array([-0.5, 0.5]) * width
    lens = [(_LENS_X, _MIDDLE + edge * _PLACE) for edge in edges]
    film = [(_LENS_X + _FILM, _MIDDLE + slope * edge * _PITCH) for edge in edges]
    light = svg.polygon([(start, _MIDDLE), lens[0], film[0], film[1], lens[1]], "wash fill-purple")
    return light + svg.line(lens, "purple thick")


def _rays(steps: np.ndarray, slope: float, row: Array, chosen: int) -> svg.Marks:
    """From the point through every place of the lens to its microlens, and on to where they would meet."""
    start, meeting = _conjugates(slope)
    parts = []
    for j, (step, weight) in enumerate(zip(steps, row, strict=True)):
        lens = (_LENS_X, _MIDDLE + step * _PLACE)
        hit = (_LENS_X + _FILM, _MIDDLE + slope * step * _PITCH)
        colour = "blue" if step < 0 else "orange" if step > 0 else "ink"
        class_ = f"{'purple thick' if j == chosen else colour + ' thin'}{'' if weight else ' faint'}"
        onward = svg.line([hit, (_LENS_X + meeting, _MIDDLE)], f"{class_} dotted half") * (meeting > _FILM)
        parts.append(
            (j == chosen, onward + svg.line([(start, _MIDDLE), lens, hit], class_) + svg.dots([hit], class_, 4))
        )
    point = svg.dots([(start, _MIDDLE)], "ink", 8) if start > 6 else svg.NOTHING
    return svg.join(one for _, one in sorted(parts, key=lambda part: part[0])) + point


def _camera(steps: np.ndarray) -> svg.Marks:
    half = np.abs(steps).max(initial=0) * _PLACE + _PLACE / 2
    turn = np.linspace(-1, 1, 21)
    lens = np.stack([_LENS_X + 9 * np.sqrt(1 - turn**2), _MIDDLE + half * turn], axis=-1)
    body = svg.polygon(np.concatenate([lens, lens[::-1] * (-1, 1) + (2 * _LENS_X, 0)]), "wash fill-sky")
    body += svg.line(np.concatenate([lens, lens[::-1] * (-1, 1) + (2 * _LENS_X, 0)]), "sky")
    count = int((_HEIGHT / 2 - 6) / _PITCH)
    along = np.linspace(-count - 0.5, count + 0.5, 8 * (2 * count + 1) + 1)
    bumps = np.stack([_LENS_X + _FILM + 4 * np.abs(np.cos(np.pi * along)), _MIDDLE + _PITCH * along], axis=-1)
    sensor = [(_LENS_X + _FILM + 11, 4), (_LENS_X + _FILM + 11, _HEIGHT - 4)]
    names = svg.text((_LENS_X, _HEIGHT - 4), "main lens", "note halo middle")
    names += svg.text((_LENS_X + _FILM - 6, 14), "microlenses", "note halo end")
    names += svg.text((_LENS_X + _FILM + 18, 14), "sensor", "note halo")
    return body + svg.line(bumps, "sky thin") + svg.line(sensor, "ink thick") + names


def _film(shear: float) -> svg.Marks:
    """Where a film would have to be to record what the shear sums: at F / (1 − d p / b)."""
    over = 1 - shear * _PITCH / _PLACE
    at = _LENS_X + _FILM / over if over > 0 else np.inf
    if at > _WIDTH - 8:
        return _below_each_other(_WIDTH - 6, ("film for this", "shear: beyond"), "red end halo")
    side = "end" if at > _LENS_X + _FILM - 40 else ""
    names = _below_each_other(at + (-6 if side else 6), ("film for", "this shear"), f"red halo {side}")
    return svg.line([(at, 0), (at, _HEIGHT)], "red dashed") + names


def _below_each_other(x: float, words: tuple[str, str], class_: str) -> svg.Marks:
    """Two short lines at the foot, where one would lie on the sensor."""
    return svg.join(svg.text((x, y), line, class_) for y, line in zip((_HEIGHT - 24, _HEIGHT - 8), words, strict=True))
