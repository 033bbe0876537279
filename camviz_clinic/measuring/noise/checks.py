"""Whether the model of EMVA Standard 1288 holds for a measurement, and which figures are spoiled where it does not.

The linear model knows pixels whose noise is their own, photons' noise that rises with the signal along a straight line,
a signal that rises with the light along one, an offset that stays, and even light. Frames show where that is not so. A
`ModelViolation` names the figures that it spoils, and why; what moves K or R by less than `PROMISE` spoils none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import hypot, isfinite, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, chdtri

from camviz_clinic.measuring.noise.estimate import CERTAIN, PROMISE, Estimate, combined, of
from camviz_clinic.measuring.noise.hidden import QUANTISED
from camviz_clinic.measuring.noise.neighbours import BY_CHANCE, LAGS, Shading
from camviz_clinic.measuring.noise.readings import SURELY
from camviz_clinic.measuring.noise.scale import CLIPPED
from camviz_clinic.measuring.noise.statistics import Pair
from camviz_clinic.measuring.noise.transfer import Transfer, ratio

Array = NDArray[np.float64]

SMOOTHED = 0.5  # of the noise in the dark: electric pick-up is shared by neighbours too, and is noise of each pixel
FEW = 5  # levels: with fewer no bend is looked for
CONFIRMED = 0.25  # of the dark current: how well its noise must tell it, lest it be an offset that drifts

NOISE_IN_THE_DARK = frozenset({"read_noise_e", "threshold_e", "threshold_photons", "dynamic_range_db"})
SATURATION = frozenset({"full_well_e", "snr_max_db", "dynamic_range_db"})
PRNU = frozenset({"prnu", "prnu_row", "prnu_column", "prnu_pixel"})
DSNU = frozenset({"dsnu_e", "dsnu_row_e", "dsnu_column_e", "dsnu_pixel_e"})
BY_PHOTONS = frozenset({"quantum_efficiency", "threshold_photons"})
BY_GAIN = NOISE_IN_THE_DARK | SATURATION | DSNU | {"gain_dn_per_e", "quantum_efficiency", "dark_current_e_per_s"}
LINEARITY = frozenset({"linearity_error", "linearity_error_min", "linearity_error_max"})


@dataclass(frozen=True)
class ModelViolation:
    """What is not as the model has it: the figures that it touches, why, and whether it spoils them or widens them."""

    names: frozenset[str]
    why: str
    spoils: bool = True


@dataclass(frozen=True)
class Bend:
    """How a curve leaves the straight line: its slope at no signal, relative to the line's, and in standard errors."""

    slope: float = 1.0
    surely: float = 0.0
    curve: float = 0.0  # the share of the slope that is lost per unit of x
    error: float = 0.0  # of `curve`

    @property
    def found(self) -> bool:
        return self.surely > SURELY


class Checks:
    """What the frames of a photon transfer say against the model."""

    def __init__(self, transfer: Transfer) -> None:
        self.transfer, self.found = transfer, transfer.found

    @cached_property
    def findings(self) -> list[ModelViolation]:
        """All of them, those first that spoil most."""
        made = (self._shared, self._early, self._noise_bent, self._uneven, self._response_bent, self._dark_shared)
        found = [one() for one in made]
        found += [self._flickers(), self._drifts()]
        return [one for one in found if one]

    def spoiling(self, name: str) -> str:
        """Why a figure of this name is spoiled; "" where it is not."""
        return next((one.why for one in self.findings if one.spoils and name in one.names), "")

    def widening(self, name: str) -> str:
        """What widens the bounds of a figure of this name; "" where nothing does."""
        return next((one.why for one in self.findings if not one.spoils and name in one.names), "")

    # Noise that neighbours share --------------------------------------------------------------------------------------

    @cached_property
    def shared_share(self) -> float:
        """How much of a pixel's noise that light brings its neighbours share, Σ |correlation|; 0 where chance may.

        Correlated with all of its neighbours together, noise is as small as its true variance over 1 + Σ correlation.
        """
        t, x = self.transfer, self.found.signal[self.transfer.used]
        weights = x / np.sum(x * x)
        slope = float(weights @ np.array([t.bright[i].value - t.dark[i].value for i in t.used]))
        pairs = [(self.found.levels[i].bright, self.found.levels[i].dark) for i in t.used]
        return _correlated(list(zip(weights.tolist(), pairs, strict=True)), slope)

    @cached_property
    def shared_in_the_dark(self) -> float:
        """As `shared_share`, of the noise in the dark."""
        pairs = list({id(one.dark): one.dark for one in self.found.levels}.values())
        each = [(1 / len(pairs), (one, None)) for one in pairs]
        return _correlated(each, float(np.mean([one.within for one in pairs])))

    def _shared(self) -> ModelViolation | None:
        if self.shared_share <= PROMISE:
            return None
        why = (
            f"neighbouring pixels share their noise (correlations of {self.shared_share:.2g} in all), "
            "as after smoothing, binning or scaling"
        )
        return ModelViolation(BY_GAIN | PRNU, why)

    def _dark_shared(self) -> ModelViolation | None:
        if self.shared_in_the_dark < SMOOTHED:
            return None
        why = (
            f"neighbouring pixels share their noise in the dark (correlations of {self.shared_in_the_dark:.2g} in all)"
        )
        return ModelViolation(NOISE_IN_THE_DARK, why)

    # A straight line of photon transfer -------------------------------------------------------------------------------

    @cached_property
    def noise_bend(self) -> Bend:
        """How σ²_y − σ²_y.dark leaves its straight line over the signal: by a bend, by a step or by an offset."""
        t, levels, square = self.transfer, self.found.levels, self.transfer.scale.step**2
        clear = [
            i
            for i in t.used
            if t.bright[i].value > 1.5 * QUANTISED * square
            and sum(t.scale.clipped(levels[i].bright.ends)) < CLIPPED
            and levels[i].bright.pixels > 1
        ]
        if len(clear) < FEW:
            return Bend()
        hidden = any(t.dark[i].high - t.dark[i].low > t.dark[i].error for i in clear)
        hidden |= len({id(levels[i].dark) for i in clear}) < len(clear)  # then the levels share its chance
        x = np.array([t.bright_means[i].value if hidden else float(self.found.signal[i]) for i in clear])
        seen = [
            self._without_flicker(levels[i].bright) - (0 if hidden else self._without_flicker(levels[i].dark))
            for i in clear
        ]
        errors = [t.bright[i].error if hidden else hypot(t.bright[i].error, t.dark[i].error) for i in clear]
        one = np.ones(len(clear))
        start = x - x.min() if hidden else x
        steps = [np.where(start >= edge, 1.0, 0.0) for edge in np.unique(start)[2:-1]]
        others = [start**2, *([] if hidden else [one]), *steps]
        return _bend([start, *([one] if hidden else [])], others, np.array(seen), np.array(errors))

    def _without_flicker(self, seen: Pair) -> float:
        return seen.within if self.found.noisy_lines else seen.variance

    def _noise_bent(self) -> ModelViolation | None:
        off = self.noise_bend.slope - 1
        if not self.noise_bend.found or abs(off) <= PROMISE:
            return None
        why = (
            f"the noise does not rise with the signal along a straight line, as photons make it (K would be {off:+.0%} "
            "off): the response is bent, or the gain changes with the signal"
        )
        names = BY_GAIN if self._lights_tell else BY_GAIN | PRNU
        return ModelViolation(names, why)

    def _early(self) -> ModelViolation | None:
        if not self.found.peaks_early:
            return None
        share = float(self.found.signal[self.found.peak] / self.found.signal.max())
        if self.transfer.bright[self.found.peak].value < 1.5 * float(np.max(self.found.dark_variance)):
            return ModelViolation(
                SATURATION, "the noise hardly rises with the signal, so that its peak does not tell saturation"
            )
        why = f"the noise is largest at {share:.0%} of the largest signal and falls from there: the response is bent"
        return ModelViolation(BY_GAIN if self._lights_tell else BY_GAIN | PRNU, why)

    # A straight response ----------------------------------------------------------------------------------------------

    @property
    def _lights_tell(self) -> bool:
        """True where the light differs between levels as far as that is known."""
        t = self.transfer
        light = t.light[t.used]
        return bool(np.isfinite(light).all()) and len(np.unique(light)) >= FEW

    @cached_property
    def response_bend(self) -> Bend:
        """How the signal leaves a straight line over the light, which need not pass through the origin."""
        t = self.transfer
        if not self._lights_tell:
            return Bend()
        x, y = t.light[t.used], self.found.signal[t.used]
        errors = np.array([t.signal(i).error + (t.signal(i).high - t.signal(i).low) / 2 for i in t.used])
        errors = np.hypot(errors, hypot(1, 1) * self.wander)
        errors = np.hypot(errors, self.flicker * y / sqrt(2))
        return _bend([x, np.ones(len(x))], [x**2], y, errors, scattered=True)

    @cached_property
    def response_off(self) -> tuple[float, float, float]:
        """By what K, R and PRNU differ from those of a small signal where the response bends as `response_bend`.

        Of y(x) = x − c x²: photons' variance y'² x over y is fitted through the origin as K is, y over x as R is, and
        PRNU is x y' / y where the signal is largest.
        """
        t, c = self.transfer, self.response_bend.curve
        x = t.light[t.used]
        y, slope = x - c * x * x, 1 - 2 * c * x
        gain = float(np.sum(y * slope**2 * x) / np.sum(y * y)) - 1
        response = float(np.sum(x * y) / np.sum(x * x)) - 1
        return gain, response, float(np.min(slope * x / np.where(y > 0, y, np.nan))) - 1 if (y > 0).all() else -1.0

    def _response_bent(self) -> ModelViolation | None:
        if not self.response_bend.found or max(abs(one) for one in self.response_off) <= PROMISE:
            return None
        names = BY_PHOTONS | (frozenset() if self._noise_straight else BY_GAIN | PRNU)
        light = self.transfer.light[self.transfer.used]
        change = 2 * self.response_bend.curve * float(np.ptp(light))
        why = f"the signal does not rise with the light along a straight line: its slope falls by {change:.0%}"
        return ModelViolation(names, why)

    @property
    def _noise_straight(self) -> bool:
        """Whether the noise is surely straighter than the response would make it: then it is the light that bends."""
        noise, t = self.noise_bend, self.transfer
        if not (noise.error > 0 and not noise.found):
            return False
        expected = (
            3 * self.response_bend.curve / t.fitted_responsivity.value if t.fitted_responsivity.value > 0 else 0.0
        )
        return abs(expected - noise.curve) > SURELY * noise.error

    # Light and offset that hold still ---------------------------------------------------------------------------------

    @cached_property
    def wander(self) -> float:
        """By how much the offset of a frame is off at random, DN, one standard deviation; 0 where chance may be it."""
        pairs = list({id(one.dark): one.dark for one in self.found.levels}.values())
        return _restless([(one, 1.0, 0.0) for one in pairs])

    @cached_property
    def flicker(self) -> float:
        """By how much the light of a frame is off at random, a fraction; 0 where chance may be it."""
        chosen = [i for i in range(len(self.found.levels)) if i < self.found.top and self.found.signal[i] > 0]
        return _restless([(self.found.levels[i].bright, float(self.found.signal[i]), self.wander) for i in chosen])

    def _flickers(self) -> ModelViolation | None:
        if not (self.flicker or self.wander):
            return None
        if self.flicker:
            why = f"the light flickers by {self.flicker:.2%} from frame to frame"
        else:
            why = f"the offset changes by {self.wander:.2g} DN from frame to frame"
        return ModelViolation(BY_PHOTONS | LINEARITY | {"dark_current_e_per_s"}, why, spoils=False)

    @cached_property
    def dark_current_of_noise(self) -> Estimate | None:
        """μ_I, electrons per second, of the slope of σ²_y.dark over exposure (section 7.3); None for one exposure."""
        t, times = self.transfer, self.found.exposures_s
        if not self.found.several_exposures:
            return None
        weights = (times - times.mean()) / np.sum((times - times.mean()) ** 2)
        slope = combined(weights.tolist(), t.dark)
        return of(lambda a, k: a / k**2 if k > 0 else float("nan"), slope, t.fitted_gain)

    @cached_property
    def dark_current_of_means(self) -> Estimate:
        """μ_I of the dark frames' means (section 7.2), with what the offset wanders."""
        t, times = self.transfer, self.found.exposures_s
        weights = (times - times.mean()) / np.sum((times - times.mean()) ** 2)
        slope = combined(weights.tolist(), t.dark_means)
        moved = self.wander / sqrt(2) * sqrt(float(weights @ weights))
        return of(ratio, Estimate(slope.value, hypot(slope.error, moved), slope.low, slope.high), t.fitted_gain)

    def _drifts(self) -> ModelViolation | None:
        noise = self.dark_current_of_noise
        if not noise or not isfinite(noise.value):
            return None
        means, names = self.dark_current_of_means, frozenset({"dark_current_e_per_s"})
        apart = CERTAIN * hypot(means.error, noise.error)
        if means.high < noise.low - apart or means.low > noise.high + apart:
            why = (
                f"the dark frames brighten as {means.value:.3g} e⁻/s would make them, but their noise grows as of "
                f"{noise.value:.3g} e⁻/s: the offset drifts, or the camera takes its dark level off"
            )
            return ModelViolation(names, why)
        if noise.bounds[1] - noise.bounds[0] > 2 * CONFIRMED * abs(means.value):
            why = (
                "the noise of the dark frames is not known well enough to tell dark current from an offset that drifts"
            )
            return ModelViolation(names, why)
        return None

    # Even light -------------------------------------------------------------------------------------------------------

    @cached_property
    def shading(self) -> tuple[Shading, float]:
        """The smooth part of the bright frames less the dark ones, DN, and their signal, DN: of the stacks, or of the
        brightest level that is fitted."""
        found = self.found
        if found.bright and found.dark:
            dark = Shading.of(found.dark.picture)
            return Shading.of(found.bright.picture).less(dark), found.bright.mean - found.dark.mean
        brightest = found.levels[max(self.transfer.used)]
        return brightest.bright.shading.less(brightest.dark.shading), brightest.bright.mean - brightest.dark.mean

    @cached_property
    def shaded(self) -> tuple[float, float, float]:
        """What smooth light adds to PRNU² of rows, of columns and of pixels, squares of fractions of the signal."""
        shading, signal = self.shading
        if signal <= 0:
            return 0.0, 0.0, 0.0
        a, b, c = (one / signal**2 for one in shading.variances())
        return a, b, c

    @cached_property
    def shaded_ends(self) -> tuple[float, float]:
        """By which fractions the smooth light is darker and brighter than its mean, at most."""
        shading, signal = self.shading
        low, high = shading.extremes()
        return (low / signal, high / signal) if signal > 0 else (0.0, 0.0)

    def _uneven(self) -> ModelViolation | None:
        if sum(self.shaded) == 0:
            return None
        low, high = self.shaded_ends
        why = f"light or response changes smoothly across the picture, by {high - low:.1%}: even light was asked for"
        return ModelViolation(PRNU | SATURATION, why, spoils=False)


def _correlated(each: Sequence[tuple[float, tuple[Pair, Pair | None]]], variance: float) -> float:
    """Σ |correlation| over the lags, either way, that are beyond chance, of weighted pairs less dark ones."""
    if not variance > 0 or not all(one.shared for _, (one, _) in each):
        return 0.0
    whole = 0.0
    for lag in range(len(LAGS)):
        value, error = 0.0, 0.0
        for weight, (bright, dark) in each:
            value += weight * (bright.shared[lag].covariance - (dark.shared[lag].covariance if dark else 0.0))
            error = hypot(error, weight * bright.shared[lag].error, weight * dark.shared[lag].error if dark else 0.0)
        whole += 2 * abs(value) / variance if abs(value) > SURELY * error else 0.0
    return whole


def _restless(each: list[tuple[Pair, float, float]]) -> float:
    """By how much the mean of a frame is off, over `scale`, beyond what the pixels' noise and `other` make of it.

    `each` holds pairs, their scale and what else moves a frame's mean (DN). Few pairs tell it badly: the value is what
    it is at most with a chance of 99 %.
    """
    chance = [4 * one.mean_error**2 + 2 * other**2 for one, _, other in each]
    kept = [(one.drift, noise, scale) for (one, scale, _), noise in zip(each, chance, strict=True) if noise > 0]
    if not kept:
        return 0.0
    squares = sum(drift**2 / noise for drift, noise, _ in kept)
    if chdtrc(len(kept), squares) > BY_CHANCE:
        return 0.0
    beyond = sum(drift**2 - noise for drift, noise, _ in kept) / sum(2 * scale**2 for _, _, scale in kept)
    return sqrt(max(beyond, 0.0) * len(kept) / float(chdtri(len(kept), 0.99)))


def _bend(line: list[Array], others: list[Array], y: Array, errors: Array, *, scattered: bool = False) -> Bend:
    """The most certain way in which y leaves a fit by `line`, of which the first is x: by one of `others`.

    The first of these is x². Weighted least squares; where the points scatter by more than their errors, as far as the
    best fit leaves it, that widens the errors if `scattered` says so.
    """
    sure = 1 / np.maximum(errors, 1e-12)
    plain = _fitted(line, y, sure)[0][0]
    best, curve, error = Bend(), 0.0, 0.0
    for number, other in enumerate(others):
        columns = [*line, other]
        values, deviations, left = _fitted(columns, y, sure)
        if not np.isfinite(deviations[-1]) or deviations[-1] == 0:
            continue
        wide = sqrt(max(left / max(len(y) - len(columns), 1), 1.0)) if scattered else 1.0
        surely = abs(values[-1]) / (deviations[-1] * wide)
        if number == 0 and values[0] > 0:
            curve, error = -values[-1] / values[0], deviations[-1] * wide / values[0]
        if surely > best.surely:
            best = Bend(values[0] / plain if plain > 0 else np.inf, surely)
    return Bend(best.slope, best.surely, curve, error)


def _fitted(columns: list[Array], y: Array, sure: Array) -> tuple[Array, Array, float]:
    """Weighted least squares: the coefficients, their standard deviations and the sum of squares left."""
    scale = np.array([float(np.abs(one).max()) or 1.0 for one in columns])
    matrix = np.stack(columns, axis=1) / scale * sure[:, None]
    inverse = np.linalg.pinv(matrix.T @ matrix)
    values = inverse @ (matrix.T @ (y * sure))
    left = float(np.sum((y * sure - matrix @ values) ** 2))
    return values / scale, np.sqrt(np.maximum(np.diag(inverse), 0)) / scale, left
