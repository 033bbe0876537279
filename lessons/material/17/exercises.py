"""Lesson 17, sharpness and exposure: an edge and its MTF, the shutter; deeper, lens and pixel, field, corners, light.

Frequencies are in cycles per pixel where an edge was measured, and in cycles per mm where optics makes them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

# 1: from the profile to the line spread ------------------------------------------------------------------------------


def line_spread(profile: Array, step: float) -> Array:
    """The derivative (n - 1,) of an edge's profile (n,), per pixel, divided by the edge's height: its area is 1."""
    change = np.diff(profile) / step
    return change / (change.sum() * step)


def _edges(rng: np.random.Generator) -> Iterator[Arguments]:
    for n, step, falling in ((12, 0.25, False), (20, 0.125, True), (9, 0.5, False), (8, 1.0, True)):
        x = np.linspace(-3, 3, n)
        rise = 1 / (1 + np.exp(-rng.uniform(1.5, 2.5) * x)) + rng.uniform(0.15, 0.3) * x * np.exp(-(x**2))
        rise = rise + 0.1 * np.cos(3 * x)  # it overshoots, as a sharpened picture does
        yield rng.uniform(0.5, 1.5) + rng.uniform(1.5, 4.0) * (-1 if falling else 1) * rise, step


LINE_SPREAD = Exercise(
    name="17.line_spread",
    reference=line_spread,
    cases=_edges,
    shown=((np.array([0.0, 0.1, 0.5, 0.9, 1.0]), 0.125),),
    hints=(
        "A profile of n values has n − 1 steps between neighbours. Which area must the curve of these steps have?",
        "`np.diff` gives the steps. Divide by the distance between samples, and then by the whole rise of the edge, so "
        "that the area (the sum times the step) becomes 1.",
        "`return change / (___ * step)`",
    ),
    praise="Its area is 1 for every edge, bright or dark side first.",
)


@LINE_SPREAD.wrong("The slope is right. A stronger edge is not a sharper one: divide by the edge's whole rise too.")
def slope(profile, step):
    return np.diff(profile) / step


@LINE_SPREAD.right
def by_places_as_a_list(profile, step):
    x = step * np.arange(len(profile))
    slopes = np.diff(profile) / np.diff(x)
    return (slopes / sum(slopes * np.diff(x))).tolist()


@LINE_SPREAD.wrong("You divide by greatest less smallest. A sharpened edge overshoots: divide by last less first.")
def by_the_whole_range(profile, step):
    return np.diff(profile) / step / (np.max(profile) - np.min(profile))


@LINE_SPREAD.wrong("You divide by the last value. An edge need not begin at 0: its rise is the last *less the first*.")
def by_the_last_value(profile, step):
    return np.diff(profile) / step / profile[-1]


@LINE_SPREAD.wrong("Your values add up to 1, but their *area* must be 1: each stands for a strip one step wide.")
def sum_of_one(profile, step):
    return np.diff(profile) / np.diff(profile).sum()


@LINE_SPREAD.wrong("You take the size of every step. The profile of a sharpened edge also falls: keep the sign.")
def sizes_of_the_steps(profile, step):
    change = np.abs(np.diff(profile))
    return change / (change.sum() * step)


@LINE_SPREAD.wrong("A falling edge comes out negative. Divide by the rise with its sign, not by its size.")
def negative_for_falling_edges(profile, step):
    return np.diff(profile) / (np.abs(profile[-1] - profile[0]) * step)


# 2: from the line spread to the MTF ----------------------------------------------------------------------------------


def mtf(light: Array, step: float, frequency: Array) -> Array:
    """|Σ light e^(-2πi f x)| / Σ light at frequencies (...), for light (n,) at places `step` apart."""
    x = step * np.arange(len(light))
    waves = np.exp(-2j * np.pi * np.multiply.outer(frequency, x))
    return np.abs(waves @ light) / np.abs(np.sum(light))


def _spreads(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        n, step = int(rng.integers(16, 24)), float(rng.choice([0.125, 0.2, 0.25]))
        x = np.linspace(-2.2, 1.8, n)
        light = rng.uniform(2, 5) * (np.exp(-(x**2) * rng.uniform(1, 3)) + 0.3 * np.exp(-((x - 1) ** 2) * 6))
        yield light, step, rng.uniform(0.1, 0.5, shape)
    x = np.linspace(-2.2, 1.8, 20)
    sharpened = np.exp(-3 * x**2) - rng.uniform(0.25, 0.35) * (np.exp(-4 * (x - 1) ** 2) + np.exp(-4 * (x + 1) ** 2))
    yield rng.uniform(2, 5) * sharpened, 0.2, np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.9, 1.0])  # above 1 in the middle
    box = float(rng.uniform(1, 3))  # a pixel's own spread, of which nothing is left at 1 cycle per pixel
    yield np.full(8, box), 0.125, np.array([[0.0, 0.5], [1.0, 2.0]])


MTF = Exercise(
    name="17.mtf",
    reference=mtf,
    cases=_spreads,
    hints=(
        "The contrast that is left must not depend on where the edge stands. So look at the cosine *and* the sine wave "
        "of that frequency, and divide by what a wave of frequency 0 gives.",
        "`np.multiply.outer(frequency, x)` has an axis more than `frequency`, for the places x = step · 0, 1, 2 …; "
        "`waves @ light` sums over it. `np.abs` of a complex number is its size.",
        "`waves = np.exp(___ * np.multiply.outer(frequency, x))`",
    ),
    praise="It is 1 at frequency 0, and it does not matter where the edge stands.",
)


@MTF.right
def as_scipy_s_response_of_a_filter(light, step, frequency):
    from scipy.signal import freqz

    size = np.abs(freqz(light, worN=2 * np.pi * step * np.ravel(frequency))[1])
    return np.reshape(size, np.shape(frequency)) / np.add.reduce(light)


@MTF.wrong("You divide by the sum of the *sizes*. Light beside a sharpened edge is negative: use the plain sum.")
def divided_by_the_sum_of_sizes(light, step, frequency):
    return np.abs(_transform(light, step, frequency)) / np.sum(np.abs(light))


@MTF.wrong("You cut the MTF off at 1. A sharpened edge has more contrast than the scene: its MTF exceeds 1.")
def held_at_one(light, step, frequency):
    return np.minimum(mtf(light, step, frequency), 1)


def _transform(light, step, frequency, turn=2 * np.pi):
    return np.exp(-1j * turn * np.multiply.outer(frequency, step * np.arange(len(light)))) @ light


@MTF.wrong("The 2π is missing. One cycle is a full turn, so the angle of the wave is 2π · f · x.")
def without_two_pi(light, step, frequency):
    return np.abs(_transform(light, step, frequency, 1.0)) / np.sum(light)


@MTF.wrong("Your places count samples. The frequency is in cycles per *pixel*, and samples are `step` pixels apart.")
def places_in_samples(light, step, frequency):
    return np.abs(_transform(light, 1.0, frequency)) / np.sum(light)


@MTF.wrong("You kept the cosine part alone. It depends on where the edge stands: take the complex size.")
def cosine_alone(light, step, frequency):
    return np.real(_transform(light, step, frequency)) / np.sum(light)


@MTF.wrong("At frequency 0 yours is the sum of the light. The MTF is 1 there: divide by that sum.")
def not_divided(light, step, frequency):
    return np.abs(_transform(light, step, frequency))


# 5: lens and pixel ---------------------------------------------------------------------------------------------------


def system_mtf(per_mm: Array, f_number: float, wavelength_mm: float, pitch_mm: float) -> Array:
    """The MTF (...) of a perfect lens in focus times that of a square pixel; 0 from the cut-off 1/(λ N) on."""
    s = np.minimum(per_mm * wavelength_mm * f_number, 1)
    lens = 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))
    return lens * np.abs(np.sinc(per_mm * pitch_mm))


def _gratings(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        N, wavelength, pitch = rng.uniform(4, 11), rng.uniform(4.5e-4, 6.5e-4), rng.uniform(0.003, 0.006)
        yield rng.uniform(0.1, 0.6, shape) / (wavelength * N), N, wavelength, pitch
    N, wavelength, pitch = rng.uniform(8, 11), 5.5e-4, 0.012
    cut = 1 / (wavelength * N)
    yield np.array([0.0, 0.6 / pitch, 1.5 / pitch, 0.9 * cut, cut, 1.7 * cut]), N, wavelength, pitch


SYSTEM = Exercise(
    name="17.system_mtf",
    reference=system_mtf,
    cases=_gratings,
    hints=(
        "The lens passes its share of the contrast to the pixel, and the pixel passes its share of that. Beyond the "
        "cut-off 1/(λN) the lens passes nothing.",
        "With s = f λ N held at 1 by `np.minimum`, the formula itself is 0 beyond the cut-off. `np.sinc(x)` is "
        "sin(πx)/(πx) and knows what to do at 0. An MTF is never negative, so take its size.",
        "`return lens * np.abs(np.sinc(___))`",
    ),
    praise="Two causes, one after the other: their MTFs multiply.",
)


@SYSTEM.right
def by_the_angle(per_mm, f_number, wavelength_mm, pitch_mm):
    angle = np.arccos(np.clip(np.asarray(per_mm) * wavelength_mm * f_number, 0, 1))
    return np.abs((2 * angle - np.sin(2 * angle)) / np.pi * np.sinc(np.asarray(per_mm) * pitch_mm))


def _lens(per_mm, f_number, wavelength_mm):
    s = np.minimum(np.asarray(per_mm) * wavelength_mm * f_number, 1)
    return 2 / np.pi * (np.arccos(s) - s * np.sqrt(1 - s**2))


def _pixel(per_mm, pitch_mm):
    return np.abs(np.sinc(np.asarray(per_mm) * pitch_mm))


@SYSTEM.wrong("You take the weaker of the two. Each passes its share of what the other left: multiply.")
def the_weaker_one(per_mm, f_number, wavelength_mm, pitch_mm):
    return np.minimum(_lens(per_mm, f_number, wavelength_mm), _pixel(per_mm, pitch_mm))


@SYSTEM.wrong("`np.sinc(x)` is sin(πx)/(πx) already: yours has π twice.")
def sinc_with_pi(per_mm, f_number, wavelength_mm, pitch_mm):
    return _lens(per_mm, f_number, wavelength_mm) * np.abs(np.sinc(np.pi * np.asarray(per_mm) * pitch_mm))


@SYSTEM.wrong("The 1.22 belongs to the Airy disc's dark ring. The cut-off is 1/(λN), without it.")
def with_the_airy_factor(per_mm, f_number, wavelength_mm, pitch_mm):
    return _lens(per_mm, 1.22 * f_number, wavelength_mm) * _pixel(per_mm, pitch_mm)


@SYSTEM.wrong("This falls in a straight line, as behind a *square* opening. A round one has arccos s − s √(1 − s²).")
def straight_line(per_mm, f_number, wavelength_mm, pitch_mm):
    return np.maximum(1 - np.asarray(per_mm) * wavelength_mm * f_number, 0) * _pixel(per_mm, pitch_mm)


@SYSTEM.wrong("Beyond 1/p yours is negative. The MTF is the *size* of the contrast.")
def with_its_sign(per_mm, f_number, wavelength_mm, pitch_mm):
    return _lens(per_mm, f_number, wavelength_mm) * np.sinc(np.asarray(per_mm) * pitch_mm)


# 7: the corners ------------------------------------------------------------------------------------------------------


def falloff(r: Array, v: float) -> Array:
    """cos⁴ θ of the light (...) at heights r (...) on a sensor at distance v, where tan θ = r / v."""
    return np.cos(np.arctan(r / v)) ** 4


def _heights(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(6, 22, shape), float(rng.uniform(20, 60))
    v = float(rng.uniform(15, 60))
    yield v * np.array([0.0, -0.4, 1.0, -1.0, 8.0]), v  # the middle, below it, at 45°, and very far out


FALLOFF = Exercise(
    name="17.falloff",
    reference=falloff,
    cases=_heights,
    shown=((np.array([0.0, 21.6]), 35.0),),
    hints=(
        "Draw the triangle of the lens, the middle of the sensor and the point: which of its sides are v and r?",
        "The angle has the tangent r / v. `np.arctan` and `np.cos` both count in radians.",
        "`return np.cos(___) ** 4`",
    ),
    praise="A wide lens pays for its angle: at 45° a quarter of the light is left.",
)


@FALLOFF.right
def without_an_angle(r, v):
    return 1 / (1 + (r / v) ** 2) ** 2


@FALLOFF.wrong("This is cos θ alone. The opening looks narrower, is farther away, and lights the sensor aslant.")
def first_power(r, v):
    return np.cos(np.arctan(r / v))


@FALLOFF.wrong("You use r / v as the angle. It is the *tangent* of the angle.")
def tangent_as_angle(r, v):
    return np.cos(r / v) ** 4


@FALLOFF.wrong("`np.cos` counts in radians, and you give it degrees.")
def in_degrees(r, v):
    return np.cos(np.degrees(np.arctan(r / v))) ** 4


@FALLOFF.wrong("This grows towards the corner. A correction multiplies by it, 1 / cos⁴ θ.")
def the_correction(r, v):
    return 1 / np.cos(np.arctan(r / v)) ** 4


# 3: find the bug in the shutter --------------------------------------------------------------------------------------


def shutter(t: Array, N: float, S: float, new_N: float, new_S: float) -> Array:
    """t (N'/N)² S/S': the time (...) at f/N' and ISO S' that is as bright as t (...) at f/N and ISO S."""
    return t * (new_N / N) ** 2 * S / new_S


def shutter_as_given(t, N, S, new_N, new_S):
    return t * (new_N / N) * S / new_S


def _settings(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        N, ratio = rng.uniform(2.0, 5.0), rng.uniform(1.3, 2.5)
        S, gain = float(rng.choice([100.0, 200.0, 400.0])), float(rng.uniform(1.7, 5.0))
        yield rng.uniform(0.01, 2.0, shape), float(N), S, float(N * ratio), S * gain
    yield 0.5, 8.0, 800.0, 2.8, 100.0
    yield np.array([1 / 4000, 1 / 60]), 5.6, 200.0, 2.0, 1600.0  # shorter than a thousandth of a second
    yield np.array([0.0, 8.0]), 4.0, 100.0, 4.0, 100.0  # nothing is changed


SHUTTER = Exercise(
    name="17.shutter",
    reference=shutter,
    cases=_settings,
    as_given=shutter_as_given,
    hints=(
        "Keep ISO as it is and double N. How much narrower is the opening, and how much less light comes through it?",
        "Light comes through the *area* of the opening. It goes with the square of the diameter f / N.",
        "`return t * ___ * S / new_S`",
    ),
    praise="Twice the f-number takes four times as long; twice the ISO takes half.",
)


@SHUTTER.right
def by_exposure_values(t, N, S, new_N, new_S):
    stops = 2 * np.log2(new_N / N) - np.log2(new_S / S)
    return t * 2**stops


@SHUTTER.wrong("The square is there now, but the ratio is upside down: a larger f-number is a smaller opening.")
def opening_upside_down(t, N, S, new_N, new_S):
    return t * (N / new_N) ** 2 * S / new_S


@SHUTTER.wrong("The aperture is right now, but ISO is upside down: more gain needs *less* time.")
def gain_upside_down(t, N, S, new_N, new_S):
    return t * (new_N / N) ** 2 * new_S / S


@SHUTTER.wrong("You squared the ISO as well. Gain is a plain factor; only the opening is an area.")
def everything_squared(t, N, S, new_N, new_S):
    return t * (new_N / N * S / new_S) ** 2


@SHUTTER.wrong("You count one f-number as one stop. A stop is a *factor* of √2 in N: 2, 2.8, 4, 5.6.")
def f_numbers_as_stops(t, N, S, new_N, new_S):
    return t * 2.0 ** (new_N - N) * S / new_S


@SHUTTER.wrong("Now the ISO is squared in place of the aperture. Only the opening is an area.")
def gain_squared(t, N, S, new_N, new_S):
    return t * (new_N / N) * (S / new_S) ** 2


# 4: the standard's recipe --------------------------------------------------------------------------------------------


def standard_mtf(profile: Array, step: float, frequency: Array) -> Array:
    """ISO 12233:2014 on a profile (n,): differences of every second value, Hamming window, MTF (...), correction."""
    light = (profile[2:] - profile[:-2]) * np.hamming(len(profile) - 2)
    waves = np.exp(-2j * np.pi * np.multiply.outer(frequency, step * np.arange(len(light))))
    return np.abs(waves @ light) / np.abs(np.sum(light)) / np.sinc(2 * frequency * step)


def _profiles(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape, falling in zip(SHAPES, (False, True, False, True), strict=True):
        x = np.arange(-2.5, 2.5, 0.25) + rng.uniform(-0.1, 0.1)
        rise = 1 / (1 + np.exp(-rng.uniform(1.5, 2.5) * x)) + 0.1 * x * np.exp(-(x**2))
        yield rng.uniform(0.5, 1.5) + (-2 if falling else 2) * rise, 0.25, rng.uniform(0.15, 0.9, shape)
    x = np.arange(-2.0, 2.0, 0.2)
    yield np.tanh(rng.uniform(1, 2) * x) + 0.2 * np.sin(3 * x), 0.2, np.array([0.0, 0.2, 0.5, 0.8, 1.2])


STANDARD = Exercise(
    name="17.standard_mtf",
    reference=standard_mtf,
    cases=_profiles,
    hints=(
        "Four steps follow one another. Which of them shortens the profile, and by how many values?",
        "`profile[2:] - profile[:-2]` are the differences of every second value. `np.hamming(m)` has m values, 1 in "
        "the middle. Then do what you did in exercise 2, and divide by sinc(2 f · step).",
        "`light = (profile[2:] - profile[:-2]) * np.hamming(___)`",
    ),
    praise="That is the recipe of 2014, from the profile on.",
)


@STANDARD.right
def by_convolution_and_from_the_middle(profile, step, frequency):
    light = np.convolve(profile, [0.5, 0, -0.5], "valid") / step * np.hamming(len(profile) - 2)
    x = step * (np.arange(len(light)) - (len(light) - 1) / 2)
    sums = np.tensordot(np.exp(2j * np.pi * np.multiply.outer(np.asarray(frequency), x)), light, 1)
    return (np.abs(sums / light.sum()) / np.sinc(2 * np.asarray(frequency) * step)).tolist()


def _standard(profile, step, frequency, *, window=np.hamming, width=2.0):
    light = (profile[2:] - profile[:-2]) * window(len(profile) - 2)
    left = np.sinc(width * np.asarray(frequency) * step)
    return np.abs(_transform(light, step, frequency)) / np.abs(np.sum(light)) / left


@STANDARD.wrong("The window is missing: multiply the differences by `np.hamming` before you add the waves up.")
def without_the_window(profile, step, frequency):
    return _standard(profile, step, frequency, window=np.ones)


@STANDARD.wrong("Your window is Hann's, which falls to 0 at its ends. The standard of 2014 has Hamming's.")
def with_hann_s_window(profile, step, frequency):
    return _standard(profile, step, frequency, window=np.hanning)


@STANDARD.wrong("The correction is missing: these differences dim a grating. Divide by sinc(2 f · step).")
def without_the_correction(profile, step, frequency):
    return _standard(profile, step, frequency, width=0.0)


@STANDARD.wrong("You correct for a difference of neighbours. Every second value is 2 steps away: sinc(2 f · step).")
def corrected_for_neighbours(profile, step, frequency):
    return _standard(profile, step, frequency, width=1.0)


@STANDARD.wrong("You subtract neighbours. The recipe takes every second value: profile[2:] − profile[:-2].")
def differences_of_neighbours(profile, step, frequency):
    light = np.diff(profile) * np.hamming(len(profile) - 1)
    return np.abs(_transform(light, step, frequency)) / np.abs(light.sum()) / np.sinc(2 * np.asarray(frequency) * step)


# 6: towards the edge of the picture ----------------------------------------------------------------------------------


def field_blur(h: Array, focal_mm: float, f_number: float, n: float) -> tuple[Array, Array]:
    """The light's widths (...) in mm across sagittal and tangential lines: h²/(2fN) times 1 + 1/n and 3 + 1/n."""
    flat = h**2 / (2 * focal_mm * f_number)
    return flat * (1 + 1 / n), flat * (3 + 1 / n)


def _fields(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield rng.uniform(3, 15, shape), rng.uniform(35, 90), rng.uniform(4, 16), rng.uniform(1.45, 1.85)
    yield np.array([0.0, -6.0, 6.0]), 50.0, 8.0, 1.5  # the middle, and either side of it


FIELD = Exercise(
    name="17.field_blur",
    reference=field_blur,
    cases=_fields,
    hints=(
        "Two lengths along the axis first, from the two formulas. How wide is a cone of light that ends that far away?",
        "Out of focus by x, the disc of the rays is x / N wide. So both widths are h² / (2 f N), each times a bracket.",
        "`return flat * (1 + 1 / n), flat * ___`",
    ),
    praise="Tangential lines lose more, and both blurs grow with the square of the height.",
)


@FIELD.right
def as_a_list(h, focal_mm, f_number, n):
    return [share * np.asarray(h) ** 2 / 2 / (focal_mm * f_number) for share in (1 + 1 / n, 3 + 1 / n)]


def _blurs(h, focal_mm, f_number, n, s=1.0, t=3.0):
    flat = np.asarray(h) ** 2 / (2 * focal_mm * f_number)
    return flat * (s + 1 / n), flat * (t + 1 / n)


@FIELD.wrong("The two have changed places. The sagittal one comes first, and it is the smaller.")
def changed_places(h, focal_mm, f_number, n):
    return _blurs(h, focal_mm, f_number, n, 3.0, 1.0)


@FIELD.wrong("These are the distances along the axis. The light is x / N wide there: divide by the f-number.")
def distances_along_the_axis(h, focal_mm, f_number, n):
    return _blurs(h, focal_mm, 1.0, n)


@FIELD.wrong("The 1/n is missing: the brackets are 1 + 1/n and 3 + 1/n.")
def without_the_curved_field(h, focal_mm, f_number, n):
    flat = np.asarray(h) ** 2 / (2 * focal_mm * f_number)
    return flat, 3 * flat


@FIELD.wrong("Your second width has the 3 before the whole bracket: the bracket is 3 + 1/n.")
def three_before_the_bracket(h, focal_mm, f_number, n):
    sagittal, _ = _blurs(h, focal_mm, f_number, n)
    return sagittal, 3 * sagittal


# 8: veiling glare ----------------------------------------------------------------------------------------------------


def unveil(recorded: Array, glare: float) -> Array:
    """The light (height, width, 3) without the share of it that was spread evenly over the picture."""
    mean = np.mean(recorded, axis=(0, 1))
    return (recorded - glare * mean) / (1 - glare)


def _veiled(rng: np.random.Generator) -> Iterator[Arguments]:
    for height, width in ((4, 6), (3, 3), (1, 5)):
        yield rng.uniform(0.1, 1, (height, width, 3)) * rng.uniform(0.3, 1, 3), float(rng.uniform(0.05, 0.3))
    yield rng.uniform(0, 1, (2, 5, 3)), 0.0  # a perfect lens
    yield rng.uniform(0, 0.3, (3, 4, 3)) ** 2, 0.25  # noise has made some pixels darker than the veil


VEIL = Exercise(
    name="17.unveil",
    reference=unveil,
    cases=_veiled,
    hints=(
        "Solve the equation for the light. Which mean stands in it, and is it known from what was recorded?",
        "Spreading light over the picture changes no colour's mean: that of `recorded` is that of the light. "
        "`axis=(0, 1)` keeps the three colours apart.",
        "`return (recorded - ___) / (1 - glare)`",
    ),
    praise="The veil is gone. The noise that it brought stays.",
)


@VEIL.right
def by_what_deviates_from_the_mean(recorded, glare):
    mean = recorded.mean(axis=0, keepdims=True).mean(axis=1, keepdims=True)
    return (mean + (recorded - mean) / (1 - glare)).tolist()


@VEIL.wrong("You take one mean of all three colours. Each colour has its own: `mean(axis=(0, 1))`.")
def one_mean_of_all(recorded, glare):
    return (recorded - glare * np.mean(recorded)) / (1 - glare)


@VEIL.wrong("The veil is gone, but the picture is too dark. It kept only the share 1 − glare: divide by that.")
def too_dark(recorded, glare):
    return recorded - glare * np.mean(recorded, axis=(0, 1))


@VEIL.wrong("You subtract `glare` itself. The veil is that share of the *mean*: glare · mean.")
def glare_itself(recorded, glare):
    return (recorded - glare) / (1 - glare)


@VEIL.wrong("You cut off at 0. Noise makes some pixels negative: without them the dark ones come out too bright.")
def cut_off_at_zero(recorded, glare):
    return np.maximum(unveil(recorded, glare), 0)


@VEIL.wrong("You put the veil on once more. Solve the equation for the light.")
def veiled_again(recorded, glare):
    return (1 - glare) * recorded + glare * np.mean(recorded, axis=(0, 1))


@VEIL.wrong("You multiply by 1 − glare. The light was multiplied by it: divide.")
def multiplied_by_what_is_left(recorded, glare):
    return (recorded - glare * np.mean(recorded, axis=(0, 1))) * (1 - glare)


# 9: what an ISO number promises --------------------------------------------------------------------------------------


def output_speed(lux_s: Array, numbers: Array) -> float:
    """ISO 12232's standard output sensitivity: 10 over the exposure, in lux s, whose number in the file is 118."""
    return 10 / np.interp(118, numbers, lux_s)


def _responses(rng: np.random.Generator) -> Iterator[Arguments]:
    for count in (6, 9, 12, 7):
        lux_s = np.cumsum(rng.uniform(0.5, 1.5, count)) * 10.0 ** rng.uniform(-4, -1)
        share = np.linspace(0.03, 1, count) ** rng.uniform(0.4, 0.9)
        yield lux_s, 255 * share + rng.uniform(-0.2, 0.2, count)
    yield np.array([0.01, 0.02, 0.05, 0.08, 0.1]), np.array([40.0, 118.0, 200.0, 255.0, 255.0])


SPEED = Exercise(
    name="17.output_speed",
    reference=output_speed,
    cases=_responses,
    hints=(
        "At which exposure would the file have the number 118? It lies between two of those that were tried.",
        "`np.interp(x, xs, ys)` reads ys off at x. Here the numbers play the part of xs, and the exposures that of ys.",
        "`return 10 / np.interp(118, ___, lux_s)`",
    ),
    praise="That is the number on many a camera's ISO dial, as far as its maker measured it in this way.",
)


@SPEED.right
def by_scipy(lux_s, numbers):
    from scipy.interpolate import interp1d

    return float(10 / interp1d(numbers[: int(np.argmax(numbers)) + 1], lux_s[: int(np.argmax(numbers)) + 1])(118))


@SPEED.wrong("This is the exposure itself. The speed is 10 *over* it: a fast camera needs little light.")
def the_exposure(lux_s, numbers):
    return np.interp(118, numbers, lux_s)


@SPEED.wrong("This is the saturation-based speed, 78 over the exposure at the largest number. Here 118 decides.")
def saturation_based(lux_s, numbers):
    return 78 / lux_s[int(np.argmax(numbers))]


@SPEED.wrong("You take the nearest exposure that was tried. Read between the two neighbours: `np.interp`.")
def the_nearest(lux_s, numbers):
    return 10 / lux_s[int(np.argmin(np.abs(numbers - 118)))]


@SPEED.wrong("You look for 18 % of 255, which is 46. The file is encoded: 18 % of white is 118 in sRGB.")
def eighteen_percent_of_the_numbers(lux_s, numbers):
    return 10 / np.interp(0.18 * 255, numbers, lux_s)


@SPEED.wrong("You interpolate 10 over the exposures. Find the exposure first, and divide then.")
def interpolated_speeds(lux_s, numbers):
    return np.interp(118, numbers, 10 / lux_s)


@SPEED.wrong("The two lists have changed places: the number 118 is known, and the exposure is wanted.")
def lists_changed_places(lux_s, numbers):
    return 10 / np.interp(118, lux_s, numbers)


EXERCISES = (LINE_SPREAD, MTF, SHUTTER, STANDARD, SYSTEM, FIELD, FALLOFF, VEIL, SPEED)
