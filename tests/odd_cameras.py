"""Cameras that obey the linear model of EMVA 1288 and cameras that break it, each in one way, with their true figures.

The frames are those of `plain_cameras`, spoiled or bent in plain NumPy.
"""

from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any

import numpy as np
from plain_cameras import PlainCamera, Shooting, error, truth

from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import LINEARITY, Level
from camviz_clinic.measuring.noise.statistics import stack

BY_GAIN = {"gain_dn_per_e", "read_noise_e", "quantum_efficiency", "full_well_e", "snr_max_db", "dynamic_range_db"} | {
    "threshold_e",
    "threshold_photons",
    "dsnu_e",
    "dark_current_e_per_s",
}
LINEAR = {"linearity_error", "linearity_error_min", "linearity_error_max"}


@dataclass(frozen=True, eq=False)
class OddCamera(PlainCamera):
    """A plain camera that is odd in one way.

    `after` makes other frames of its frames (DN before rounding, as float), `light` shades the photons (height, width),
    `respond` bends the signal in electrons, `wander_e` (of the number of the frame) moves the offset.
    """

    after: Any = None
    light: Any = None
    respond: Any = None
    wander_e: Any = None
    flicker: float = 0.0
    column_e: float = 0.0
    split_e: float = np.inf  # from this signal on it is read at low gain, with `split_read_e`
    split_read_e: float = 0.0
    hot_e_per_s: Any = 0.0
    count: list[int] = field(default_factory=lambda: [0])

    def frame(self, photons, exposure_s, rng):
        rows, columns = self.prnu.shape
        self.count[0] += 1
        light = photons * (1 + self.flicker * rng.standard_normal()) * (1 if self.light is None else self.light)
        dark = (self.dark_e_per_s + self.hot_e_per_s) * exposure_s
        freed = rng.poisson(light * self.efficiency * (1 + self.prnu) + dark)
        signal = np.minimum(freed, self.full_well_e).astype(float)
        read = np.where(signal < self.split_e, self.read_e, self.split_read_e)
        if self.respond is not None:
            signal = self.respond(signal)
        signal += self.dsnu_e + read * rng.standard_normal((rows, columns))
        signal += self.row_e * rng.standard_normal((rows, 1)) + self.column_e * rng.standard_normal((1, columns))
        if self.wander_e is not None:
            signal += self.wander_e(self.count[0], rng)
        dn = self.gain * signal + self.offset_dn
        if self.after is not None:
            dn = self.after(dn)
        return np.clip(np.rint(dn), 0, 2**self.bits - 1).astype(np.uint16)


def box(dn):
    """The mean of 3 × 3 pixels."""
    padded = np.pad(dn, 1, mode="reflect")
    rows, columns = dn.shape
    return sum(padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)) / 9


def softened(dn):
    """A light denoise: a sixteenth of each of the four neighbours."""
    return dn + (sum(np.roll(dn, step, axis) for step in (1, -1) for axis in (0, 1)) - 4 * dn) / 16


def enlarged(dn):
    """Half of the frame, made twice as large by bilinear interpolation along the rows."""
    small = dn[:, ::2]
    return np.repeat(small, 2, axis=1) * np.tile([1, 0.5], dn.shape[1] // 2) + np.roll(
        np.repeat(small, 2, axis=1), -1, axis=1
    ) * np.tile([0, 0.5], dn.shape[1] // 2)


def vignetted(size, corner=0.1):
    """Light that falls with the square of the distance from the middle, to 1 - corner, with a mean of 1."""
    v, u = (np.linspace(-1, 1, count) for count in size)
    light = 1 - corner / 2 * (u[None] ** 2 + v[:, None] ** 2)
    return light / light.mean()


@dataclass(frozen=True, eq=False)
class Kind:
    """A camera of this kind: what its figures are in truth where they are told at all, and what must be withheld."""

    make: Any  # of a size and a generator: the camera
    withheld: set[str] = field(default_factory=set)
    levels: int = 30
    size: tuple[int, int] = (96, 128)
    full: bool = False  # whether every figure must be told


def ordinary(size, rng, *, dsnu_e=2.0, prnu=0.01, **changed):
    """A 12-bit camera of ordinary figures."""
    usual = {
        **{"gain": 0.4, "bits": 12, "read_e": 6.0, "row_e": 0.0, "offset_dn": 60.0, "full_well_e": 9_000.0},
        **{"efficiency": 0.6, "dark_e_per_s": 20.0},
    }
    maps = {"dsnu_e": dsnu_e * rng.standard_normal(size), "prnu": prnu * rng.standard_normal(size)}
    return OddCamera(**{**usual, **maps, **changed})


def _lines(size, rng):
    return rng.standard_normal((size[0], 1)) + rng.standard_normal((1, size[1])) + rng.standard_normal(size)


def _gamma(dn):
    return 255 * (np.clip(dn, 0, 255) / 255) ** (1 / 2.2)


def _hot(size, rng):
    return 400.0 * (rng.random(size) < 0.002)


PARTS = {f"{kind}_{part}{unit}" for kind, unit in (("dsnu", "_e"), ("prnu", "")) for part in ("row", "column", "pixel")}
PRNU = {"prnu", "prnu_row", "prnu_column", "prnu_pixel"}

ORDINARY = {
    "well exposed": Kind(
        lambda size, rng: replace(
            ordinary(
                size, rng, bits=14, gain=0.35, read_e=8.0, offset_dn=64.0, full_well_e=40_000.0, dark_e_per_s=100.0
            ),
            dsnu_e=3 * _lines(size, rng),
            prnu=0.004 * _lines(size, rng),
        ),
        levels=50,
        size=(240, 320),
        full=True,
    ),
    "14 bits": Kind(lambda size, rng: ordinary(size, rng, bits=14, gain=1.6, offset_dn=240.0)),
    "16 bits": Kind(lambda size, rng: ordinary(size, rng, bits=16, gain=2.0, full_well_e=30_000.0, offset_dn=500.0)),
    "8 bits": Kind(
        lambda size, rng: ordinary(size, rng, bits=8, gain=0.025, read_e=40.0, offset_dn=8.0, dark_e_per_s=200.0)
    ),
    "low read noise": Kind(lambda size, rng: ordinary(size, rng, gain=1.0, bits=14, read_e=1.6, dsnu_e=1.0)),
    "high read noise": Kind(
        lambda size, rng: ordinary(size, rng, read_e=25.0, dsnu_e=8.0, dark_e_per_s=300.0, offset_dn=120.0)
    ),
    "strong patterns": Kind(lambda size, rng: ordinary(size, rng, dsnu_e=8.0, prnu=0.02)),
    "fixed rows and columns": Kind(
        lambda size, rng: replace(ordinary(size, rng), dsnu_e=2 * _lines(size, rng), prnu=0.004 * _lines(size, rng))
    ),
    "warm": Kind(lambda size, rng: ordinary(size, rng, dark_e_per_s=300.0)),
    "clipped by the converter": Kind(lambda size, rng: ordinary(size, rng, full_well_e=30_000.0)),
    "row noise": Kind(lambda size, rng: ordinary(size, rng, row_e=6.0, offset_dn=90.0)),
}
"""Eleven cameras that obey the model."""

ODD = {
    "box filter": Kind(lambda size, rng: ordinary(size, rng, after=box), BY_GAIN | PRNU),
    "light denoise": Kind(lambda size, rng: ordinary(size, rng, after=softened), BY_GAIN | PRNU),
    "enlarged": Kind(lambda size, rng: ordinary(size, rng, after=enlarged), BY_GAIN | PRNU),
    "compressive": Kind(
        lambda size, rng: ordinary(size, rng, respond=lambda e: e * (1 - 0.1 * e / 9_000)), BY_GAIN | PRNU
    ),
    "dual gain": Kind(
        lambda size, rng: ordinary(size, rng, split_e=2_500.0, split_read_e=45.0, dsnu_e=4.0),
        BY_GAIN - {"dark_current_e_per_s"},
    ),
    "gamma 2.2, 8 bits": Kind(
        lambda size, rng: ordinary(size, rng, after=_gamma, bits=8, gain=0.028, offset_dn=2.0),
        BY_GAIN | PRNU,
        levels=50,
    ),
    "vignetted": Kind(
        lambda size, rng: ordinary(size, rng, light=vignetted(size)),
        {"prnu", "full_well_e", "snr_max_db", "dynamic_range_db"},
    ),
    "drifting offset": Kind(
        lambda size, rng: ordinary(size, rng, wander_e=lambda n, _: 455.0 / 120 * n, offset_dn=60.0),
        {"dark_current_e_per_s"},
    ),
    "wandering offset": Kind(
        lambda size, rng: ordinary(size, rng, wander_e=lambda _, draw: 5 * draw.standard_normal())
    ),
    "column noise": Kind(lambda size, rng: ordinary(size, rng, column_e=15.0, dsnu_e=3.0, offset_dn=90.0)),
    "clamped black": Kind(
        lambda size, rng: ordinary(size, rng, offset_dn=2.0), {"read_noise_e", "dsnu_e", "threshold_e"}
    ),
    "flicker": Kind(lambda size, rng: ordinary(size, rng, flicker=0.01), LINEAR),
    "hot pixels": Kind(lambda size, rng: ordinary(size, rng, hot_e_per_s=_hot(size, rng))),
}
"""Cameras that break the model, each in one way."""


def shooting(camera, levels):
    """Levels that rise to 15 % beyond saturation within a second, and stacks of 16 frames."""
    share = np.linspace(1 / levels, 1, levels)
    return Shooting(share, share * 1.15 * camera.top_e / camera.efficiency, True, 16)


def truths(camera, how, found):
    """The true figures of an odd camera: those of the sensor before its frames were spoiled, under even light."""
    half = int(np.argmin(abs(how.photons * camera.efficiency - 0.5 * camera.top_e)))
    column = camera.column_e
    dark = camera.dark_e_per_s + float(np.mean(camera.hot_e_per_s))
    plain = PlainCamera(
        *(camera.gain, camera.bits, camera.read_e, float(np.hypot(camera.row_e, column)), camera.offset_dn),
        *(camera.full_well_e, camera.efficiency, dark),
        camera.dsnu_e + camera.hot_e_per_s * how.exposures_s[half],
        camera.prnu,
    )
    true = truth(plain, how, found)
    if camera.respond is not None or camera.after is not None:
        true |= linearity(camera, how, found)
    return true


def linearity(camera, how, found):
    """Deviations from EMVA's line of a camera whose response is bent, over 5-95 % of where it is full: no noise."""
    dn = camera.gain * np.minimum(how.photons * camera.efficiency, camera.full_well_e)
    bent = camera.respond(dn / camera.gain) * camera.gain if camera.respond is not None else dn
    if camera.after is _gamma:
        dark = camera.offset_dn + camera.gain * camera.dark_e_per_s * how.exposures_s
        bent = _gamma(bent + dark) - _gamma(dark)
    full = bent[found.top]
    inside = (bent >= LINEARITY[0] * full) & (bent <= LINEARITY[1] * full)
    x, y = how.photons[inside], bent[inside]
    weights = y**-2.0
    matrix = np.array([[np.sum(weights * x * x), np.sum(weights * x)], [np.sum(weights * x), np.sum(weights)]])
    slope, intercept = np.linalg.solve(matrix, [np.sum(weights * x * y), np.sum(weights * y)])
    off = y / (slope * x + intercept) - 1
    return dict(
        zip(
            ("linearity_error", "linearity_error_min", "linearity_error_max"),
            (abs(off).mean(), off.min(), off.max()),
            strict=True,
        )
    )


def asked(kind, size, seed):
    """A camera of a kind as it was drawn and photographed, level by level: the camera, how, and the measurement."""
    rng = np.random.default_rng([1288, seed])
    camera = kind.make(size, rng)
    how = shooting(camera, kind.levels)
    return camera, how, Measurement(*frames(camera, how, rng))


def frames(camera, how, rng, turn=lambda frame: frame):
    """The levels and the two stacks, of frames that are turned."""

    def shot(photons, t, count=2):
        return [turn(camera.frame(photons, t, rng)) for _ in range(count)]

    shots = zip(how.exposures_s.tolist(), how.photons.tolist(), strict=True)
    levels = tuple(Level.of(t, shot(photons, t), shot(0.0, t), photons) for t, photons in shots)
    half = int(np.argmin(abs(how.photons * camera.efficiency - 0.5 * camera.top_e)))
    t = float(how.exposures_s[half])
    return levels, *(stack(shot(photons, t, how.frames)) for photons in (float(how.photons[half]), 0.0))


def against(found):
    """What is found against a camera; that few frames cannot confirm the dark current is nothing against it."""
    findings = found.estimates.checks.findings
    return [one.why for one in findings if "not known well enough" not in one.why]


def faults(kind, camera, how, found):
    """What is told wrongly, what bounds exclude the truth or are upside down, and what is told or withheld amiss."""
    true, said = truths(camera, how, found), []
    for name, figure in found.judged.items():
        told = isfinite(figure.value)
        if told and error(name, figure.value, true[name]) > 1:
            said.append(f"{name} {figure.value:.5g}, true {true[name]:.5g}")
        if figure.bounded and not figure.low <= figure.high:
            said.append(f"{name} has bounds {figure.low:.5g} and {figure.high:.5g}")
        if figure.bounded and not figure.low - 1e-9 <= true[name] <= figure.high + 1e-9:
            said.append(f"{name} [{figure.low:.5g}, {figure.high:.5g}], true {true[name]:.5g}")
        if told and name in kind.withheld:
            said.append(f"{name} is told, {figure.value:.5g}")
        if kind.full and not told and name not in ("full_well_e", "dynamic_range_db"):  # which take more pixels
            said.append(f"{name} is withheld: {figure.why}")
        if not told and not figure.why:
            said.append(f"{name} is withheld without a reason")
    return said
