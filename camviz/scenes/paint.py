"""Pictures for the surfaces, painted from noise and from photographs: sRGB bytes (height, width, 3)."""

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.scenes.light import sunlight, to_linear
from camviz.scenes.photographs import photograph

Plane = NDArray[np.floating]  # (height, width), or (height, width, 3) while it is being painted
Picture = NDArray[np.uint8]
HILLS = (0.50, 0.62, 0.58)  # the nearer hills, and the colour that distance gives the lawn


def noise(height: int, width: int, cell: int, seed: int, octaves: int = 4) -> Plane:
    """Smooth noise (height, width) of mean 0 and standard deviation 1, its largest blots about `cell` wide.

    It tiles where `cell` is a power of 2 that divides the height and the width.
    """
    rng = np.random.default_rng(seed)
    total = np.zeros((height, width), dtype=np.float32)
    for octave in range(octaves):
        size = max(cell >> octave, 1)
        knots = rng.standard_normal((-(-height // size), -(-width // size)), dtype=np.float32)
        around = np.pad(knots, 2, mode="wrap")
        fine = cv2.resize(around, None, fx=size, fy=size, interpolation=cv2.INTER_CUBIC)
        total += fine[2 * size : 2 * size + height, 2 * size : 2 * size + width] / 2**octave
    return (total - total.mean()) / total.std()


def tinted(values: Plane, colours: ArrayLike) -> Plane:
    """Grey values (height, width), cut off to 0…1, turned into a gradient through colours (n, 3)."""
    colours = np.asarray(colours, dtype=float)
    stops = np.linspace(0, 1, len(colours))
    return np.stack([np.interp(values, stops, channel).astype(np.float32) for channel in colours.T], axis=-1)


def in_bytes(picture: Plane) -> Picture:
    """sRGB 0…1 as bytes 0…255."""
    return np.multiply(np.clip(picture, 0, 1), 255, dtype=np.float32).round().astype(np.uint8)


def plain(height: int, width: int, colour: ArrayLike) -> Picture:
    """One colour, sRGB 0…1."""
    return in_bytes(np.broadcast_to(np.asarray(colour, dtype=float), (height, width, 3)))


def lit_round(picture: Picture, upright: bool = False) -> Plane:
    """Linear light (height, width, 3) of a picture wound around a sphere, or around an upright column, in the sun."""
    height, width = picture.shape[:2]
    longitude = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    latitude = np.full(height, np.pi / 2) if upright else np.pi * (np.arange(height) + 0.5) / height
    ring, rise = np.sin(latitude)[:, None], np.cos(latitude)[:, None] + 0 * longitude
    normals = np.stack([ring * np.sin(longitude), -rise, -ring * np.cos(longitude)], axis=-1)
    return to_linear(picture) * sunlight(normals)[..., None]


def bricks(columns: int = 8, courses: int = 24) -> Picture:
    """A wall in running bond that tiles: dead level, so that whatever bends it is the lens."""
    high, wide, joint = 22, 64, 3
    rng = np.random.default_rng(7)
    height, width = courses * high, columns * wide
    v, u = np.mgrid[0:height, 0:width]
    course = v // high
    across = (u + course % 2 * wide // 2) % width
    tone = 0.45 + rng.normal(0, 0.13, (courses, columns))[course, across // wide]
    tone += 0.05 * noise(height, width, 16, seed=6) + 0.04 * rng.standard_normal((height, width))
    clay = tinted(tone, [(0.36, 0.17, 0.13), (0.64, 0.34, 0.25), (0.84, 0.55, 0.42)])
    mortar = tinted(0.5 + 0.1 * noise(height, width, 8, seed=9), [(0.72, 0.67, 0.60), (0.88, 0.83, 0.74)])
    return in_bytes(np.where(((across % wide < joint) | (v % high < joint))[..., None], mortar, clay))


def lawn() -> Picture:
    """Grass that tiles: the grey photograph beside its mirror images, tinted."""
    grey = cv2.resize(photograph("grass")[..., 0], (160, 160), interpolation=cv2.INTER_AREA) / 255
    grey = np.block([[grey, grey[:, ::-1]], [grey[::-1], grey[::-1, ::-1]]])
    greens = [(0.16, 0.27, 0.08), (0.42, 0.56, 0.20), (0.68, 0.76, 0.38)]
    return in_bytes(tinted(0.5 + 1.1 * (grey - grey.mean()), greens))


def paving(columns: int, rows: int, texels: int = 32) -> Picture:
    """Square flagstones, each with a tone of its own, and joints between them."""
    height, width = rows * texels, columns * texels
    rng = np.random.default_rng(3)
    chequer = np.add.outer(np.arange(rows), np.arange(columns)) % 2
    tone = np.kron(0.46 + 0.16 * chequer + rng.normal(0, 0.035, (rows, columns)), np.ones((texels, texels)))
    grain = 0.018 * noise(height, width, 32, seed=5) + 0.012 * rng.standard_normal((height, width))
    stone = tinted(tone + grain, [(0.30, 0.26, 0.22), (1.0, 0.95, 0.86)])
    edge = np.minimum(np.arange(texels), np.arange(texels)[::-1])
    joint = np.clip(np.minimum.outer(edge, edge) / 1.5, 0, 1)
    stone *= (0.55 + 0.45 * np.tile(joint, (rows, columns)))[..., None]
    return in_bytes(stone)


def checkerboard(columns: int, rows: int, texels: int = 32) -> Picture:
    """columns × rows squares, `texels` wide, the first one black, on white paper with a margin of half a square."""
    dark = np.add.outer(np.arange(rows), np.arange(columns)) % 2 == 0
    squares = np.kron(np.where(dark, 42, 238), np.ones((texels, texels))).astype(np.uint8)
    return np.repeat(np.pad(squares, texels // 2, constant_values=238)[..., None], 3, axis=2)


def planks(size: int = 256) -> Picture:
    """The side of a wooden crate: five boards in a frame, with a brace from corner to corner."""
    y, x = np.mgrid[0:size, 0:size] / size
    grain = noise(size, size, 64, seed=11)
    streaks = cv2.GaussianBlur(np.random.default_rng(12).standard_normal((size, size)), (0, 0), 9, sigmaY=0.8)
    board = np.floor(y * 5)
    tone = 0.52 + 0.05 * np.cos(2.4 * board + 1) + 0.02 * grain + 0.30 * streaks
    tone -= 0.30 * (np.abs(y * 5 - np.rint(y * 5)) < 0.035)
    edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    brace = np.abs(x - y) / np.sqrt(2)
    for distance, width in ((brace, 0.055), (edge, 0.105)):
        rail = 0.60 + 0.02 * grain + 0.25 * streaks.T
        tone = np.where(distance < width, rail, tone - 0.16 * np.exp(-np.maximum(distance - width, 0) / 0.012))
        tone -= 0.25 * (np.abs(distance - width) < 0.004)
    return in_bytes(tinted(tone, [(0.16, 0.08, 0.04), (0.62, 0.38, 0.18), (0.93, 0.75, 0.50)]))


def globe(height: int = 256) -> Picture:
    """A made-up planet: land and sea from noise, ice at the poles, meridians and parallels every 30°."""
    width = 2 * height
    land = noise(height, width, 64, seed=29, octaves=6)
    latitude = np.abs(np.linspace(-90, 90, height))[:, None] + 5 * noise(height, width, 16, seed=8)
    sea = tinted(0.5 + 0.25 * land, [(0.03, 0.16, 0.40), (0.10, 0.42, 0.66), (0.45, 0.76, 0.82)])
    earth = tinted(land / 2.2, [(0.78, 0.74, 0.48), (0.36, 0.56, 0.24), (0.47, 0.38, 0.22), (0.90, 0.88, 0.85)])
    planet = np.where((land > 0.15)[..., None], earth, sea)
    planet = np.where((latitude > 74)[..., None], (0.95, 0.97, 0.99), planet)
    step = height / 6
    v, u = np.arange(height)[:, None] + 0.5, np.arange(width) + 0.5
    parallels = np.abs(v / step - np.rint(v / step)) * step < 0.9
    meridians = np.abs(u / step - np.rint(u / step)) * step * np.maximum(np.sin(np.pi * v / height), 0.05) < 0.9
    return in_bytes(np.where((parallels | meridians)[..., None], 0.55 * planet + 0.45, planet))


def beach_ball(height: int = 128) -> Picture:
    """Six coloured gores and a white cap at each pole."""
    colours = np.array([(0.86, 0.22, 0.20), (0.97, 0.95, 0.90), (0.98, 0.76, 0.20), (0.97, 0.95, 0.90)])
    gore = np.arange(2 * height) * 8 // (2 * height)
    picture = np.broadcast_to(colours[gore % 4], (height, 2 * height, 3)).copy()
    picture[: height // 12] = picture[-height // 12 :] = colours[1]
    return in_bytes(picture)


def framed(picture: Picture, border: float = 0.07) -> Picture:
    """A picture in a passe-partout and a dark wooden frame."""
    mat = int(border * max(picture.shape))
    frame = mat // 2
    inside = np.pad(picture, ((mat, mat), (mat, mat), (0, 0)), constant_values=245)
    framed = plain(inside.shape[0] + 2 * frame, inside.shape[1] + 2 * frame, (0.24, 0.15, 0.10))
    framed[frame:-frame, frame:-frame] = inside
    return framed


def sky(width: int = 1024) -> Picture:
    """Equirectangular sky: pale at the horizon, deep blue above, fair-weather clouds, two ridges of hills.

    It ends 6° below the horizon: nobody sees through the lawn.
    """
    texel = 360 / width
    height = round(96 / texel)
    elevation = 90 - texel * (np.arange(height)[:, None] + 0.5)
    blues = [(0.89, 0.93, 0.93), (0.70, 0.85, 0.94), (0.45, 0.69, 0.89), (0.30, 0.55, 0.82), (0.22, 0.45, 0.74)]
    picture = tinted(np.broadcast_to(np.maximum(elevation / 55, 0) ** 0.75, (height, width)), blues)
    puffs = cv2.resize(noise(width, width, 64, seed=21, octaves=6), (width, width // 2), interpolation=cv2.INTER_AREA)
    puffs = puffs[:height]
    # At the zenith, where the picture is pinched to a point, clouds would run together in a star.
    open_sky = np.clip((elevation - 5) / 8, 0, 1) * np.clip((84 - elevation) / 24, 0, 1)
    layers = [(np.clip(puffs - 0.7, 0, 0.85) * open_sky, (1.0, 0.99, 0.97))]
    ridges = noise(128, width, 128, seed=2, octaves=5)[::64]
    for ridge, rise, swing, colour in zip(ridges, (3.6, 1.9), (1.2, 0.7), ((0.62, 0.73, 0.80), HILLS), strict=True):
        layers.append((np.clip((rise + swing * ridge - elevation) / texel + 0.5, 0, 1), colour))
    for cover, colour in layers:
        for channel, value in enumerate(colour):
            picture[..., channel] += cover * (value - picture[..., channel])
    return in_bytes(picture)


def leaves(size: int = 128) -> Picture:
    """Clipped box leaves, for something round."""
    tone = 0.5 + 0.16 * noise(size, 2 * size, 8, seed=41, octaves=3)
    return in_bytes(tinted(tone, [(0.06, 0.14, 0.05), (0.22, 0.38, 0.14), (0.52, 0.64, 0.30)]))
