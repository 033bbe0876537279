"""Which figures of a measurement can be trusted, and why the others are withheld.

A figure is told where the truth is no further from it than promised, even if chance is at four standard errors and
rounding, clipping and the distance of the levels hide as much as they can. Otherwise it is withheld with the reason,
and its bounds are told.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, isfinite, log10, nan

from camviz_clinic.measuring.noise.estimate import CERTAIN, PROMISE, UNKNOWN, Estimate, of
from camviz_clinic.measuring.noise.estimates import Estimates
from camviz_clinic.measuring.noise.hidden import QUANTISED

DECIBELS = 0.26  # 20 log10 of 1.03
PATTERN = 0.05
DEVIATION = 0.001  # of the signal: a deviation from a straight line is a fraction, and may be none
SPLIT = ("dsnu_row_e", "dsnu_column_e", "dsnu_pixel_e", "prnu_row", "prnu_column", "prnu_pixel")
LINEARITY_NAMES = ("linearity_error", "linearity_error_min", "linearity_error_max")
_SATURATION = ("full_well_e", "snr_max_db", "dynamic_range_db")


@dataclass(frozen=True)
class Figure:
    """A figure's value, NaN where it is withheld; between which values the truth lies, NaN where unknown; and why."""

    value: float
    low: float = nan
    high: float = nan
    why: str = ""

    @property
    def bounded(self) -> bool:
        return isfinite(self.low) and isfinite(self.high)


def judged(e: Estimates) -> dict[str, Figure]:
    """Every figure by its name."""
    return {name: _judged(e, name, one) for name, one in _all(e).items()}


def kept(name: str, one: Estimate) -> bool:
    """Whether an estimate of the figure of this name is as near to the truth as promised."""
    if one.value == 0 and name not in LINEARITY_NAMES:  # no more than that it is not above chance
        return False
    if name.endswith("_db"):
        return one.within(DECIBELS, relative=False)
    if name in LINEARITY_NAMES:
        return one.within(DEVIATION, relative=False)
    return one.within(PATTERN if name.startswith(("dsnu", "prnu")) else PROMISE)


def _all(e: Estimates) -> dict[str, Estimate]:
    return {
        "gain_dn_per_e": e.gain,
        "read_noise_e": e.read_noise,
        "quantum_efficiency": e.efficiency,
        "snr_max_db": of(lambda full: 10 * _log(full), e.full_well),
        "dynamic_range_db": of(lambda ratio: 20 * _log(ratio), e.dynamic_range),
        "full_well_e": e.full_well,
        "prnu": e.prnu,
        "dsnu_e": e.dsnu,
        "dark_current_e_per_s": e.dark_current,
        "threshold_e": e.threshold,
        "threshold_photons": e.threshold_photons,
        **_linearity(e),
        **(e.parts() or dict.fromkeys(SPLIT, UNKNOWN)),
    }


def _linearity(e: Estimates) -> dict[str, Estimate]:
    smallest, largest, mean = e.found.linearity
    chance, hidden = e.linearity_error if isfinite(mean) else (nan, nan)
    if not CERTAIN * chance + hidden < 0.5:  # no signal to speak of
        return dict.fromkeys(LINEARITY_NAMES, Estimate(mean, 0.0, -inf, inf))
    return {
        name: Estimate(value, chance, value - hidden, value + hidden)
        for name, value in zip(LINEARITY_NAMES, (mean, smallest, largest), strict=True)
    }


def _log(value: float) -> float:
    return log10(value) if value > 0 else nan


def _judged(e: Estimates, name: str, one: Estimate) -> Figure:
    spoilt = e.checks.spoiling(name) if e.checks else ""
    if e.checks and spoilt and (name != "dark_current_e_per_s" or e.checks.spoiling("gain_dn_per_e")):
        return Figure(nan, nan, nan, spoilt)
    low, high = one.bounds
    if not name.startswith("linearity") and not name.endswith("_db"):
        low = max(low, 0.0)
    if high < low:
        return Figure(nan, nan, nan, spoilt or _why(e, name, one))
    told = kept(name, one) and not spoilt
    if name in SPLIT and not told:  # parts of one picture share its chance, so that only a ceiling is sure
        low = min(low, 0.0)
    return Figure(one.value if told else nan, low, high, "" if told else spoilt or _why(e, name, one))


# Reasons --------------------------------------------------------------------------------------------------------------


def _why(e: Estimates, name: str, one: Estimate) -> str:
    widened = e.checks.widening(name) if e.checks else ""
    if widened and _narrower(name, _all(e.unchecked)[name], one):
        return widened
    if not name.startswith(("prnu", "linearity", "gain")) and not kept("gain_dn_per_e", e.gain):
        return f"K is not known, since {_why(e, 'gain_dn_per_e', e.gain)}"
    if not isfinite(one.value):
        return _missing(e, name)
    by_chance = one.high - one.low <= CERTAIN * one.error
    if one.bounds[0] <= 0 and name in _ABSENT and by_chance and not e.clipped:
        return _ABSENT[name]
    if _hides(one, name):
        return _hidden(e, name)
    if name in LINEARITY_NAMES:
        return f"these frames are too few to tell: ± {100 * (one.bounds[1] - one.value):.2g} % of the signal"
    off = max(one.bounds[1] - one.value, one.value - one.bounds[0])
    return f"these frames are too few to tell: ± {_share(off, one.value, name)}"


def _narrower(name: str, plain: Estimate, one: Estimate) -> bool:
    """Whether a figure would be told, or be known twice as well, if the model held."""
    (low, high), (least, most) = plain.bounds, one.bounds
    return kept(name, plain) or 2 * (high - low) < most - least


def _share(off: float, value: float, name: str) -> str:
    return f"{off:.2g} dB" if name.endswith("_db") else f"{100 * off / max(abs(value), 1e-30):.2g} %"


def _hides(one: Estimate, name: str) -> bool:
    """Whether no number of such frames would tell the figure."""
    return not kept(name, Estimate(one.value, 0.0, one.low, one.high))


def _hidden(e: Estimates, name: str) -> str:
    """What hides a figure besides chance."""
    apart = "the levels are too far apart, or the frames too few, to tell where between them saturation lies"
    if name in ("full_well_e", "snr_max_db"):
        return apart
    if name == "dynamic_range_db" and not _hides(e.threshold, "threshold_e"):
        return apart
    if e.dark_share > 0 and (e.clipped or not e.dark_rounded):
        return f"{e.dark_share:.2%} of the dark pixels are at an end of the scale: the black level cuts their noise off"
    if e.dark_rounded:
        square, noise = e.found.step**2, min(one.value for one in e.dark)
        return (
            f"rounding hides noise as small as that of a pixel in the dark, {noise:.2g} DN² "
            f"(the standard's limit is {QUANTISED * square:g} DN²)"
        )
    return "the frames reach an end of the scale, which cuts their noise off"


def _missing(e: Estimates, name: str) -> str:
    """Why there is no estimate at all."""
    no_gain = "the noise does not rise with the signal, so there is no gain to be read from it"
    not_full = "no level is saturated: the noise still rises at the brightest"
    if name == "gain_dn_per_e":
        return no_gain
    if name in ("quantum_efficiency", "threshold_photons") and not e.lit:
        return "the photons per pixel are not known"
    if name in _SATURATION:
        return not_full
    if name == "dark_current_e_per_s":
        return "the dark frames have fewer than three different exposures"
    if name.startswith("linearity"):
        return "fewer than three levels lie between 5 and 95 % of saturation, or the light is not known"
    if name in SPLIT and not (e.found.bright and e.found.dark):
        return "only a stack of frames of both kinds tells rows, columns and pixels apart"
    if name.startswith("prnu") and e.beyond:
        return "pixels of the bright stack are saturated"
    return "the signal does not rise with the light"


_ABSENT = {
    "prnu": "the pattern in the bright frames is not above chance",
    "dsnu_e": "the pattern in the dark frames is not above chance",
    "dark_current_e_per_s": (
        "the dark frames do not brighten with exposure by more than chance: "
        "the camera takes its dark level off, or is very cold"
    ),
    **{name: f"the {name.split('_')[1]}s have no pattern above chance" for name in SPLIT},
}
