"""Lesson 15, sensor noise: how kinds of noise add, gain from two frames, flat fields, HDR, stripes, units mixed up.

Noise figures are standard deviations in electrons, frames are in digital numbers (DN), after EMVA Standard 1288.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

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


@NOISE.right
def as_the_length_of_a_vector(electrons, read_noise, prnu):
    parts = np.broadcast_arrays(read_noise, np.sqrt(electrons), prnu * np.asarray(electrons))
    return np.linalg.norm(np.stack(parts), axis=0)


@NOISE.right
def with_the_signal_factored_out(electrons, read_noise, prnu):
    return (read_noise * read_noise + electrons * (1 + prnu * prnu * electrons)) ** 0.5


@NOISE.wrong("You add the deviations. Independent noise adds as variances: the squares, then one root over all.")
def deviations_added(electrons, read_noise, prnu):
    return read_noise + np.sqrt(electrons) + prnu * electrons


@NOISE.wrong("The pattern is missing: on one frame pixels differ by PRNU times the signal as well.")
def without_the_pattern(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons)


@NOISE.wrong("The photons are missing. They are random even if the camera is perfect: their variance is their mean.")
def without_the_photons(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + (prnu * electrons) ** 2)


@NOISE.wrong("The read noise is missing. It is there in the dark too, where this function finds none.")
def without_the_reading(electrons, read_noise, prnu):
    return np.sqrt(electrons + (prnu * electrons) ** 2)


@NOISE.wrong("The *variance* of a Poisson count is its mean, μ; you put in μ², as though the deviation were μ.")
def photons_squared(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons**2 + (prnu * electrons) ** 2)


@NOISE.wrong("The photons' *deviation* is √μ. Under the root belongs its square, which is μ itself.")
def root_of_photons_under_the_root(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + np.sqrt(electrons) + (prnu * electrons) ** 2)


@NOISE.wrong("This is the variance. The noise is its square root.")
def variance(electrons, read_noise, prnu):
    return read_noise**2 + electrons + (prnu * electrons) ** 2


@NOISE.wrong("The read noise is a deviation: its square belongs under the root.")
def read_noise_not_squared(electrons, read_noise, prnu):
    return np.sqrt(read_noise + electrons + (prnu * electrons) ** 2)


@NOISE.wrong("PRNU times the signal is a deviation: its square belongs under the root.")
def pattern_not_squared(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons + prnu * electrons)


@NOISE.wrong("`prnu * electrons**2` squares the electrons alone. The pattern's deviation is the product: square both.")
def only_the_electrons_squared(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons + prnu * electrons**2)


@NOISE.wrong("PRNU is a share of the *signal*. You take the share of the photons' noise.")
def pattern_of_the_noise(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons + prnu**2 * electrons)


@NOISE.wrong("`prnu` is a fraction already, 0.01 for one per cent. You divide it by a hundred.")
def prnu_in_percent(electrons, read_noise, prnu):
    return np.sqrt(read_noise**2 + electrons + (prnu / 100 * electrons) ** 2)


@NOISE.wrong("You take the strongest kind alone. The weaker ones add something too, as squares.")
def the_strongest_alone(electrons, read_noise, prnu):
    return np.maximum(np.maximum(read_noise, np.sqrt(electrons)), prnu * np.asarray(electrons))


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
def over_one_pixel_less(bright, dark):
    noise = (np.var(bright[1] - bright[0], ddof=1) - np.var(dark[1] - dark[0], ddof=1)) / 2
    return noise / (bright.mean() - dark.mean())


@GAIN.right
def by_each_pixel_s_own_variance(bright, dark):
    noise = np.var(bright, axis=0, ddof=1).mean() - np.var(dark, axis=0, ddof=1).mean()
    return noise / (bright.mean() - dark.mean())


@GAIN.wrong("The variance of a difference is that of *two* frames: halve it.")
def not_halved(bright, dark):
    return 2 * gain(bright, dark)


@GAIN.wrong(
    "A factor of 2 too small. Halve the variance of the difference once; `np.var` over two frames halves it "
    "twice, unless `ddof=1` says that two numbers have one difference."
)
def halved_twice(bright, dark):
    return gain(bright, dark) / 2


@GAIN.wrong("You took the variance over one frame, in which the pattern counts as noise. Subtract two frames first.")
def of_one_frame(bright, dark):
    return (np.var(bright[0]) - np.var(dark[0])) / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("In the *sum* of two frames the pattern is there twice over. It drops out of their difference.")
def sum_for_difference(bright, dark):
    return (np.var(bright[0] + bright[1]) - np.var(dark[0] + dark[1])) / 2 / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("A bright frame less a dark one keeps the PRNU. Subtract frames of the *same* light from each other.")
def bright_less_dark(bright, dark):
    return np.var(bright[0] - dark[0]) / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("The noise of the dark frames has to be taken off too: it has nothing to do with light.")
def dark_noise_left_in(bright, dark):
    return np.var(bright[0] - bright[1]) / 2 / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("The variance in the dark is *subtracted*: what is left is the photons' own. You add it.")
def dark_noise_added(bright, dark):
    noise = (np.var(bright[0] - bright[1]) + np.var(dark[0] - dark[1])) / 2
    return noise / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("The signal begins above the dark: divide by mean bright *less mean dark*.")
def black_level_left_in(bright, dark):
    return (np.var(bright[0] - bright[1]) - np.var(dark[0] - dark[1])) / 2 / np.mean(bright)


@GAIN.wrong("This is electrons per DN. K is DN per electron, its inverse.")
def electrons_per_dn(bright, dark):
    return 1 / gain(bright, dark)


@GAIN.wrong("These are deviations. Variances are what grows in proportion to the light.")
def deviations(bright, dark):
    return (np.std(bright[0] - bright[1]) - np.std(dark[0] - dark[1])) / np.sqrt(2) / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("Each variance is right, and the difference of their *roots* is not: subtract first, and take no root.")
def square_of_the_difference_of_deviations(bright, dark):
    apart = np.std(bright[0] - bright[1]) - np.std(dark[0] - dark[1])
    return apart**2 / 2 / (np.mean(bright) - np.mean(dark))


@GAIN.wrong("A variance is the mean of *squares*. You average the sizes of the differences.")
def mean_absolute_difference(bright, dark):
    noise = np.mean(np.abs(bright[0] - bright[1])) - np.mean(np.abs(dark[0] - dark[1]))
    return noise / 2 / (np.mean(bright) - np.mean(dark))


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
def with_a_mask(frame, dark, flat):
    alive = flat > dark
    mended = np.full(frame.shape, np.nan)
    mended[alive] = (frame - dark)[alive] / (flat - dark)[alive] * (flat - dark)[alive].mean()
    return mended


@FLAT_FIELD.right
def with_a_masked_array(frame, dark, flat):
    answer = np.ma.masked_less_equal(flat - dark, 0)
    return (frame - dark) / (answer / answer.mean())


@FLAT_FIELD.right
def as_the_package_does_it(frame, dark, flat):
    from camviz.sensors.correction import flattened

    return flattened(frame, dark, flat)


@FLAT_FIELD.wrong("The dark was not taken off. Offsets add, so they must be subtracted before anything is divided.")
def dark_left_in_both(frame, dark, flat):
    return frame / flat * np.mean(flat)


@FLAT_FIELD.wrong("The flat still contains the dark: subtract it there too.")
def dark_left_in_the_flat(frame, dark, flat):
    return (frame - dark) / flat * np.mean(flat)


@FLAT_FIELD.wrong("The frame still contains the dark: subtract it there too.")
def dark_left_in_the_frame(frame, dark, flat):
    answer = np.where(flat > dark, flat - dark, np.nan)
    return frame * np.nanmean(answer) / answer


@FLAT_FIELD.wrong("You subtract the dark after dividing. It is added to what the pixel answers: take it off first.")
def divided_first(frame, dark, flat):
    answer = np.where(flat > dark, flat - dark, np.nan)
    return frame * np.nanmean(answer) / answer - dark


@FLAT_FIELD.wrong("Right, with the dark added again at the end. The result is to be above black.")
def dark_put_back(frame, dark, flat):
    return flat_field(frame, dark, flat) + dark


@FLAT_FIELD.wrong("Divided well. Scale by the mean of flat − dark, so that the frame keeps its brightness.")
def not_scaled(frame, dark, flat):
    return (frame - dark) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong("You scale by the mean of the flat with its dark. The answer to light is flat − dark: take its mean.")
def scaled_by_the_whole_flat(frame, dark, flat):
    return (frame - dark) * np.mean(flat) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong(
    "You scale by the mean of the *frame*. The brightness of the flat is to be divided out, not the frame's."
)
def scaled_by_the_frame(frame, dark, flat):
    return (frame - dark) * np.mean(frame - dark) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong(
    "What lies below black is cut off at 0. Noise goes either way, and a sum of many frames needs both: keep the sign."
)
def cut_off_at_black(frame, dark, flat):
    return np.maximum(flat_field(frame, dark, flat), 0)


@FLAT_FIELD.wrong(
    "The size of the difference is taken: a pixel below black looks as bright as one above. Keep the sign."
)
def size_of_the_difference(frame, dark, flat):
    return np.abs(flat_field(frame, dark, flat))


@FLAT_FIELD.wrong(
    "You call a pixel dead when the *frame* is not above its dark. It is the flat that tells: there was light on it."
)
def dead_by_the_frame(frame, dark, flat):
    answer = np.where(frame > dark, flat - dark, np.nan)
    return (frame - dark) * np.nanmean(answer) / answer


@FLAT_FIELD.wrong("You scale by the strongest pixel's answer. The exercise asks that the *mean* answer becomes 1.")
def scaled_by_the_largest(frame, dark, flat):
    answer = np.where(flat > dark, flat - dark, np.nan)
    return (frame - dark) * np.nanmax(answer) / answer


@FLAT_FIELD.wrong("The median is a good idea where there is dust. The exercise asks that the *mean* answer becomes 1.")
def scaled_by_the_median(frame, dark, flat):
    answer = np.where(flat > dark, flat - dark, np.nan)
    return (frame - dark) * np.nanmedian(answer) / answer


@FLAT_FIELD.wrong("You multiplied by the flat: the shading is there twice now. Divide by it.")
def multiplied(frame, dark, flat):
    return (frame - dark) * (flat - dark) / np.mean(flat - dark)


@FLAT_FIELD.wrong(
    "A dead pixel, whose flat is not above its dark, has no answer: NaN, and it must not count in the mean."
)
def dead_pixels_forgotten(frame, dark, flat):
    return (frame - dark) / (flat - dark) * np.mean(flat - dark)


@FLAT_FIELD.wrong("Dead pixels are NaN now, and the mean still counts them. Take it over the others only.")
def dead_pixels_in_the_mean(frame, dark, flat):
    return (frame - dark) * np.mean(flat - dark) / np.where(flat > dark, flat - dark, np.nan)


@FLAT_FIELD.wrong("A dead pixel is 0 in yours, which looks like a dark thing. Nothing is known of it: NaN.")
def dead_pixels_black(frame, dark, flat):
    return np.nan_to_num(flat_field(frame, dark, flat))


@FLAT_FIELD.wrong("A flat *below* its dark is as dead as one that equals it: *not above* is the condition.")
def dead_only_where_equal(frame, dark, flat):
    answer = np.where(flat == dark, np.nan, flat - dark)
    return (frame - dark) * np.nanmean(answer) / answer


# 4: merge a bracket ---------------------------------------------------------------------------------------------------


def merge(electrons: Array, exposures: Array, dark_noise: float, full_well: float) -> Array:
    """Electrons per second (...) from frames (n, ...), weights t² / (σ² + x t); NaN where every frame is full."""
    return _merged(electrons, exposures, full_well, lambda x, t: t**2 / (dark_noise**2 + x * t))


def _merged(electrons: Array, exposures: Array, full_well: float, weight: Callable[[Array, Array], Array]) -> Array:
    """The mean of the frames, each pixel that is not full with weight(x, t): x its light, t the frame's time."""
    t, usable = _times(electrons, exposures), electrons < full_well
    return _weighed(usable * weight(_light(electrons, t, usable), t), electrons / t)


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


@MERGE.right
def pixel_by_pixel(electrons, exposures, dark_noise, full_well):
    merged = np.full(electrons.shape[1:], np.nan)
    for index in np.ndindex(merged.shape):
        counts = electrons[(slice(None), *index)]
        good = counts < full_well
        if good.any():
            e, t = counts[good], exposures[good]
            merged[index] = np.average(e / t, weights=t**2 / (dark_noise**2 + e.sum() / t.sum() * t))
    return merged


@MERGE.right
def by_matrix_products(electrons, exposures, dark_noise, full_well):
    e, t = electrons.reshape(len(exposures), -1), exposures[:, None]
    good = (e < full_well).astype(float)
    x = np.sum(good * e, axis=0) / (exposures @ good)
    weight = good / (dark_noise**2 / t**2 + x / t)
    return (np.sum(weight * e / t, axis=0) / np.sum(weight, axis=0)).reshape(electrons.shape[1:])


@MERGE.right
def frame_after_frame(electrons, exposures, dark_noise, full_well):
    counted, time, total, weights = (np.zeros(electrons.shape[1:]) for _ in range(4))
    for e, t in zip(electrons, exposures, strict=True):
        counted += np.where(e >= full_well, 0, e)
        time += np.where(e >= full_well, 0, t)
    with np.errstate(invalid="ignore", divide="ignore"):
        x = counted / time
        for e, t in zip(electrons, exposures, strict=True):
            weight = np.where(e >= full_well, 0, t * t / (dark_noise * dark_noise + x * t))
            total += np.where(weight > 0, weight * e / t, 0)
            weights += np.where(weight > 0, weight, 0)
        return (total / weights).tolist()


@MERGE.wrong("The full well is written into your function. Other sensors hold more or less: use `full_well`.")
def full_well_written_in(electrons, exposures, dark_noise, full_well):
    return merge(electrons, exposures, dark_noise, 12_000)


@MERGE.wrong("A count *of* `full_well` is saturated too: usable is what lies below it.")
def full_well_itself_usable(electrons, exposures, dark_noise, full_well):
    return merge(electrons, exposures, dark_noise, np.nextafter(full_well, np.inf))


@MERGE.wrong("Only counts that equal `full_well` are left out in yours. What lies above it is saturated as well.")
def only_the_full_well_itself(electrons, exposures, dark_noise, full_well):
    t, usable = _times(electrons, exposures), electrons != full_well
    return _weighed(usable * t**2 / (dark_noise**2 + _light(electrons, t, usable) * t), electrons / t)


@MERGE.wrong("Counts below 0 are cut off in yours. Noise goes either way, and a mean needs both.")
def negative_counts_cut_off(electrons, exposures, dark_noise, full_well):
    return merge(np.maximum(electrons, 0), exposures, dark_noise, full_well)


@MERGE.wrong("All usable frames count alike in yours. The short ones are noisier by far: weigh by 1 / variance.")
def all_alike(electrons, exposures, dark_noise, full_well):
    return _merged(electrons, exposures, full_well, lambda x, t: 1.0)


@MERGE.wrong(
    "This is Σ e / Σ t, the first estimate, or weights of t, which is the same. It is right for photons alone. In "
    "the dark the read noise counts: t² / (σ² + x t)."
)
def first_estimate(electrons, exposures, dark_noise, full_well):
    return _light(electrons, _times(electrons, exposures), electrons < full_well)


@MERGE.wrong("Full pixels say only 'at least so much'. They must have no weight, and NaN where all are full.")
def full_pixels_too(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    return _weighed(t**2 / (dark_noise**2 + _light(electrons, t, electrons >= 0) * t), electrons / t)


@MERGE.wrong("Full pixels have no weight in your mean, but they still are in x. Leave them out of Σ e and Σ t as well.")
def full_pixels_in_the_first_estimate(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    x = _light(electrons, t, electrons >= 0)
    return _weighed((electrons < full_well) * t**2 / (dark_noise**2 + x * t), electrons / t)


@MERGE.wrong("You drop a whole frame as soon as one pixel of it is full. Decide for each pixel by itself.")
def whole_frames_dropped(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    good = (electrons < full_well).all(axis=tuple(range(1, electrons.ndim)), keepdims=True) & (electrons >= 0)
    return _weighed(good * t**2 / (dark_noise**2 + _light(electrons, t, good) * t), electrons / t)


@MERGE.wrong("Where every frame is full nothing is known. That is NaN, and not no light at all.")
def no_light_where_all_are_full(electrons, exposures, dark_noise, full_well):
    return np.nan_to_num(merge(electrons, exposures, dark_noise, full_well))


@MERGE.wrong(
    "Your weights come from each frame's own, noisy count, which favours those that chance made dark: take x "
    "from all usable frames together."
)
def weights_from_each_count(electrons, exposures, dark_noise, full_well):
    t = _times(electrons, exposures)
    return _weighed((electrons < full_well) * t**2 / (dark_noise**2 + electrons), electrons / t)


@MERGE.wrong("You weigh by the variance: the noisiest count most. Take its inverse.")
def weighed_by_the_variance(electrons, exposures, dark_noise, full_well):
    return _merged(electrons, exposures, full_well, lambda x, t: (dark_noise**2 + x * t) / t**2)


@MERGE.wrong("You weigh by 1 / deviation. The least noise is left by 1 / *variance*: no root.")
def weighed_by_the_deviation(electrons, exposures, dark_noise, full_well):
    return _merged(electrons, exposures, full_well, lambda x, t: t / np.sqrt(dark_noise**2 + x * t))


@MERGE.wrong("e / t has the variance (σ² + x t) / t²: the t below comes squared. Yours is not.")
def time_not_squared(electrons, exposures, dark_noise, full_well):
    return _merged(electrons, exposures, full_well, lambda x, t: t / (dark_noise**2 + x * t))


@MERGE.wrong("The read noise is a deviation. Beside the photons' variance x t belongs its square.")
def read_noise_not_squared_in_the_weights(electrons, exposures, dark_noise, full_well):
    return _merged(electrons, exposures, full_well, lambda x, t: t**2 / (dark_noise + x * t))


@MERGE.wrong("Weights of t² are right for read noise alone. Light brings noise of its own, x t.")
def weights_without_photons(electrons, exposures, dark_noise, full_well):
    return _merged(electrons, exposures, full_well, lambda x, t: t**2)


@MERGE.wrong("You average electrons. The frames had different times: average e / t, electrons per second.")
def electrons_averaged(electrons, exposures, dark_noise, full_well):
    t, usable = _times(electrons, exposures), electrons < full_well
    return _weighed(usable * t**2 / (dark_noise**2 + _light(electrons, t, usable) * t), electrons)


@MERGE.wrong("The longest frame that is not full, alone, is a good start. The others have something to add.")
def the_longest_alone(electrons, exposures, dark_noise, full_well):
    usable = electrons < full_well
    last = len(exposures) - 1 - np.argmax(usable[::-1], axis=0)
    best = np.take_along_axis(electrons / _times(electrons, exposures), last[None], axis=0)[0]
    return np.where(usable.any(axis=0), best, np.nan)


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


@STRIPES.right
def by_what_rows_and_columns_leave(frame):
    rows, columns = frame.mean(axis=1, keepdims=True), frame.mean(axis=0, keepdims=True)
    height, width = frame.shape
    left = np.sum((frame - rows - columns + frame.mean()) ** 2) / (height * width - height - width)
    return [np.mean((rows - frame.mean()) ** 2) - left / width, np.var(columns) - left / height, left]


@STRIPES.right
def column_by_column(frame):
    import cv2

    height, width = frame.shape
    whole, of_rows, of_columns = (
        cv2.meanStdDev(np.float64(one))[1][0, 0] ** 2 for one in (frame, frame.mean(axis=1), frame.mean(axis=0))
    )
    pixels = (whole - of_rows - of_columns) * height * width / (height * width - height - width)
    return np.array((of_rows - pixels / width, of_columns - pixels / height, pixels))


def _means(frame):
    """The variances of the whole, and of the means of rows and of columns."""
    return np.var(frame), np.var(frame.mean(axis=1)), np.var(frame.mean(axis=0))


@STRIPES.wrong("Rows and columns have changed places: `axis=0` runs down a column, `axis=1` along a row.")
def axes_exchanged(frame):
    return stripes(frame)[[1, 0, 2]]


@STRIPES.wrong(
    "These are the variances of the *means*. A share of the pixels' own noise is in them: the third and the second "
    "equation say how much."
)
def means_as_they_are(frame):
    whole, of_rows, of_columns = _means(frame)
    return np.array([of_rows, of_columns, whole - of_rows - of_columns])


@STRIPES.wrong("The pixels' variance is right. Take its share, one part in the number of pixels, off the other two.")
def share_left_in(frame):
    _, of_rows, of_columns = _means(frame)
    return np.array([of_rows, of_columns, stripes(frame)[2]])


@STRIPES.wrong("The shares are exchanged: a row's mean is over `width` pixels, a column's over `height`.")
def shares_exchanged(frame):
    _, of_rows, of_columns = _means(frame)
    height, width = frame.shape
    pixels = stripes(frame)[2]
    return np.array([of_rows - pixels / height, of_columns - pixels / width, pixels])


@STRIPES.wrong("For the pixels you took the whole variance. That of rows and of columns is in it.")
def whole_for_the_pixels(frame):
    whole, of_rows, of_columns = _means(frame)
    height, width = frame.shape
    return np.array([of_rows - whole / width, of_columns - whole / height, whole])


@STRIPES.wrong(
    "What the means have was taken off, and of the pixels' own noise with it: divide by 1 − 1/height − 1/width."
)
def pixels_not_made_whole(frame):
    whole, of_rows, of_columns = _means(frame)
    height, width = frame.shape
    pixels = whole - of_rows - of_columns
    return np.array([of_rows - pixels / width, of_columns - pixels / height, pixels])


@STRIPES.wrong("These are deviations, the roots. The task asks for variances.")
def deviations_of_stripes(frame):
    return np.sqrt(np.maximum(stripes(frame), 0))


@STRIPES.wrong(
    "An estimate below 0 was cut off. Where there are no stripes chance leads to either side: keep the sign."
)
def cut_off_below_zero(frame):
    return np.maximum(stripes(frame), 0)


@STRIPES.wrong(
    "You took the variance *within* each row and column, on average. The variance *of their means* is wanted."
)
def within_rows_and_columns(frame):
    height, width = frame.shape
    of_rows, of_columns = np.var(frame, axis=1).mean(), np.var(frame, axis=0).mean()
    pixels = (np.var(frame) - of_rows - of_columns) / (1 - 1 / height - 1 / width)
    return np.array([of_rows - pixels / width, of_columns - pixels / height, pixels])


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
def as_school_solves_quadratics(dark_noise, efficiency):
    return (1 + np.sqrt(1 + 4 * dark_noise**2)) / 2 / efficiency


@THRESHOLD.right
def by_trying_again_and_again(dark_noise, efficiency):
    electrons = dark_noise + 1.0
    for _ in range(60):
        electrons = np.sqrt(dark_noise**2 + electrons)
    return electrons / efficiency


@THRESHOLD.wrong("You left the light's own noise out. By your answer a perfect amplifier would need no light at all.")
def noise_in_the_dark_alone(dark_noise, efficiency):
    return dark_noise / efficiency


@THRESHOLD.wrong("That is the approximation EMVA 1288 prints, σ_d + ½. The task asks for the exact root.")
def as_the_standard_prints_it(dark_noise, efficiency):
    return (dark_noise + 0.5) / efficiency


@THRESHOLD.wrong("These are electrons. A photon gives only η of one, so divide by the efficiency.")
def in_electrons(dark_noise, efficiency):
    return 0.5 + np.sqrt(dark_noise**2 + 0.25)


@THRESHOLD.wrong(
    "You multiply by the efficiency. Where few photons become electrons *more* photons are needed: divide."
)
def times_the_efficiency(dark_noise, efficiency):
    return (0.5 + np.sqrt(dark_noise**2 + 0.25)) * efficiency


@THRESHOLD.wrong("That is the other root of the quadratic, and it is negative: no number of photons is.")
def the_other_root(dark_noise, efficiency):
    return (0.5 - np.sqrt(dark_noise**2 + 0.25)) / efficiency


@THRESHOLD.wrong("The ½ in front of the root is missing: μ² − μ = σ_d² has the middle of its roots at ½.")
def without_the_half(dark_noise, efficiency):
    return np.sqrt(dark_noise**2 + 0.25) / efficiency


@THRESHOLD.wrong("σ_d is a deviation. Under the root stands its square.")
def dark_noise_not_squared(dark_noise, efficiency):
    return (0.5 + np.sqrt(dark_noise + 0.25)) / efficiency


@THRESHOLD.wrong("You let the two noises add as they are. They know nothing of each other, so their squares add.")
def noises_added_as_they_are(dark_noise, efficiency):
    return ((1 + np.sqrt(1 + 4 * dark_noise)) / 2) ** 2 / efficiency


@THRESHOLD.wrong(
    "You took the efficiency into the noise as well. σ_d is in electrons: find the electrons, then divide."
)
def dark_noise_in_photons(dark_noise, efficiency):
    return 0.5 + np.sqrt((dark_noise / efficiency) ** 2 + 0.25)


EXERCISES = (NOISE, GAIN, FLAT_FIELD, MERGE, STRIPES, THRESHOLD)
