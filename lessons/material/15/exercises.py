"""Lesson 15, sensor noise: how kinds of noise add, gain from two frames, flat fields, HDR, stripes, units mixed up.

Noise figures are standard deviations in electrons, frames are in digital numbers (DN), after EMVA Standard 1288.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz_school.course.checks import SHAPES, Arguments, Array, Exercise

# 1: how noise adds ----------------------------------------------------------------------------------------------------


def total_noise(electrons: Array, read_noise: float, prnu: float) -> Array:
    """Electrons of noise on one frame of pixels with so many electrons (...): sqrt(σ² + μ + (PRNU μ)²)."""
    return np.sqrt(read_noise**2 + electrons + (prnu * electrons) ** 2)


def _noise_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(50, 9_000, shape), float(rng.uniform(2, 30)), float(rng.uniform(0.005, 0.03)))
    yield (np.zeros(3), float(rng.uniform(2, 30)), 0.01)
    yield (np.array([0.0, 100.0, 1e4]), 0.0, float(rng.uniform(0.005, 0.03)))  # a perfect amplifier
    yield (np.array([0.0, 100.0, 1e4]), float(rng.uniform(2, 30)), 0.0)  # pixels that are all alike


NOISE = Exercise(
    name="15.total_noise",
    reference=total_noise,
    cases=_noise_cases,
    shown=((1_000.0, 8.0, 0.01),),
    hints=(
        "Kinds of noise that know nothing of each other add as *squares*. Which squares are there?",
        "The read noise is a deviation, and so is the pattern, a share `prnu` of the signal. For photons you know the "
        "variance itself: Poisson's law says that it is the mean.",
        "`return np.sqrt(___ + electrons + ___)`",
    ),
    praise="Slopes 0, ½ and 1 on the photon-transfer curve are the three terms under this root.",
)


@NOISE.right
def by_right_angles(electrons, read_noise, prnu):
    return np.hypot(np.hypot(read_noise, np.sqrt(electrons)), prnu * electrons)


@NOISE.wrong("You add the deviations. Independent noise adds as variances: add the squares, then take one root.")
def deviations_added(electrons, read_noise, prnu):
    return read_noise + np.sqrt(electrons) + prnu * electrons


@NOISE.wrong("The *variance* of a Poisson count is its mean, μ. You put in μ².")
def photons_squared(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons**2 + (prnu * electrons) ** 2)


@NOISE.wrong("The photons' *deviation* is √μ. Put its square under the root, which is μ itself.")
def root_of_photons_under_the_root(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + np.sqrt(electrons) + (prnu * electrons) ** 2)


@NOISE.wrong("This is the variance. The noise is its square root.")
def variance(electrons, read_noise, prnu):
    return read_noise**2 + electrons + (prnu * electrons) ** 2


@NOISE.wrong("`prnu * electrons**2` squares the electrons alone. The pattern's deviation is the product: square both.")
def only_the_electrons_squared(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons + prnu * electrons**2)


@NOISE.wrong("The photons are missing. A perfect camera has their noise too: their variance is their mean.")
def without_the_photons(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + (prnu * electrons) ** 2)


# 2: K from four frames ------------------------------------------------------------------------------------------------


def gain(bright: Array, dark: Array) -> float:
    """K in DN per electron from two bright and two dark frames, (2, height, width) each."""
    variance = (np.var(bright[0] - bright[1]) - np.var(dark[0] - dark[1])) / 2
    return float(variance / (np.mean(bright) - np.mean(dark)))


def _gain_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """In much light and in little, where a half of a DN² shows."""
    much, little = (((60, 80), 0.4, 0.8, 2_000), ((80, 60), 1.4, 2.2, 2_000)), ((80, 60), 0.4, 0.6, 200)
    for shape, low, high, most in (*much, little, little, little):
        K, light = rng.uniform(low, high), rng.uniform(most / 2, most)
        response = 1.1 - np.minimum(
            rng.exponential(0.1, shape), 1
        )  # a few pixels answer much less: the median is no mean
        offset = 150 + K * rng.exponential(30, shape)
        noise = 12 * rng.standard_normal((2, 2, *shape))
        bright = K * (rng.poisson(light * response, (2, *shape)) + noise[0]) + offset
        yield (_steady(bright), _steady(K * noise[1] + offset))


def _steady(frames: Array) -> Array:
    """Two frames of a light that did not flicker, in whole DN: their means are the same."""
    means = frames.mean(axis=(1, 2), keepdims=True)
    return np.asarray(np.rint(frames - means + means[0]))


GAIN = Exercise(
    name="15.gain",
    reference=gain,
    cases=_gain_cases,
    hints=(
        "What do two frames of the same light share, and what not? Do the same with the dark frames.",
        "A difference of two frames has the variance of two and no pattern. From the variance in the light take that "
        "in the dark, from the mean in the light that in the dark. K is the one over the other.",
        "`variance = (np.var(___) - np.var(___)) / ___`",
    ),
    praise="Four frames and no light meter: Poisson's law is the ruler.",
    tolerance=5e-4,  # so that variances over n and over n − 1 pixels are both right
)


@GAIN.right
def as_opencv_counts(bright, dark):
    import cv2

    def temporal(pair):
        return cv2.meanStdDev(pair[0] - pair[1])[1][0, 0] ** 2 / 2

    return (temporal(bright) - temporal(dark)) / (cv2.mean(bright.ravel())[0] - cv2.mean(dark.ravel())[0])


@GAIN.right
def by_each_pixel_s_own_variance(bright, dark):
    noise = np.var(bright, axis=0, ddof=1).mean() - np.var(dark, axis=0, ddof=1).mean()
    return noise / (bright.mean() - dark.mean())


@GAIN.wrong("You took the variance over one frame, which counts the pattern as noise. Subtract two frames first.")
def of_one_frame(bright, dark):
    return (np.var(bright[0]) - np.var(dark[0])) / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("A bright frame less a dark one keeps the PRNU. Subtract frames of the *same* light from each other.")
def bright_less_dark(bright, dark):
    return np.var(bright[0] - dark[0]) / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("Subtract the dark frames' variance too: it does not come from light.")
def dark_noise_left_in(bright, dark):
    return np.var(bright[0] - bright[1]) / 2 / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("The signal begins above the dark: divide by mean bright *less mean dark*.")
def black_level_left_in(bright, dark):
    return (np.var(bright[0] - bright[1]) - np.var(dark[0] - dark[1])) / 2 / np.mean(bright)


@GAIN.wrong("This is electrons per DN. K is DN per electron, its inverse.")
def electrons_per_dn(bright, dark):
    return 1 / gain(bright, dark)


# 3: flat field --------------------------------------------------------------------------------------------------------


def flat_field(frame: Array, dark: Array, flat: Array) -> Array:
    """A frame (height, width) less the dark one, divided by the answer to an even light; NaN where there is none."""
    answer = np.where(flat > dark, flat - dark, np.nan)
    return (frame - dark) * (np.nanmean(answer) / answer)


def _flat_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((4, 6), (7, 5), (6, 6)):
        dark, response = rng.uniform(55, 65, shape), rng.uniform(0.6, 1.1, shape)
        light = rng.uniform(100, 700, shape)
        light.flat[rng.choice(light.size, 3, replace=False)] = 0, -1, -20  # noise may lie below black
        if shape == (6, 6):
            dead, deader = rng.choice(36, 2, replace=False)
            response.flat[dead], response.flat[deader] = 0, -0.01  # the second's flat is even below its dark
        if shape == (7, 5):
            response[2] = [0.5, 0.1, 0.02, 0.005, 0.001]  # weak pixels, which are not dead
        yield (dark + light * response, dark, dark + rng.uniform(300, 600) * response)


FLAT_FIELD = Exercise(
    name="15.flat_field",
    reference=flat_field,
    cases=_flat_cases,
    hints=(
        "Which of the three pictures contain the dark? Take it off those before anything is divided.",
        "Call what a pixel makes of the even light its answer, and let `np.where` put NaN where it is not above 0. "
        "Of the answers you need the mean without the NaN: NumPy has a function for that.",
        "`return (frame - dark) * ___ / answer`",
    ),
    praise="Offsets, PRNU, vignetting and dust go in one line; dead pixels are said to be dead.",
)


@FLAT_FIELD.right
def with_a_masked_array(frame, dark, flat):
    answer = np.ma.masked_less_equal(flat - dark, 0)
    return (frame - dark) / (answer / answer.mean())


@FLAT_FIELD.wrong("You did not subtract the dark. Offsets add: subtract them before you divide.")
def dark_left_in_both(frame, dark, flat):
    return frame / flat * np.mean(flat)


@FLAT_FIELD.wrong("The flat still contains the dark: subtract it there too.")
def dark_left_in_the_flat(frame, dark, flat):
    return (frame - dark) / flat * np.mean(flat)


@FLAT_FIELD.wrong("The division is right. Multiply by the mean of flat − dark, so that the frame keeps its brightness.")
def not_scaled(frame, dark, flat):
    return (frame - dark) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong("You cut off what lies below black. Noise goes either way, and a mean needs both: keep the sign.")
def cut_off_at_black(frame, dark, flat):
    return np.maximum(flat_field(frame, dark, flat), 0)


@FLAT_FIELD.wrong("A pixel whose flat is not above its dark is dead. Give it NaN, and leave it out of the mean.")
def dead_pixels_forgotten(frame, dark, flat):
    return (frame - dark) / (flat - dark) * np.mean(flat - dark)


@FLAT_FIELD.wrong("Dead pixels are NaN now, but the mean still counts them. Take it over the others only.")
def dead_pixels_in_the_mean(frame, dark, flat):
    return (frame - dark) * np.mean(flat - dark) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong("You multiplied by the flat, which doubles the shading. Divide by it.")
def multiplied(frame, dark, flat):
    return (frame - dark) * (flat - dark) / np.mean(flat - dark)


# 4: merge a bracket ---------------------------------------------------------------------------------------------------


def merge(electrons: Array, exposures: Array, dark_noise: float, full_well: float) -> Array:
    """Electrons per second (...) from frames (n, ...), weights t² / (σ² + x t); NaN where every frame is full."""
    t, usable = _times(electrons, exposures), electrons < full_well
    x = _light(electrons, t, usable)
    return _weighed(usable * t**2 / (dark_noise**2 + x * t), electrons / t)


def _times(electrons: Array, exposures: Array) -> Array:
    """The exposures with axes of length 1, to broadcast against the frames (n, ...)."""
    return np.asarray(exposures).reshape(-1, *[1] * (electrons.ndim - 1))


def _weighed(weights: Array, values: Array) -> Array:
    """The weighted mean over the frames; NaN where nothing has weight."""
    return np.asarray(np.sum(weights * values, axis=0) / np.sum(weights, axis=0))


def _light(electrons: Array, t: Array, usable: Array) -> Array:
    """The first estimate, Σ e / Σ t over the usable frames."""
    return np.asarray(np.sum(usable * electrons, axis=0) / np.sum(usable * t, axis=0))


def _merge_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in ((5,), (3, 4), (2, 6)):
        exposures = np.sort(rng.uniform(0.01, 1, rng.integers(2, 5)))
        rate = np.exp(rng.uniform(4, 11, shape))
        t = exposures.reshape(-1, *[1] * len(shape))
        full = float(rng.integers(5_000, 40_000))
        electrons = np.minimum(rate * t * rng.uniform(0.9, 1.1, (len(t), *shape)), full)
        yield (electrons, exposures, float(rng.uniform(3, 9)), full)
    full = float(rng.integers(9_000, 30_000))
    over, under = full + 40, full - 1
    sure = np.array(  # in columns: full in all frames, in two, in one, in none; next to no light, none, and less
        [
            [full, 3_000, 2_000, 400, 0, 0, -2],
            [over, full, 8_100, 1_570, 1, 0, 1],
            [full, over, full, under, 3, 0, -3],
        ]
    )
    yield (sure, rng.uniform([0.08, 0.3, 0.9], [0.12, 0.5, 1.1]), float(rng.uniform(3, 9)), full)


MERGE = Exercise(
    name="15.merge",
    reference=merge,
    cases=_merge_cases,
    tolerance=1e-7,
    hints=(
        "Which frames may say something about a pixel? Mark them first, in an array of the shape of `electrons`.",
        "Give the exposures axes of length 1, `exposures.reshape(-1, 1, …)`, so that they broadcast. Sum over axis 0: "
        "once for x, then for the weighted mean. A frame that is not usable has weight 0, and 0/0 is NaN.",
        "`weight = usable * ___ / (dark_noise**2 + ___)`",
    ),
    praise="No other weights would leave less noise. That is what a noise model is for.",
)


@MERGE.right
def with_full_pixels_as_nan(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    seen, time = np.where(electrons < full_well, electrons, np.nan), np.where(electrons < full_well, t, np.nan)
    x = np.nansum(seen, axis=0) / np.nansum(time, axis=0)
    inverse = 1 / ((dark_noise**2 + x * time) / time**2)
    return np.nansum(inverse * seen / time, axis=0) / np.nansum(inverse, axis=0)


@MERGE.wrong("A count *of* `full_well` is saturated too: only counts below it are usable.")
def full_well_itself_usable(electrons, exposures, dark_noise, full_well):
    return merge(electrons, exposures, dark_noise, np.nextafter(full_well, np.inf))


@MERGE.wrong("This is Σ e / Σ t, the first estimate. Read noise counts in the dark: weigh by t² / (σ² + x t).")
def first_estimate(electrons, exposures, dark_noise, full_well):
    return _light(electrons, _times(electrons, exposures), electrons < full_well)


@MERGE.wrong("You use full pixels. They need no weight, and NaN where all are full.")
def full_pixels_too(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    return _weighed(t**2 / (dark_noise**2 + _light(electrons, t, electrons >= 0) * t), electrons / t)


@MERGE.wrong("Full pixels are out of your mean, but still in x. Leave them out of Σ e and Σ t as well.")
def full_pixels_in_the_first_estimate(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    x = _light(electrons, t, electrons >= 0)
    return _weighed((electrons < full_well) * t**2 / (dark_noise**2 + x * t), electrons / t)


@MERGE.wrong("Your weights use each frame's own, noisy count. Take x from all usable frames together.")
def weights_from_each_count(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    return _weighed((electrons < full_well) * t**2 / (dark_noise**2 + electrons), electrons / t)


@MERGE.wrong("You average electrons. The frames had different times: average e / t, electrons per second.")
def electrons_averaged(electrons, exposures, dark_noise, full_well):
    t, usable = _times(electrons, exposures), electrons < full_well
    return _weighed(usable * t**2 / (dark_noise**2 + _light(electrons, t, usable) * t), electrons)


@MERGE.wrong("You drop a whole frame as soon as one pixel of it is full. Decide for each pixel by itself.")
def whole_frames_dropped(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    good = (electrons < full_well).all(axis=tuple(range(1, electrons.ndim)), keepdims=True) & (electrons >= 0)
    return _weighed(good * t**2 / (dark_noise**2 + _light(electrons, t, good) * t), electrons / t)


# 5: what rows and columns share ---------------------------------------------------------------------------------------


def stripes(frame: Array) -> Array:
    """The variances (3,) of rows, of columns and of single pixels in a frame (height, width), split after EMVA 1288."""
    height, width = frame.shape
    of_rows, of_columns = np.var(frame.mean(axis=1)), np.var(frame.mean(axis=0))
    pixels = (np.var(frame) - of_rows - of_columns) / (1 - 1 / height - 1 / width)
    return np.array([of_rows - pixels / width, of_columns - pixels / height, pixels])


def _stripe_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for height, width in ((40, 60), (60, 25), (9, 14), (30, 30)):
        row, column, pixel = rng.uniform(0.5, 4, 3)
        shared = row * rng.standard_normal((height, 1)) + column * rng.standard_normal(width)
        yield (rng.uniform(-2, 2) + shared + pixel * rng.standard_normal((height, width)),)
    noise = rng.uniform(4, 9) * rng.standard_normal((8, 12))
    yield (noise - noise.mean(axis=0) - noise.mean(axis=1, keepdims=True),)  # fewer stripes than chance: below 0


STRIPES = Exercise(
    name="15.stripes",
    reference=stripes,
    cases=_stripe_cases,
    hints=(
        "Begin with the pixels: subtract the second and the third equation from the first. What is left of σ²_pixel?",
        "The mean of a row is `frame.mean(axis=1)`: it runs along axis 1. What is left for the pixels is "
        "σ²_pixel (1 − 1/height − 1/width).",
        "`pixels = (np.var(frame) - ___ - ___) / (1 - 1 / height - 1 / width)`",
    ),
    praise="Stripes far below the noise of the pixels, and their strength is known.",
)


@STRIPES.right
def as_linear_equations(frame):
    height, width = frame.shape
    seen = [np.var(frame), np.var(frame.mean(axis=1)), np.var(frame.mean(axis=0))]
    return np.linalg.solve([[1, 1, 1], [1, 0, 1 / width], [0, 1, 1 / height]], seen)


def _means(frame):
    """The variances of the whole, and of the means of rows and of columns."""
    return np.var(frame), np.var(frame.mean(axis=1)), np.var(frame.mean(axis=0))


@STRIPES.wrong("Rows and columns have changed places: `axis=0` runs down a column, `axis=1` along a row.")
def axes_exchanged(frame):
    return stripes(frame)[[1, 0, 2]]


@STRIPES.wrong("These are the variances of the *means*. Subtract the pixels' part by the second and third equation.")
def means_as_they_are(frame):
    whole, of_rows, of_columns = _means(frame)
    return np.array([of_rows, of_columns, whole - of_rows - of_columns])


@STRIPES.wrong("The pixels' variance is right. Subtract its share in each mean from the other two variances.")
def share_left_in(frame):
    _, of_rows, of_columns = _means(frame)
    return np.array([of_rows, of_columns, stripes(frame)[2]])


@STRIPES.wrong("You also subtracted a part of the pixels' own noise: divide by 1 − 1/height − 1/width.")
def pixels_not_made_whole(frame):
    whole, of_rows, of_columns = _means(frame)
    height, width = frame.shape
    pixels = whole - of_rows - of_columns
    return np.array([of_rows - pixels / width, of_columns - pixels / height, pixels])


@STRIPES.wrong("You cut off an estimate below 0. Without stripes chance goes either way: keep the sign.")
def cut_off_below_zero(frame):
    return np.maximum(stripes(frame), 0)


# 6: the least light that can be measured ------------------------------------------------------------------------------


def threshold_photons(dark_noise: Array, efficiency: float) -> Array:
    """Photons (...) whose signal equals its noise: the positive root of μ² = σ_d² + μ, over the quantum efficiency."""
    electrons = 0.5 + np.sqrt(dark_noise**2 + 0.25)
    return electrons / efficiency


def threshold_as_given(dark_noise, efficiency):
    electrons = np.sqrt(dark_noise**2 + 0.25)
    return 0.5 + electrons / efficiency


def _threshold_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for shape in SHAPES:
        yield (rng.uniform(0.5, 30, shape), float(rng.uniform(0.1, 0.9)))
    yield (np.array([0.0, 0.3, 1.0]), float(rng.uniform(0.1, 0.9)))  # a perfect amplifier, and nearly one
    yield (rng.uniform(0.5, 30, 3), 1.0)  # each photon becomes an electron


THRESHOLD = Exercise(
    name="15.threshold_photons",
    reference=threshold_photons,
    cases=_threshold_cases,
    as_given=threshold_as_given,
    shown=((10.95, 0.451),),
    hints=(
        "Without noise in the dark and with η = 0.5 it says 1.5 photons. They give 0.75 electrons. Is their noise, "
        "√0.75, as large as they are?",
        "Say the unit of each term aloud. One of the two is divided by the efficiency, and the other is not.",
        "`electrons = ___ + np.sqrt(dark_noise**2 + 0.25)`",
    ),
    praise="Without any read noise it is one electron: light brings noise of its own.",
)


@THRESHOLD.right
def by_right_angles_again(dark_noise, efficiency):
    return (0.5 + np.hypot(dark_noise, 0.5)) / efficiency


@THRESHOLD.right
def by_trying_again_and_again(dark_noise, efficiency):
    electrons = dark_noise + 1.0
    for _ in range(60):
        electrons = np.sqrt(dark_noise**2 + electrons)
    return electrons / efficiency


@THRESHOLD.wrong("That is the approximation EMVA 1288 prints, σ_d + ½. The task asks for the exact root.")
def as_the_standard_prints_it(dark_noise, efficiency):
    return (dark_noise + 0.5) / efficiency


@THRESHOLD.wrong("These are electrons. A photon gives only η of one, so divide by the efficiency.")
def in_electrons(dark_noise, efficiency):
    return 0.5 + np.sqrt(dark_noise**2 + 0.25)


@THRESHOLD.wrong("The ½ in front of the root is missing: μ = ½ + √(σ_d² + ¼).")
def without_the_half(dark_noise, efficiency):
    return np.sqrt(dark_noise**2 + 0.25) / efficiency


@THRESHOLD.wrong("You divide the dark noise by the efficiency. σ_d is in electrons: find the electrons, then divide.")
def dark_noise_in_photons(dark_noise, efficiency):
    return 0.5 + np.sqrt((dark_noise / efficiency) ** 2 + 0.25)


@THRESHOLD.wrong("You left out the light's own noise. A perfect amplifier would then need no light at all.")
def noise_in_the_dark_alone(dark_noise, efficiency):
    return dark_noise / efficiency


EXERCISES = (NOISE, GAIN, FLAT_FIELD, MERGE, STRIPES, THRESHOLD)
