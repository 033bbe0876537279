"""Every exercise refuses its own solution with one small change, unless the change makes no difference.

A mutant is what a slip of the pen or of the mind makes of the code: another operator, comparison, constant, function,
axis, sign or argument, or a term less. A mutant that is accepted has to agree with the reference on fresh arguments.
"""

import ast
import itertools
from copy import deepcopy

import numpy as np
import pytest
from test_exercises import EACH, function_of, solution_of

from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
from camviz_school.course.trials import quiet

SEED = 7
FRESH_DRAWS = 200
ACCEPTED_AT = range(5)
"""Seeds: what one check lets pass by luck is refused by the next one."""

# Mutants --------------------------------------------------------------------------------------------------------------

OPERATORS = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Div,
    ast.Mod: ast.FloorDiv,
    ast.Pow: ast.Mult,
    ast.MatMult: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
COMPARISONS = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
}
PAIRS = """any all, max min, maximum minimum, sin cos, arctan arcsin, sum mean, nanmean nanmedian, var std, rint floor,
median mean, ceil floor, inv transpose, ones_like zeros_like, inf nan, pi e"""
FUNCTIONS = dict(pair.split() for pair in PAIRS.split(",")) | dict(pair.split()[::-1] for pair in PAIRS.split(","))


def mutants(code):
    """Yield the code of all mutants of a function, each once."""
    tree = ast.parse(code)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]
    parameters = [one.arg for one in next(n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)).args.args]
    seen = {ast.unparse(tree)}
    for owner, field, index, node in list(places(tree)):
        for other in changes(node, parameters):
            put(owner, field, index, other)
            source = ast.unparse(ast.fix_missing_locations(tree))
            put(owner, field, index, node)
            if source not in seen:
                seen.add(source)
                yield source


def places(tree):
    """Yield each expression and statement with its owner, its field and its index in the field's list."""
    for owner in ast.walk(tree):
        for field, value in ast.iter_fields(owner):
            if isinstance(value, ast.arguments):
                continue
            for index, node in enumerate(value) if isinstance(value, list) else [(None, value)]:
                if isinstance(node, ast.expr | ast.stmt) and isinstance(getattr(node, "ctx", ast.Load()), ast.Load):
                    yield owner, field, index, node


def put(owner, field, index, node):
    if index is None:
        setattr(owner, field, node)
    else:
        getattr(owner, field)[index] = node


def changes(node, parameters):
    """Yield what may stand in a node's place."""
    if isinstance(node, ast.If | ast.For):
        yield ast.Pass()
    elif isinstance(node, ast.AugAssign) and type(node.op) in OPERATORS:
        yield ast.AugAssign(node.target, OPERATORS[type(node.op)](), node.value)
    elif isinstance(node, ast.BinOp):
        if type(node.op) in OPERATORS:
            yield ast.BinOp(node.left, OPERATORS[type(node.op)](), node.right)
        yield from (node.left, node.right, ast.UnaryOp(ast.USub(), node))
        if not isinstance(node.op, ast.Add | ast.Mult):
            yield ast.BinOp(node.right, node.op, node.left)
    elif isinstance(node, ast.Compare):
        (operator, *_), (limit, *_) = node.ops, node.comparators
        yield from (ast.Compare(node.left, [other()], [limit]) for other in COMPARISONS.get(type(operator), ()))
        moved = [ast.BinOp(ast.Constant(factor), ast.Mult(), limit) for factor in (0.99, 1.01)]
        yield from (ast.Compare(node.left, [operator], [other]) for other in moved)
        yield ast.Constant(True)
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        others = (node.value + 1, node.value - 1, -node.value, 1.01 * node.value, node.value / 10)
        yield from (ast.Constant(other) for other in others)
    elif isinstance(node, ast.Attribute):
        if node.attr in FUNCTIONS:
            yield ast.Attribute(node.value, FUNCTIONS[node.attr], node.ctx)
        if node.attr == "T":
            yield node.value
    elif isinstance(node, ast.Call):
        yield from (one for one in node.args if not isinstance(one, ast.Starred))  # `np.abs(x)` becomes x
        yield from (ast.Call(node.func, node.args, [k for k in node.keywords if k is not one]) for one in node.keywords)
        if len(node.args) > 1:
            yield ast.Call(node.func, [node.args[1], node.args[0], *node.args[2:]], node.keywords)
    elif isinstance(node, ast.Name) and node.id in parameters:
        yield from (ast.Name(other, ast.Load()) for other in parameters if other != node.id)
        yield ast.Call(ast.Name("abs", ast.Load()), [node], [])


CODE = """
def f(x, k):
    r = np.sqrt(x**2 + k)
    return np.where(x > 0, np.sum(r, axis=-1), x.T @ k)
"""


def test_each_kind_of_slip_is_among_the_mutants():
    made = {line.strip() for source in mutants(CODE) for line in source.splitlines()}
    assert {
        "r = np.sqrt(x ** 2 - k)",
        "r = np.sqrt(x ** 2)",
        "r = np.sqrt(x ** 3 + k)",
        "r = np.sqrt(x ** 2 + x)",
        "r = x ** 2 + k",
        "r = np.sqrt(-(x ** 2 + k))",
        "return np.where(x >= 0, np.sum(r, axis=-1), x.T @ k)",
        "return np.where(x > 0, np.mean(r, axis=-1), x.T @ k)",
        "return np.where(x > 0, np.sum(r), x.T @ k)",
        "return np.where(x > 0, np.sum(r, axis=-1), x @ k)",
        "return np.where(x > 0, np.sum(r, axis=-1), k @ x.T)",
    } <= made


# The checker's word on them -------------------------------------------------------------------------------------------


def agrees(one, function, cases):
    """Whether a function answers as the reference does."""
    for case in cases:
        try:
            with quiet():
                answer = one.normalised(function(*deepcopy(case)))
        except Exception:  # a mutant may raise whatever it likes
            return False
        if not one.same(answer, one.answer(case)):
            return False
    return True


def accepted(one, function):
    """Whether the checker accepts a function at each seed; one answer that differs saves the whole check."""
    first = one.cases(np.random.default_rng(ACCEPTED_AT[0]))
    return agrees(one, function, first) and all(judge(one, function, np.random.default_rng(s)) for s in ACCEPTED_AT)


def fresh_draws(one):
    """Yield arguments that the checker does not draw; every second time their numbers are up to a third off, too."""
    rng = np.random.default_rng(SEED)
    endless = itertools.chain.from_iterable(one.cases(rng) for _ in itertools.count())
    for number, case in enumerate(itertools.islice(endless, FRESH_DRAWS)):
        yield tuple(stretched(value, rng) for value in case) if one.any_numbers and number % 2 else case


def stretched(value, rng):
    """Numbers times one factor. Matrices stay: most of them are no rotations, or no camera's, afterwards."""
    matrix = np.shape(value)[-2:] in ((3, 3), (3, 4), (4, 4))
    decimal = isinstance(value, float) or getattr(value, "dtype", None) == np.float64
    return value * rng.uniform(0.75, 1.33) if decimal and not matrix else value


@EACH
def test_a_mutant_is_refused_or_agrees_with_the_reference(one, thorough):
    every = list(mutants(solution_of(one)))
    budget = min(25 if thorough else 3, len(every))
    for number in np.random.default_rng(SEED).choice(len(every), budget, replace=False):
        function = function_of(one, every[number])
        assert not accepted(one, function) or agrees(one, function, fresh_draws(one)), every[number]


# Wrong answers that were accepted once --------------------------------------------------------------------------------


def islands_in_three_passes(seen):
    first = np.arange(len(seen))
    for _ in range(3):
        for frame in seen.T:
            if frame.any():
                first[frame] = first[frame].min()
    return first


def partners_tested_before_rounding(d_left, d_right, tolerance):
    u = np.arange(len(d_left)) - d_left
    inside = (u >= 0) & (u < len(d_left))
    back = d_right[np.where(inside, np.minimum(np.rint(u), len(d_left) - 1), 0).astype(int)]
    return np.where(inside & (np.abs(back - d_left) <= tolerance), d_left, np.nan)


def reference(name):
    return exercise(name).reference


def of_the_first(name, n):
    return lambda one, other: reference(name)(one[:n], other[:n])


def weak_pixels_dead(frame, dark, flat):
    weak = flat - dark <= 0.05 * np.mean(flat - dark)
    return np.where(weak, np.nan, reference("15.flat_field")(frame, dark, flat))


def no_far_limit_a_little_early(f, N, s, c):
    near, far = reference("02.limits")(f, N, s, c)
    return near, np.where(s < 0.95 * (f**2 / (N * c) + f), far, np.inf)


def full_frame_at_infinity(width, f, s):
    return np.where(np.isinf(s), 2 * np.arctan(18 / f), reference("02.field_of_view")(width, f, s))


def rotation_to_three_millionths(M):
    return np.allclose(M.T @ M, np.eye(3), rtol=0, atol=3e-6) and abs(np.linalg.det(M) - 1) < 3e-6


ONCE_ACCEPTED = [
    ("00.homogeneous", lambda x: np.concatenate([x[..., :3], np.ones_like(x[..., :1])], axis=-1)),
    ("02.limits", no_far_limit_a_little_early),
    ("02.field_of_view", full_frame_at_infinity),
    ("04.is_rotation", rotation_to_three_millionths),
    ("08.left_right", partners_tested_before_rounding),
    ("12.false_frequency", lambda f: np.min(np.abs(np.asarray(f)[..., None] - np.arange(-0.5, 3)), axis=-1)),
    ("15.flat_field", weak_pixels_dead),
    ("16.islands", islands_in_three_passes),
    ("19.draws", lambda w, n, sure: np.maximum(np.floor(np.log(1 - sure) / np.log1p(-(w**n))) + 1, 1)),
]
OF_THE_FIRST = [("07.eight_point", 8), ("18.camera_matrix", 6), ("19.homography", 4)]


@pytest.mark.parametrize(("name", "function"), ONCE_ACCEPTED)
def test_a_wrong_answer_accepted_once_stays_refused(name, function, thorough):
    for seed in range(200 if thorough else 5):
        assert not judge(exercise(name), function, np.random.default_rng(seed)), f"at seed {seed}"


@pytest.mark.parametrize(("name", "n"), OF_THE_FIRST)
def test_an_answer_from_the_first_matches_is_told_so(name, n):
    verdict = judge(exercise(name), of_the_first(name, n), np.random.default_rng(4))
    assert "does not change when" in verdict.message
    assert f" {n} of 20 moves" in verdict.message


def test_a_focal_length_wrong_everywhere_is_not_blamed_on_nan():
    one = exercise("18.focal_length")
    verdict = judge(one, lambda *a: np.nan_to_num(one.reference(*a)) + 50, np.random.default_rng(4))
    assert verdict.status == "wrong"
    assert "NaN" not in verdict.message


def test_just_enough_draws_need_no_further_one():
    """(1 − 0.5²)³ is exactly 1 − 0.578125; the quotient of the logarithms is rounded up to more than 3."""
    one = exercise("19.draws")
    assert one.reference(0.5, 2, 0.578125) == 3
    assert function_of(one, solution_of(one))(0.5, 2, 0.578125) == 3
