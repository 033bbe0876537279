"""Lesson 16, the clinic: statistics of residuals, a first diagnosis, what the next view tells, and what none can tell.

Residuals are detected less projected, in pixels, (views, corners, 2) or (rows, columns, 2), NaN where nothing was seen.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.poses import Rotation
from camviz_school.course.checks import Arguments, Array, Exercise

RAYLEIGH = np.sqrt(2 * np.log(2))  # the median length of a residual over the σ of its coordinates


def _residuals(rng: np.random.Generator, *shape: int) -> Array:
    return rng.normal(0, np.exp(rng.uniform(-3, 1)), (*shape, 2))  # from a twentieth of a pixel to nearly three


def _unseen(rng: np.random.Generator, residuals: Array) -> Array:
    """The same with about every seventh corner unseen, in every view at least one."""
    hidden = rng.uniform(size=residuals.shape[:-1]) < 0.15
    hidden[..., 0] = True
    residuals[hidden] = np.nan
    return residuals


# 1: the bars ---------------------------------------------------------------------------------------------------------


def view_rms(residuals: Array) -> Array:
    """The RMS length (views,) of each view's residuals (views, corners, 2), over the corners that were seen."""
    squares = np.sum(residuals**2, axis=-1)
    return np.sqrt(np.nanmean(squares, axis=-1))


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield (_residuals(rng, 5, 24),)
    yield (_residuals(rng, 1, 54),)
    yield (_unseen(rng, _residuals(rng, 7, 30)),)
    wild = _unseen(rng, _residuals(rng, 4, 20))
    wild[1] += rng.uniform(5, 30, 2)
    wild[2, 1:] = 0  # a view without any error
    yield (wild,)


VIEW_RMS = Exercise(
    name="16.view_rms",
    reference=view_rms,
    cases=_view_cases,
    hints=(
        "The length of a residual comes first: both coordinates of one corner are *one* residual.",
        "Add the squares of the two coordinates, take the mean over the corners of a view that were seen "
        "(`np.nanmean` passes over NaN), then the root.",
        "`return np.sqrt(np.nanmean(___, axis=-1))`",
    ),
    praise="These are the bars of the clinic, and what OpenCV calls perViewErrors.",
)


@VIEW_RMS.right
def with_a_masked_array(residuals):
    squares = np.ma.masked_invalid(residuals[..., 0] ** 2 + residuals[..., 1] ** 2)
    return np.ma.sqrt(squares.mean(axis=1))


@VIEW_RMS.wrong("This is the RMS of one *coordinate*: too small by √2. OpenCV counts a corner once.")
def of_single_coordinates(residuals):
    return np.sqrt(np.nanmean(residuals**2, axis=(-1, -2)))


@VIEW_RMS.wrong("This is the mean length. RMS squares first, then takes the mean, then the root.")
def mean_length(residuals):
    return np.nanmean(np.linalg.norm(residuals, axis=-1), axis=-1)


@VIEW_RMS.wrong("It is right where every corner was seen. Divide by the number of corners that *were* seen.")
def divided_by_all(residuals):
    return np.sqrt(np.nansum(residuals**2, axis=(-1, -2)) / residuals.shape[-2])


@VIEW_RMS.wrong("Take the root of the mean of the squares.")
def without_the_root(residuals):
    return np.nanmean(np.sum(residuals**2, axis=-1), axis=-1)


@VIEW_RMS.wrong("You average the arrows before you measure their length. Opposite arrows cancel.")
def length_of_the_mean(residuals):
    return np.linalg.norm(np.nanmean(residuals, axis=-2), axis=-1)


# 2: find the bug -----------------------------------------------------------------------------------------------------


def line_lengths(residuals: Array, rows: int, columns: int) -> tuple[Array, Array]:
    """The median length of the residuals (rows * columns, 2) in every row (rows,) and every column (columns,)."""
    lengths = np.linalg.norm(residuals, axis=-1).reshape(rows, columns)
    return np.median(lengths, axis=1), np.median(lengths, axis=0)


def line_lengths_as_given(residuals, rows, columns):
    lengths = np.linalg.norm(residuals, axis=-1).reshape(columns, rows)
    return np.median(lengths, axis=0), np.median(lengths, axis=1)


def _line_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for rows, columns in ((6, 9), (5, 8), (4, 4)):
        grid = _residuals(rng, rows, columns)
        grid[:, rng.integers(columns)] += rng.uniform(3, 8, 2)
        grid[rng.integers(rows), rng.integers(columns)] -= rng.uniform(20, 40, 2)
        yield (grid.reshape(-1, 2), rows, columns)


LINES = Exercise(
    name="16.line_lengths",
    reference=line_lengths,
    cases=_line_cases,
    as_given=line_lengths_as_given,
    hints=(
        "Write the numbers 0 to 5 into a board of 2 rows and 3 columns, row by row, and follow one of them through.",
        "Corners come row by row: the columns count fastest. Which of the two is then the first axis of the grid, and "
        "along which axis does the median of one row run?",
        "`lengths = np.linalg.norm(residuals, axis=-1).reshape(___)`",
    ),
    praise="Now a bad column is a bad column. The wrong reshape never raises an error.",
)


@LINES.right
def column_by_column_in_fortran_s_order(residuals, rows, columns):
    lengths = np.linalg.norm(residuals, axis=-1).reshape((columns, rows), order="F")
    return np.median(lengths, axis=0), np.median(lengths, axis=1)


@LINES.wrong("The grid is right now. But the median of a *row* runs along axis 1, over its columns.")
def axes_left_as_they_were(residuals, rows, columns):
    return line_lengths(residuals, rows, columns)[::-1]


@LINES.wrong("The axes were right for that grid. The reshape is wrong: change its order.")
def only_the_axes_changed(residuals, rows, columns):
    return line_lengths_as_given(residuals, rows, columns)[::-1]


@LINES.wrong("These are means. One corner that is far off moves the mean of its whole row; a median stays.")
def means(residuals, rows, columns):
    lengths = np.linalg.norm(residuals, axis=-1).reshape(rows, columns)
    return lengths.mean(axis=1), lengths.mean(axis=0)


@LINES.wrong("You use the first coordinate alone. Use both: square, add, take the root.")
def one_coordinate(residuals, rows, columns):
    lengths = np.abs(residuals[:, 0]).reshape(rows, columns)
    return np.median(lengths, axis=1), np.median(lengths, axis=0)


# 3: what is normal? --------------------------------------------------------------------------------------------------


def robust_sigma(residuals: Array) -> float:
    """σ of one coordinate of residuals (..., 2): the median of their lengths over √(2 ln 2) (Rayleigh)."""
    return float(np.nanmedian(np.linalg.norm(residuals, axis=-1)) / RAYLEIGH)


def _sigma_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield (_residuals(rng, 60),)
    yield (rng.normal(0, 20, (61, 2)),)  # so large that a per cent is seen
    for shape in ((8, 54), (3, 6, 9)):
        wild = _unseen(rng, _residuals(rng, *shape))
        wild[0] += rng.uniform(5, 30, 2)
        yield (wild,)


ROBUST_SIGMA = Exercise(
    name="16.robust_sigma",
    reference=robust_sigma,
    cases=_sigma_cases,
    any_numbers=False,  # in rounded lengths the two in the middle differ
    tolerance=1e-3,  # where the number of corners is even, a median of squares is not quite the square of a median
    hints=(
        "A median stands in the middle: as long as fewer than half are wild, it does not matter how wild they are.",
        "For Gaussian noise of σ in each coordinate the median *length* is σ √(2 ln 2) = 1.177 σ. Solve for σ; "
        "`np.nanmedian` passes over corners that were not seen.",
        "`return np.nanmedian(___) / np.sqrt(2 * np.log(2))`",
    ),
    praise="A view that is thirty pixels off moves your idea of what is normal only a little, and one that is three "
    "hundred pixels off moves it no more.",
)


@ROBUST_SIGMA.right
def by_sorting(residuals):
    lengths = np.sort(np.sqrt(np.nansum(residuals**2, axis=-1))[~np.isnan(residuals).any(axis=-1)])
    middle = len(lengths) // 2
    median = lengths[middle] if len(lengths) % 2 else (lengths[middle - 1] + lengths[middle]) / 2
    return median / 1.17741


@ROBUST_SIGMA.right
def by_scipy_s_rayleigh(residuals):
    from scipy.stats import rayleigh

    return np.nanpercentile(np.abs(residuals[..., 0] + 1j * residuals[..., 1]), 50) / rayleigh.median()


@ROBUST_SIGMA.wrong("This is the ordinary standard deviation. The wild view has moved it.")
def standard_deviation(residuals):
    return np.nanstd(residuals)


@ROBUST_SIGMA.wrong("This is a good robust σ, of single *coordinates*. Here take it from the median of the lengths.")
def of_coordinates(residuals):
    return 1.4826 * np.nanmedian(np.abs(residuals))


@ROBUST_SIGMA.wrong("1.4826 belongs to the absolute value of one number. A length in the plane has √(2 ln 2).")
def factor_of_one_number(residuals):
    return 1.4826 * np.nanmedian(np.linalg.norm(residuals, axis=-1))


@ROBUST_SIGMA.wrong("You use the *mean* length. One wild view moves a mean as far as it likes.")
def from_the_mean_length(residuals):
    return np.nanmean(np.linalg.norm(residuals, axis=-1)) / np.sqrt(np.pi / 2)


# 4: Huber's weight ---------------------------------------------------------------------------------------------------


def huber_weight(lengths: Array, limit: float) -> Array:
    """The weights (...) of residuals of these lengths (...): 1 up to the limit, limit / length beyond (Huber 1964)."""
    return limit / np.maximum(lengths, limit)


def _huber_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    limit = float(rng.uniform(0.2, 0.9))
    yield limit * np.array([0, 0.5, 1 - 1e-3, 1, 1 + 1e-3, 2, 30]), limit
    yield rng.uniform(0, 4, 20), float(rng.uniform(1.2, 2.5))
    yield rng.uniform(0, 6, (3, 9)) * rng.integers(0, 2, (3, 9)), float(rng.uniform(1.5, 2.5))


HUBER = Exercise(
    name="16.huber_weight",
    reference=huber_weight,
    cases=_huber_cases,
    hints=(
        "What is the weight of a corner that is just at the limit, by either line of the formula?",
        "`np.where` chooses between the two lines, but computes both: see that nothing is divided by 0. Or find one "
        "expression that is 1 up to the limit by itself.",
        "`return limit / np.maximum(___, ___)`",
    ),
    praise="Beyond the limit every corner pulls with the same force, one that is far off no more than another.",
)


@HUBER.right
def the_smaller_of_two(lengths, limit):
    with np.errstate(divide="ignore"):
        return np.minimum(1, limit / lengths)


@HUBER.wrong("A length of 0 gives inf or NaN in yours. A corner without any error has the weight 1.")
def without_the_first_line(lengths, limit):
    with np.errstate(divide="ignore"):
        return np.where(lengths == 0, np.inf, np.minimum(1, limit / np.maximum(lengths, 1e-300)))


@HUBER.wrong("Your weight exceeds 1 within the limit. There it is least squares: the weight is 1.")
def heavier_when_near(lengths, limit):
    return limit / np.maximum(lengths, 1e-9)


@HUBER.wrong("You give corners beyond the limit no weight. Huber's loss gives them c / r.")
def cut_off(lengths, limit):
    return np.where(lengths <= limit, 1.0, 0.0)


@HUBER.wrong("These are Cauchy's weights, which begin to fall at once. Huber's are 1 up to the limit.")
def of_cauchy(lengths, limit):
    return 1 / (1 + (lengths / limit) ** 2)


@HUBER.wrong("This is the loss. The weight is the force divided by the length.")
def the_loss(lengths, limit):
    return np.where(lengths <= limit, lengths**2, 2 * limit * lengths - limit**2)


# 5: triage -----------------------------------------------------------------------------------------------------------


def triage(residuals: Array) -> int:
    """What is wrong with views (views, rows, columns, 2): 0 nothing, 1 a corner, 2 a line of corners, 3 a whole view.

    A corner is off beyond 6 σ, σ being robust; a line or a view when at least half of its corners are.
    """
    return _largest(np.linalg.norm(residuals, axis=-1) > 6 * robust_sigma(residuals))


def _largest(off, share=0.5):
    """The largest thing of which a mask of corners (views, rows, columns) has the share."""
    if (off.mean(axis=(1, 2)) >= share).any():
        return 3
    if (off.mean(axis=1) >= share).any() or (off.mean(axis=2) >= share).any():
        return 2
    return int(off.any())


def _triage_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Nothing, corners, lines and views, on either side of each limit: 6 σ, and half of what there is."""
    rows, columns = 6, 10
    half = np.arange(rows * columns) % 2 == 0
    marks: tuple[Any, ...] = (
        (slice(0),),
        (3, 2, 4),
        (1, 2, slice(None)),
        (2, slice(None), 7),
        (5,),
        (4, 3, slice(1, 8)),  # most of a row, half of one, and one corner fewer
        (4, 3, slice(0, 5)),
        (7, 1, slice(3, 7)),
        (6, slice(2, 6), 3),  # most of a column, half of one, and one corner fewer
        (6, slice(1, 4), 3),
        (3, slice(4, 6), 5),
        (0, slice(None), slice(2, 9)),  # most of a view
        (0, rng.permutation(half).reshape(rows, columns)),  # half of a view
        (1, (np.arange(columns) + np.arange(rows)[:, None]) % 3 == 0),  # a third of a view, and of its lines
        (2, *np.divmod(rng.permutation(rows * columns)[: rows * columns // 2 - 1], columns)),
        (slice(None), 2, slice(None)),
        (slice(0, 7), 5, 9),  # the last corner of all views but one
    )
    for mark in (marks[i] for i in rng.permutation(len(marks))):
        off, near = np.zeros((2, 8, rows, columns), dtype=bool)
        near[5:7, 4] = True  # two rows of corners that are far, and not off
        off[mark] = True
        yield (_at_a_limit(rng, off, near & ~off, rng.choice([1.003, rng.uniform(2, 40)])),)
    whole = np.arange(8)[:, None, None] == np.full((rows, columns), rng.integers(8))
    yield (_at_a_limit(rng, whole, whole & False, float(rng.uniform(5, 40))),)  # a view that is wildly off
    for times in (0.53, 0.7, 0.84, 0.92, 1.1, 1.28, 1.55, 1.87):  # of 6 σ: a corner between every two usual limits
        off = np.arange(8 * rows * columns).reshape(8, rows, columns) == rng.integers(8 * rows * columns)
        yield (_at_a_limit(rng, off, off & False, times, aslant=0.25),)


def _at_a_limit(
    rng: np.random.Generator, off: NDArray[np.bool_], near: NDArray[np.bool_], times: float, aslant: float = 0.0
) -> Array:
    """Residuals of which those that are `off` are about `times` 6 σ long, and those that are `near` almost 6 σ.

    σ is robust: the lengths above the median may be any, as long as they stay above it.
    """
    residuals = rng.normal(0, 1, (*off.shape, 2)) * np.exp(rng.uniform(-3, 1))
    lengths = np.clip(np.linalg.norm(residuals, axis=-1), 0, 3.1 * np.std(residuals))
    lengths[off | near] = np.inf
    limit = 6 * np.median(lengths) / RAYLEIGH
    lengths[near] = limit * rng.uniform(0.996, 0.999, near.sum())
    lengths[off] = limit * times * rng.uniform(0.998, 1.002, off.sum())
    around = rng.uniform(0, 2 * np.pi, off.shape)
    direction = np.pi * (aslant + rng.choice([0, 0.5, 1, 1.5]))  # along x or y, either way
    around[off | near] = direction + rng.normal(0, 0.1)
    return np.asarray(lengths[..., None] * np.stack([np.cos(around), np.sin(around)], axis=-1))


TRIAGE = Exercise(
    name="16.triage",
    reference=triage,
    cases=_triage_cases,
    hints=(
        "First decide which corners are off: a mask (views, rows, columns). Then ask for the largest thing first: a "
        "view, a line, a corner.",
        "The mean of a mask is a share. Over both axes of the board it is the share of bad corners in a view; over the "
        "rows (axis 1) that in each column, over the columns (axis 2) that in each row.",
        "`off = lengths > ___ * np.median(lengths) / np.sqrt(2 * np.log(2))`",
    ),
    praise="That is the first thing the clinic does with every set of corners.",
)


@TRIAGE.right
def with_the_rounded_factor_of_the_lesson(residuals):
    lengths = np.linalg.norm(residuals, axis=-1)
    off = 1.177 * lengths > 6 * np.median(lengths)
    if any(np.mean(view) >= 0.5 for view in off):
        return np.int64(3)
    lines = max(off.mean(axis=1).max(), off.mean(axis=2).max())
    return np.int64(2) if lines >= 0.5 else np.int64(off.max())


@TRIAGE.wrong("You compare with multiples of the *median length*, which is longer than σ: divide by √(2 ln 2).")
def rayleigh_s_factor_forgotten(residuals):
    return _largest(np.linalg.norm(residuals, axis=-1) > 6 * RAYLEIGH * robust_sigma(residuals))


@TRIAGE.wrong("You ask for *more* than half of a line or a view. Exactly half is enough: ≥, not >.")
def more_than_half(residuals):
    return _largest(np.linalg.norm(residuals, axis=-1) > 6 * robust_sigma(residuals), share=0.5 + 1e-9)


@TRIAGE.wrong("Your σ is the standard deviation. A bad view makes it so large that nothing is beyond 6 σ.")
def by_standard_deviation(residuals):
    return _largest(np.linalg.norm(residuals, axis=-1) > 6 * np.std(residuals))


@TRIAGE.wrong("You call a bad view a bad line. All its lines are bad: ask for the view first.")
def lines_before_views(residuals):
    return min(triage(residuals), 2)


@TRIAGE.wrong("You find views, rows and corners. A bad *column* counts as single corners in yours.")
def without_columns(residuals):
    off = np.linalg.norm(residuals, axis=-1) > 6 * robust_sigma(residuals)
    if (off.mean(axis=(1, 2)) >= 0.5).any():
        return 3
    return 2 if (off.mean(axis=2) >= 0.5).any() else int(off.any())


@TRIAGE.wrong("You tell healthy from sick. The number should say *what* is off.")
def healthy_or_not(residuals):
    return int(triage(residuals) > 0)


@TRIAGE.wrong("You ask for half of *all* views. One view is enough, and one line of one view.")
def shares_over_all_views(residuals):
    off = np.linalg.norm(residuals, axis=-1) > 6 * robust_sigma(residuals)
    return _largest(off.mean(axis=0, keepdims=True)) if off.any() else 0


# 6: the next best view ------------------------------------------------------------------------------------------------


def next_view(known: Array, candidates: Array, parameter: int) -> int:
    """The number of the candidate (m, k, k) that leaves the smallest variance of a parameter, beside `known` (k, k)."""
    return int(np.argmin(np.linalg.inv(known + candidates)[:, parameter, parameter]))


def _information(rng: np.random.Generator, k: int, rows: int) -> Array:
    J = rng.normal(0, 1, (rows, k)) * 10 ** rng.uniform(-0.5, 0.5, k)
    J[:, 1] += 2 * J[:, 0]  # parameters that trade with each other
    return J.T @ J


def _view_choices(rng: np.random.Generator) -> Iterator[Arguments]:
    """Among which the usual mistakes choose another view: it is the best of none of them but by chance."""
    others = (without_the_known, trace_for_one, most_information, by_determinant, least_of_all, all_variances)
    for k, m in ((3, 5), (4, 6), (6, 9)):
        for parameter in (0, 1, k - 1):
            for _ in range(40):
                known = _information(rng, k, k + 4)
                candidates = np.array([_information(rng, k, k + 1) for _ in range(m)])
                answers = [one(known, candidates, parameter) for one in others]
                if next_view(known, candidates, parameter) not in answers and answers[3] != answers[5]:
                    break
            yield known, candidates, parameter
    yield from _choices_by_signs(rng)


def _choices_by_signs(rng: np.random.Generator) -> Iterator[Arguments]:
    """Among which one chooses another view who drops the signs of what the views say together, or of either part."""
    signs = (
        lambda known, candidates: np.abs(known + candidates),
        lambda known, candidates: np.maximum(known + candidates, 0),
        lambda known, candidates: np.maximum(known, 0) + candidates,
        lambda known, candidates: known + np.maximum(candidates, 0),
    )
    for dropped in signs:
        right = wrong = 0
        while right == wrong:
            known, candidates = _information(rng, 4, 5), np.array([_information(rng, 4, 5) for _ in range(6)])
            right = next_view(known, candidates, 1)
            wrong = np.argmin(np.linalg.inv(dropped(known, candidates))[:, 1, 1])
        yield known, candidates, 1


NEXT = Exercise(
    name="16.next_view",
    reference=next_view,
    cases=_view_choices,
    hints=(
        "Information adds up: with the first candidate there is `known + candidates[0]`.",
        "Invert each sum, and look at one number on the diagonal of each inverse. `np.linalg.inv` takes a stack of "
        "matrices (m, k, k), too.",
        "`return np.argmin(np.linalg.inv(___)[:, parameter, parameter])`",
    ),
    praise="A picture can be judged before it is taken: its information needs a pose, and no corners.",
)


@NEXT.right
def by_cholesky(known, candidates, parameter):
    roots = np.linalg.inv(np.linalg.cholesky(known + candidates))
    return np.argmin(np.sum(roots[:, :, parameter] ** 2, axis=1))


@NEXT.wrong("You judge the candidates by themselves. Add `known` to each, and then invert.")
def without_the_known(known, candidates, parameter):
    return np.argmin(np.linalg.inv(candidates)[:, parameter, parameter])


@NEXT.wrong("You choose the view with the most information of all. Ask for the variance of the one parameter.")
def trace_for_one(known, candidates, parameter):
    return np.argmax([np.trace(one) for one in candidates])


@NEXT.wrong("You read the diagonal of the information. The other parameters are unknown too: invert the whole matrix.")
def most_information(known, candidates, parameter):
    return np.argmax(candidates[:, parameter, parameter])


@NEXT.wrong("This makes the volume of all error bars smallest. The task asks for one parameter.")
def by_determinant(known, candidates, parameter):
    return np.argmax(np.linalg.det(known + candidates))


@NEXT.wrong("This is the view after which the variance is *largest*.")
def least_of_all(known, candidates, parameter):
    return np.argmax(np.linalg.inv(known + candidates)[:, parameter, parameter])


@NEXT.wrong("You add up the variances of all parameters. The task asks for one of them.")
def all_variances(known, candidates, parameter):
    return np.argmin([np.trace(np.linalg.inv(known + one)) for one in candidates])


# 7: what a turn explains ---------------------------------------------------------------------------------------------


def implied_rotation(rays_first: Array, rays_second: Array) -> Array:
    """The R (3, 3) for which R rays_first is closest to rays_second, both (n, 3): Kabsch (1976)."""
    U, _, Vt = np.linalg.svd(rays_second.T @ rays_first)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


def _rotation_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (4, 12, 60):
        rays = np.concatenate([rng.uniform(-0.7, 0.7, (n, 2)), np.ones((n, 1))], axis=1)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        turn = Rotation.from_rotvec(rng.uniform(0.1, 0.3, 3) * rng.choice([-1, 1], 3))
        other = turn.apply(rays) + rng.normal(0, 0.002, (n, 3))
        yield rays, other / np.linalg.norm(other, axis=1, keepdims=True)
    yield _two_mirrors(rng)
    angle, tilt = np.linspace(-1, 1, 7), 0.01 * np.array([1, -1, 1, -1, 1, -1, 1])
    flat = np.stack([np.sin(angle), tilt, np.cos(angle)], axis=-1)  # almost one plane, where noise may ask for a mirror
    yield flat, Rotation.from_rotvec([0.1, -0.2, rng.uniform(0.2, 0.5)]).apply(flat * [1, -1, 1])


def _two_mirrors(rng: np.random.Generator) -> Arguments:
    """Rays and the same turned, of whose decomposition U and Vᵀ are both mirrors: together they are a rotation."""
    for _ in range(300):  # one in ten is such a pair
        rays = np.array([[x, y, 1] for x in (-1, 1) for y in (-1, 1)]) * [
            rng.uniform(0.1, 0.3),
            rng.uniform(0.4, 0.6),
            1,
        ]
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        turned = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3)).apply(rays)
        if np.linalg.det(np.linalg.svd(turned.T @ rays)[0]) < 0:
            break
    return rays, turned


ROTATION = Exercise(
    name="16.implied_rotation",
    reference=implied_rotation,
    cases=_rotation_cases,
    any_numbers=False,
    tolerance=1e-7,
    hints=(
        "The sum of the products, `rays_second.T @ rays_first`, is a 3 × 3 matrix. The rotation closest to it is the "
        "answer.",
        "A singular value decomposition, `np.linalg.svd`, takes that matrix apart into a rotation, a stretch and a "
        "rotation; leave the stretch out. Where what is left has determinant −1 it is a mirror: turn the last axis "
        "round.",
        "`return U @ np.diag([1, 1, ___]) @ Vt`",
    ),
    praise="What is left after this rotation is what two calibrations really disagree about.",
)


@ROTATION.right
def by_scipy(rays_first, rays_second):
    return Rotation.align_vectors(rays_second, rays_first)[0].as_matrix()


@ROTATION.wrong("This is right for most rays. Rays in one plane may give you a *mirror*, det R = −1.")
def perhaps_a_mirror(rays_first, rays_second):
    U, _, Vt = np.linalg.svd(rays_second.T @ rays_first)
    return U @ Vt


@ROTATION.wrong("Where det R is −1 you change the sign of all of R. Change only the last singular vector's sign.")
def all_signs_changed(rays_first, rays_second):
    R = perhaps_a_mirror(rays_first, rays_second)
    return R if np.linalg.det(R) > 0 else -R


@ROTATION.wrong("This is the best 3 × 3 matrix, not a rotation: it may stretch, and a turned camera cannot.")
def least_squares(rays_first, rays_second):
    return np.linalg.lstsq(rays_first, rays_second, rcond=None)[0].T


@ROTATION.wrong("You subtract the mean ray first, as for clouds of points. Rays begin in the camera: subtract nothing.")
def centred(rays_first, rays_second):
    return implied_rotation(rays_first - rays_first.mean(axis=0), rays_second - rays_second.mean(axis=0))


@ROTATION.wrong("Your answer still stretches: leave the singular values out. U and Vᵀ alone are the rotation.")
def stretch_kept(rays_first, rays_second):
    return rays_second.T @ rays_first / len(rays_first)


@ROTATION.wrong("This is the identity. It is right only if both cameras look the same way.")
def no_turn(rays_first, rays_second):
    return np.eye(3)


# 8: the delay of a row ------------------------------------------------------------------------------------------------


def line_delay(e: Array, J: Array, q: Array) -> float:
    """The d of e = J x + d q by least squares, with x free; e and q are (n,), J (n, k)."""
    return float(np.linalg.lstsq(np.column_stack([J, q]), e)[0][-1])


def _delay_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """A delay of either sign, a part of which the poses hide; e has noise, so no few rows give it."""
    for n, k, sign in ((40, 3, 1), (60, 6, -1), (120, 14, 1), (30, 1, -1)):
        J = rng.normal(0, 1, (n, k)) * 10 ** rng.uniform(-0.5, 2, k)
        hidden = J @ rng.normal(0, 1, k)
        q = 0.02 * (rng.normal(0, 1, n) + hidden / np.std(hidden))
        yield J @ rng.normal(0, 0.3, k) + sign * rng.uniform(10, 100) * q + rng.normal(0, 0.2, n), J, q


DELAY = Exercise(
    name="16.line_delay",
    reference=line_delay,
    cases=_delay_cases,
    hints=(
        "Write e = J x + d q as one product: a matrix times the unknowns. The unknowns are x, and d below it.",
        "The matrix is J with one more column. `np.column_stack([A, b])` puts b beside A, and "
        "`np.linalg.lstsq(A, e)[0]` solves by least squares.",
        "`return np.linalg.lstsq(np.column_stack([___, ___]), e)[0][___]`",
    ),
    praise="One more column, and the poses no longer hide the delay.",
    tolerance=1e-6,
)


@DELAY.right
def what_is_left_of_q(e, J, q):
    free = q - J @ np.linalg.lstsq(J, q)[0]  # Frisch and Waugh (1933)
    return free @ e / (free @ free)


@DELAY.right
def by_normal_equations(e, J, q):
    scale = np.linalg.norm(q)
    A = np.column_stack([q / scale, J])
    return np.linalg.solve(A.T @ A, A.T @ e)[0] / scale


@DELAY.wrong("This is the slope of e over q alone. The poses hide most of the delay: give them J's columns too.")
def slope_alone(e, J, q):
    return q @ e / (q @ q)


@DELAY.wrong("You remove J's part from e, but not from q. Remove it from both.")
def only_e_freed(e, J, q):
    return q @ (e - J @ np.linalg.lstsq(J, e)[0]) / (q @ q)


@DELAY.wrong("You fit q from e. The noise is in e: find d in e = J x + d q.")
def the_other_way(e, J, q):
    return np.linalg.lstsq(np.column_stack([J, e]), q)[0][-1]


# 9: islands ----------------------------------------------------------------------------------------------------------


def islands(seen: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The number (n,) of the first camera to which each is tied, by which of n cameras sees the board in m frames."""
    first = np.arange(len(seen))
    for frame in seen.T:
        first[np.isin(first, first[frame])] = min(first[frame], default=0)
    return first


def _rig_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    """Rigs whose ties run over cameras in between, in any order, with cameras alone and frames that nobody sees."""
    yield (_tied([(0, 3), (3, 1), (1, 2)], 4),)  # a chain whose middle is not in order
    yield (_tied([(2, 4), (1, 3), (3, 4)], 6),)  # 0 and 5 alone
    yield (_tied([(0, 1), (2, 3), (0, 2), (4, 5)], 6),)  # two pairs become one island by a later frame
    yield (np.eye(4, dtype=bool),)  # each by itself
    for n in (5, 7, 9):
        order = rng.permutation(n)
        split = int(rng.integers(2, n - 2))
        chains = [*pairwise(order[:split]), *pairwise(order[split:-1])]  # the last one stays alone
        rng.shuffle(chains)
        yield (_tied([(int(a), int(b)) for a, b in chains], n),)
    yield (_tied([(1, 2, 4)], 5),)  # three cameras see one frame
    n = int(rng.integers(20, 30))
    chain = list(pairwise(range(n)))
    yield (_tied(chain[::-1], n),)  # each pass over these frames brings a number one camera farther
    yield (_tied([chain[i] for i in rng.permutation(n - 1)], n),)


def _tied(frames: list[tuple[int, ...]], cameras: int) -> NDArray[np.bool_]:
    """(cameras, frames + 2): who sees which frame; then one that nobody sees, and one that only the last one sees."""
    seen = np.zeros((cameras, len(frames) + 2), dtype=bool)
    for frame, names in enumerate(frames):
        seen[list(names), frame] = True
    seen[-1, -1] = True
    return seen


ISLANDS = Exercise(
    name="16.islands",
    reference=islands,
    cases=_rig_cases,
    hints=(
        "Begin with n islands: each camera is the first of its own. A frame joins the islands of all who see it.",
        "Keep an array `first`, at the start each camera's own number. For a `frame` of `seen.T`, `first[frame]` are "
        "the islands that it joins. "
        "*Every* camera of these islands gets the smallest of their numbers, whether it sees this frame or not.",
        "`first[np.isin(first, first[frame])] = ___`, if `frame.any()`",
    ),
    praise="Cameras of different islands have no pose to each other, however good each calibration is.",
)


@ISLANDS.right
def by_scipy_s_components(seen):
    from scipy.sparse.csgraph import connected_components

    label = connected_components(seen.astype(int) @ seen.T > 0)[1]
    return [int(np.flatnonzero(label == one)[0]) for one in label]


@ISLANDS.wrong("You look at pairs. Two cameras that share no frame may still be tied by a chain of others.")
def pairs_alone(seen):
    tied = seen.astype(int) @ seen.T + np.eye(len(seen), dtype=int) > 0
    return np.argmax(tied, axis=1)


@ISLANDS.wrong("A frame joins whole islands. You change only those who see it, not the rest of their islands.")
def only_who_sees_it(seen):
    first = np.arange(len(seen))
    for frame in seen.T:
        first[frame] = min(first[frame], default=0)
    return first


@ISLANDS.wrong("You number the islands one after another. Give each camera the number of its island's first camera.")
def islands_counted(seen):
    return np.unique(islands(seen), return_inverse=True)[1]


@ISLANDS.wrong("A camera that shares no frame is an island by itself: its number is its own.")
def alone_is_minus_one(seen):
    first = islands(seen)
    return np.where(np.sum(first[:, None] == first, axis=1) == 1, -1, first)


# 10: other numbers, the same pictures ---------------------------------------------------------------------------------


def same_pictures(R: Array, t: Array, Q: Array, d: Array, s: float) -> tuple[Array, Array]:
    """The pose (R, t) that sees s Q X + d in the pixel where the given pose sees X, s times as far away."""
    return R @ Q.T, s * t - R @ Q.T @ d


def _gauge_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for turns, shift, factor in ((1, 1, 1), (1, 0, 0), (0, 1, 0), (0, 0, 1)):
        R, Q = (Rotation.from_rotvec(rng.uniform(0.2, 1, 3) * rng.choice([-1, 1], 3)) for _ in range(2))
        Q = Q if turns else Rotation.identity()
        d, s = shift * rng.uniform(0.5, 2, 3) * rng.choice([-1, 1], 3), float(rng.uniform(1.5, 3)) if factor else 1.0
        yield R.as_matrix(), rng.uniform(-2, 2, 3), Q.as_matrix(), d, s
    yield (
        R.as_matrix(),
        rng.uniform(-2, 2, 3),
        Rotation.from_rotvec([0.9, -0.4, 0.3]).as_matrix(),
        np.array([-1.0, 0.7, -0.4]),
        0.4,
    )


GAUGE = Exercise(
    name="16.same_pictures",
    reference=same_pictures,
    cases=_gauge_cases,
    hints=(
        "Solve X′ = s Q X + d for X. The inverse of a rotation is its transpose.",
        "Put that X into R X + t, and multiply by s: a pixel does not tell how far away a point is. What stands before "
        "X′, and what stands alone?",
        "`return R @ Q.T, s * t - ___`",
    ),
    praise="No picture tells the two worlds apart. Whoever wants numbers has to fix seven of them.",
)


@GAUGE.right
def by_the_camera_s_centre(R, t, Q, d, s):
    centre = s * Q @ (-R.T @ t) + d
    turned = R @ Q.T
    return turned, -turned @ centre


@GAUGE.wrong("The world is turned, so the camera has to undo it: Qᵀ stands behind R, not Q.")
def q_for_its_transpose(R, t, Q, d, s):
    return R @ Q, s * t - R @ Q @ d


@GAUGE.wrong("Qᵀ stands on the wrong side of R. First undo Q, then apply R.")
def on_the_other_side(R, t, Q, d, s):
    return Q.T @ R, s * t - Q.T @ R @ d


@GAUGE.wrong("The shift d is in the changed world. Turn it by your new rotation before you subtract it.")
def shift_not_turned(R, t, Q, d, s):
    return R @ Q.T, s * t - d


@GAUGE.wrong("A world that is s times as large is s times as far away: t has to grow with it.")
def scale_forgotten(R, t, Q, d, s):
    return R @ Q.T, t - R @ Q.T @ d


@GAUGE.wrong("You multiply the shift d by s as well. The world is scaled first, and moved then.")
def shift_scaled(R, t, Q, d, s):
    return R @ Q.T, s * (t - R @ Q.T @ d)


EXERCISES = (VIEW_RMS, LINES, ROBUST_SIGMA, HUBER, TRIAGE, NEXT, ROTATION, DELAY, ISLANDS, GAUGE)
