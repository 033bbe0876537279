"""Lesson 16, the clinic: statistics of residuals, lines of a board, what a rotation explains, and a first diagnosis.

Residuals are observed less projected, in pixels, (views, corners, 2) or (rows, columns, 2), NaN where nothing was seen.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from camviz.checks import Arguments, Array, Exercise
from camviz.poses import Rotation

RAYLEIGH = np.sqrt(2 * np.log(2))  # the median length of a residual over the σ of its coordinates


def view_rms(residuals: Array) -> Array:
    """The RMS length (views,) of each view's residuals (views, corners, 2), over the corners that were seen."""
    squares = np.sum(residuals**2, axis=-1)
    return np.sqrt(np.nanmean(squares, axis=-1))


def robust_sigma(residuals: Array) -> float:
    """σ of one coordinate of residuals (..., 2): the median of their lengths over √(2 ln 2) (Rayleigh)."""
    return float(np.nanmedian(np.linalg.norm(residuals, axis=-1)) / RAYLEIGH)


def line_lengths(residuals: Array, rows: int, columns: int) -> tuple[Array, Array]:
    """The median length of the residuals (rows * columns, 2) in every row (rows,) and every column (columns,)."""
    lengths = np.linalg.norm(residuals, axis=-1).reshape(rows, columns)
    return np.median(lengths, axis=1), np.median(lengths, axis=0)


def implied_rotation(rays_first: Array, rays_second: Array) -> Array:
    """The R (3, 3) for which R rays_first is closest to rays_second, both (n, 3): Kabsch (1976)."""
    U, _, Vt = np.linalg.svd(rays_second.T @ rays_first)
    return U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt


def triage(residuals: Array) -> int:
    """What is wrong with views (views, rows, columns, 2): 0 nothing, 1 a corner, 2 a line of corners, 3 a whole view.

    A corner is off beyond 6 σ, σ being robust; a line or a view when at least half of its corners are.
    """
    off = np.linalg.norm(residuals, axis=-1) > 6 * robust_sigma(residuals)
    if (off.mean(axis=(1, 2)) >= 0.5).any():
        return 3
    if (off.mean(axis=1) >= 0.5).any() or (off.mean(axis=2) >= 0.5).any():
        return 2
    return int(off.any())


def _residuals(rng: np.random.Generator, *shape: int) -> Array:
    return rng.normal(0, rng.uniform(0.1, 0.4), (*shape, 2))


def _unseen(rng: np.random.Generator, residuals: Array) -> Array:
    residuals[rng.uniform(size=residuals.shape[:-1]) < 0.15] = np.nan
    return residuals


def _view_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield (_residuals(rng, 5, 24),)
    yield (_residuals(rng, 1, 54),)
    yield (_unseen(rng, _residuals(rng, 7, 30)),)


def _sigma_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    yield (_residuals(rng, 60),)
    for shape in ((8, 54), (3, 6, 9)):
        wild = _unseen(rng, _residuals(rng, *shape))
        wild[0] += rng.uniform(5, 30, 2)
        yield (wild,)


def _line_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for rows, columns in ((6, 9), (5, 8), (4, 4)):
        grid = _residuals(rng, rows, columns)
        grid[:, rng.integers(columns)] += rng.uniform(3, 8, 2)
        yield (grid.reshape(-1, 2), rows, columns)


def _rotation_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for n in (3, 12, 60):
        rays = np.concatenate([rng.uniform(-0.7, 0.7, (n, 2)), np.ones((n, 1))], axis=1)
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        other = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3)).apply(rays) + rng.normal(0, 0.002, (n, 3))
        yield rays, other / np.linalg.norm(other, axis=1, keepdims=True)
    angle, tilt = np.linspace(-1, 1, 7), 0.01 * np.array([1, -1, 1, -1, 1, -1, 1])
    flat = np.stack([np.sin(angle), tilt, np.cos(angle)], axis=-1)  # almost one plane, where noise may ask for a mirror
    yield flat, Rotation.from_rotvec([0.1, -0.2, rng.uniform(0.2, 0.5)]).apply(flat * [1, -1, 1])


def _triage_cases(rng: np.random.Generator) -> Iterator[Arguments]:
    for kind in (0, 1, 2, 3, 4, *rng.integers(0, 5, 4)):
        residuals = np.clip(rng.normal(0, 1, (8, 6, 9, 2)), -3, 3) * rng.uniform(0.1, 0.4)
        push = rng.uniform(15, 40) * np.array([np.cos(a := rng.uniform(0, 6.3)), np.sin(a)])
        view, row, column = rng.integers(8), rng.integers(6), rng.integers(9)
        if kind == 1:
            residuals[view, row, column] += push
        elif kind == 2:
            residuals[view, row] += push
        elif kind == 3:
            residuals[view, :, column] += push
        elif kind == 4:
            residuals[view] += push
        yield (residuals,)


def _with_lines(residuals: Array, *, rows: bool = True, columns: bool = True) -> int:
    """Triage that looks at rows or columns alone."""
    off = np.linalg.norm(residuals, axis=-1) > 6 * robust_sigma(residuals)
    if (off.mean(axis=(1, 2)) >= 0.5).any():
        return 3
    if (columns and (off.mean(axis=1) >= 0.5).any()) or (rows and (off.mean(axis=2) >= 0.5).any()):
        return 2
    return int(off.any())


def _by_standard_deviation(residuals: Array) -> int:
    off = np.linalg.norm(residuals, axis=-1) > 6 * residuals.std()
    if (off.mean(axis=(1, 2)) >= 0.5).any():
        return 3
    return 2 if (off.mean(axis=1) >= 0.5).any() or (off.mean(axis=2) >= 0.5).any() else int(off.any())


def _transposed_grid(residuals: Array, rows: int, columns: int) -> tuple[Array, Array]:
    lengths = np.linalg.norm(residuals, axis=-1).reshape(columns, rows)
    return np.median(lengths, axis=0), np.median(lengths, axis=1)


def _maybe_a_mirror(rays_first: Array, rays_second: Array) -> Array:
    U, _, Vt = np.linalg.svd(rays_second.T @ rays_first)
    return U @ Vt


VIEW_RMS = Exercise(
    name="16.view_rms",
    reference=view_rms,
    cases=_view_cases,
    hints=(
        "The length of a residual comes first: both coordinates of one corner are *one* residual.",
        "`squares = np.sum(residuals**2, axis=-1)` are the squared lengths (views, corners). Take the mean over a "
        "view's corners without those that are NaN, then the root.",
    ),
    praise="These are the bars of the clinic, and what OpenCV calls perViewErrors.",
)


@VIEW_RMS.wrong("This is the RMS of one *coordinate*: too small by √2. OpenCV, like its users, counts a corner once.")
def _(residuals):
    return np.sqrt(np.nanmean(residuals**2, axis=(-1, -2)))


@VIEW_RMS.wrong(
    "This is the mean length. RMS squares first, then takes the mean, then the root: large errors weigh more."
)
def _(residuals):
    return np.nanmean(np.linalg.norm(residuals, axis=-1), axis=-1)


@VIEW_RMS.wrong(
    "It is right where every corner was seen. A corner that was not is NaN, and takes the whole mean with it."
)
def _(residuals):
    return np.sqrt(np.mean(np.sum(residuals**2, axis=-1), axis=-1))


@VIEW_RMS.wrong(
    "It is right where every corner was seen. Divide by the number of corners that *were*, not by all of them."
)
def _(residuals):
    return np.sqrt(np.nansum(residuals**2, axis=(-1, -2)) / residuals.shape[-2])


@VIEW_RMS.wrong("The mean of the squares still wants its root.")
def _(residuals):
    return np.nanmean(np.sum(residuals**2, axis=-1), axis=-1)


ROBUST_SIGMA = Exercise(
    name="16.robust_sigma",
    reference=robust_sigma,
    cases=_sigma_cases,
    hints=(
        "Half of all corners decide a median: up to half of them may be as wild as they like.",
        "For Gaussian noise of σ in each coordinate the median *length* is σ √(2 ln 2) = 1.177 σ. Solve for σ; "
        "`np.nanmedian` passes over corners that were not seen.",
    ),
    praise="A view that is thirty pixels off no longer moves your idea of what is normal.",
)


@ROBUST_SIGMA.wrong("This is the ordinary standard deviation: the wild view, which you want to find, has moved it.")
def _(residuals):
    return np.nanstd(residuals)


@ROBUST_SIGMA.wrong("This is the median length. It is 1.177 σ, not σ: divide by √(2 ln 2).")
def _(residuals):
    return np.nanmedian(np.linalg.norm(residuals, axis=-1))


@ROBUST_SIGMA.wrong("A good robust σ, of single *coordinates*. Here it is asked from the median of the lengths.")
def _(residuals):
    return 1.4826 * np.nanmedian(np.abs(residuals))


@ROBUST_SIGMA.wrong(
    "The factor 1.4826 belongs to the absolute value of one number. A length in the plane has √(2 ln 2)."
)
def _(residuals):
    return 1.4826 * np.nanmedian(np.linalg.norm(residuals, axis=-1))


@ROBUST_SIGMA.wrong(
    "It is right where every corner was seen; elsewhere NaN gets into the median. There is `np.nanmedian`."
)
def _(residuals):
    return np.median(np.linalg.norm(residuals, axis=-1)) / RAYLEIGH


LINES = Exercise(
    name="16.line_lengths",
    reference=line_lengths,
    cases=_line_cases,
    bug=True,
    hints=(
        "Corners come row by row, the columns fastest. What shape has the array of lengths, then?",
        "`reshape(rows, columns)`; a row's median runs over its columns, that is along axis 1.",
    ),
    praise="Now a bad column is a bad column. With a board of 9 × 6 the wrong reshape raises no error at all.",
)

LINES.wrong(
    "The corners are taken apart in the wrong order: they come row by row, so the grid is (rows, columns). "
    "A bad column is smeared over all lines, and on a square board nobody would notice."
)(_transposed_grid)


@LINES.wrong("The grid is right now. But the median of a *row* runs along axis 1, over its columns.")
def _(residuals, rows, columns):
    return line_lengths(residuals, rows, columns)[::-1]


ROTATION = Exercise(
    name="16.implied_rotation",
    reference=implied_rotation,
    cases=_rotation_cases,
    tolerance=1e-7,
    hints=(
        "The sum of the products, `rays_second.T @ rays_first`, is a 3 × 3 matrix; its SVD has the rotation in it.",
        "With `U, s, Vt = np.linalg.svd(rays_second.T @ rays_first)` it is U diag(1, 1, d) Vᵀ, where d = det(U Vᵀ) is "
        "1 or −1, so that the result is no mirror.",
    ),
    praise="What is left after this rotation is what two calibrations really disagree about.",
)


@ROTATION.wrong("This is the rotation from the second to the first: the other way round.")
def _(first, second):
    return implied_rotation(first, second).T


ROTATION.wrong("For rays in all directions this is right. Rays in one plane may give you a *mirror*, det R = −1.")(
    _maybe_a_mirror
)


@ROTATION.wrong("This is the best 3 × 3 matrix, and no rotation: it may stretch, which a camera cannot when it turns.")
def _(first, second):
    return np.linalg.lstsq(first, second, rcond=None)[0].T


TRIAGE = Exercise(
    name="16.triage",
    reference=triage,
    cases=_triage_cases,
    hints=(
        "First which corners are off: a mask (views, rows, columns). Then ask the largest thing first: a view, a line, "
        "a corner.",
        "`off = np.linalg.norm(residuals, axis=-1) > 6 * sigma` with the robust σ of exercise 2. The share of bad "
        "corners in a view is `off.mean(axis=(1, 2))`, in columns `off.mean(axis=1)`, in rows `off.mean(axis=2)`.",
    ),
    praise="That is the first thing the clinic does with every set of corners.",
)


@TRIAGE.wrong("Columns, corners and views are found; a bad *row* goes as single corners.")
def _(residuals):
    return _with_lines(residuals, rows=False)


@TRIAGE.wrong("Rows, corners and views are found; a bad *column* goes as single corners.")
def _(residuals):
    return _with_lines(residuals, columns=False)


TRIAGE.wrong("Your σ is the ordinary standard deviation. A bad view makes it so large that nothing is beyond 6 σ.")(
    _by_standard_deviation
)


@TRIAGE.wrong("A bad view is called a bad line. It has bad lines, all of them: ask for the view first.")
def _(residuals):
    return min(triage(residuals), 2)


@TRIAGE.wrong("Healthy or not is told right. The number should say *what* is off.")
def _(residuals):
    return int(triage(residuals) > 0)


EXERCISES = (VIEW_RMS, ROBUST_SIGMA, LINES, ROTATION, TRIAGE)
