"""The steps from a picture to its mosaic and back, each kept for as long as nothing before it changes."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.fft import fftshift, rfft2

from camviz import mosaics
from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz.mosaics import Pattern
from camviz.mosaics.measures import Measures
from camviz.scenes import render, textured_scene, to_display, to_linear
from camviz.scenes.photographs import photograph

LARGEST = 256  # pixels of a picture's longer side
Source = tuple[str, float] | tuple[bytes, tuple[int, ...]]


@lru_cache(maxsize=2)
def light(source: Source) -> NDArray:
    """The picture in linear light (height, width, 3)."""
    name, given = source
    if isinstance(name, bytes):
        return _reduced(np.frombuffer(name, np.uint8).reshape(given), LARGEST)  # type: ignore[arg-type]
    if name == "zone plate":
        return mosaics.zone_plate(256, float(given))  # type: ignore[arg-type]
    return _reduced(photograph("astronaut"), 256) if name == "astronaut" else _garden()


def _reduced(picture: NDArray[np.uint8], largest: int) -> NDArray[np.float32]:
    """Light averaged over areas, so that what another camera interpolated is mostly gone."""
    light = to_linear(picture).astype(np.float32)
    scale = largest / max(light.shape[:2])
    return cv2.resize(light, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1 else light


@lru_cache(maxsize=1)
def _garden() -> NDArray:
    camera = Camera(Intrinsics.from_fov(256, 256, 40))
    return np.clip(render(textured_scene(), camera, supersample=3), 0, 1)


@lru_cache(maxsize=2)
def shown(source: Source) -> NDArray[np.uint8]:
    return to_display(light(source))


@lru_cache(maxsize=2)
def measured(source: Source, pattern: Pattern, spots_px: float) -> Array:
    return mosaics.mosaic(mosaics.low_pass(light(source), spots_px), pattern)


@lru_cache(maxsize=2)
def rebuilt(source: Source, pattern: Pattern, spots_px: float, algorithm: str) -> NDArray[np.uint8]:
    return to_display(mosaics.demosaic(measured(source, pattern, spots_px), pattern, algorithm))


@lru_cache(maxsize=2)
def compared(source: Source, pattern: Pattern, spots_px: float, algorithm: str) -> Measures:
    return mosaics.compare(rebuilt(source, pattern, spots_px, algorithm), shown(source))


@lru_cache(maxsize=2)
def spectrum(source: Source, pattern: Pattern, spots_px: float) -> NDArray[np.uint8]:
    """The mosaic's spectrum as a grey picture, by logarithm: −½ … ½ cycles/pixel each way, zero in the middle."""
    values = measured(source, pattern, spots_px).astype(np.float32)
    values = values - values.mean()
    height, width = values.shape
    values *= np.outer(np.hanning(height), np.hanning(width)).astype(np.float32)
    half = fftshift(np.abs(rfft2(values)), axes=0)
    small = cv2.resize(half, (66, 132), interpolation=cv2.INTER_AREA)
    level = np.log10(np.maximum(np.hstack([small[::-1, :0:-1], small]), 1e-6))
    return np.clip(255 * (level - level.max() + 3) / 3, 0, 255).astype(np.uint8)
