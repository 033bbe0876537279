"""Fixed patterns: what differs from pixel to pixel of one specimen, the same in every frame."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from camviz.sensors.counting import Floats


@dataclass(frozen=True, eq=False)
class FixedPattern:
    """What differs from pixel to pixel of one specimen, the same in every frame.

    Attributes:
        gain: (height, width), PRNU: a factor about 1.
        offset_e: (height, width), DSNU, in electrons.

    >>> pattern = Sensor(prnu=0.01, dsnu_e=3).pattern(200, 200)
    >>> pattern.gain.std().round(3), pattern.offset_e.std().round(1)
    (np.float32(0.01), np.float32(3.0))
    """

    gain: Floats
    offset_e: Floats


@dataclass(frozen=True)
class Spread:
    """A pattern's standard deviation, and which shares of its variance whole columns and whole rows carry."""

    deviation: float
    column_share: float = 0.0
    row_share: float = 0.0

    def field(self, height: int, width: int, rng: np.random.Generator) -> Floats:
        """A field (height, width): s² = s²_pixel + s²_column + s²_row (EMVA 1288 release 4.0, spatial variances)."""
        pixel_share = max(1 - self.column_share - self.row_share, 0)
        field = rng.standard_normal((height, width), dtype=np.float32) * np.float32(pixel_share**0.5)
        field += rng.standard_normal((1, width), dtype=np.float32) * np.float32(self.column_share**0.5)
        field += rng.standard_normal((height, 1), dtype=np.float32) * np.float32(self.row_share**0.5)
        field *= np.float32(self.deviation)
        return field


@lru_cache(maxsize=2)
def fixed_pattern(gain: Spread, offset_e: Spread, specimen: int, height: int, width: int) -> FixedPattern:
    """The pattern of the specimen with that number: always the same one. It is kept, and may not be written to."""
    rng = np.random.Generator(np.random.SFC64([specimen, height, width]))
    fields = (1 + gain.field(height, width, rng), offset_e.field(height, width, rng))
    for one in fields:
        one.flags.writeable = False
    return FixedPattern(*fields)
