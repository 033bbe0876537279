"""One small change of a function's code at a time: what a slip of the pen or of the mind makes of it.

A mutant has one expression or statement changed: an operator, a comparison, a constant, an axis, a sign, a term, a
transpose, an argument. Left out is what is the same by the code alone: the absolute value of a square, say (signs.py).
"""

from __future__ import annotations

import ast
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from signs import Around, Signs, name_of

_ONCE = """
_solution, _kept = {name}, []
def {name}({parameters}):
    _kept.append({fresh}_solution({parameters}))
    return _kept[0]
"""


@dataclass(frozen=True)
class Mutant:
    """A changed solution: its changed line, the same line before, both as `ast.unparse` writes them, and all its code.

    `declared` is true for the absolute value, or the clipping at 0, of what a table says is never negative.
    """

    change: str
    line: str
    source: str
    declared: bool = False


def mutants(code: str, name: str, parameters: list[str], never_negative: list[str]) -> Iterator[Mutant]:
    """All mutants of a function's code, each once. The terms that are never negative only mark theirs as declared."""
    tree = ast.parse(code)
    _without_docstrings(tree)
    original = ast.unparse(tree)
    signs = Signs(tree, never_negative)
    seen = {original}
    for replace in _replacements(tree, signs):
        with replace:
            source = ast.unparse(ast.fix_missing_locations(tree))
        if source not in seen and _is_python(source):
            seen.add(source)
            yield Mutant(*_changed_line(original, source), source, replace.declared)
    again = _ONCE.format(name=name, parameters=", ".join(parameters), fresh="_kept[0] if _kept else ")
    yield Mutant("the first answer again and again", "", original + again)


def _is_python(source: str) -> bool:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            compile(source, "<mutant>", "exec")
    except SyntaxError:
        return False
    return True


def _without_docstrings(tree: ast.Module) -> None:
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and ast.get_docstring(node) is not None:
            node.body = node.body[1:]


def _changed_line(original: str, mutant: str) -> tuple[str, str]:
    """The line that is changed, after and before; of several the first."""
    before, after = original.splitlines(), mutant.splitlines()
    at = next((i for i, pair in enumerate(zip(before, after, strict=False)) if pair[0] != pair[1]), len(after))
    changed = after[at].strip() if at < len(after) else "pass"
    return (f"without {before[at].strip()}" if changed == "pass" else changed), before[at].strip()


class _Replacement:
    """While it is entered, one part of the tree is another."""

    def __init__(self, owner: ast.AST, field: str, index: int | None, new: Any, declared: bool = False) -> None:
        self._owner, self._field, self._index, self._new, self.declared = owner, field, index, new, declared

    def _put(self, new: Any) -> Any:
        if self._index is None:
            old = getattr(self._owner, self._field)
            setattr(self._owner, self._field, new)
            return old
        parts = getattr(self._owner, self._field)
        old, parts[self._index] = parts[self._index], new
        return old

    def __enter__(self) -> None:
        self._old = self._put(self._new)

    def __exit__(self, *_: object) -> None:
        self._put(self._old)


def _replacements(tree: ast.Module, signs: Signs) -> Iterator[_Replacement]:
    for owner, field_name, index, node, around in list(_places(tree, ())):
        if isinstance(node, ast.keyword) and node.arg not in ("dtype", "divide", "invalid"):
            kept = [other for other in getattr(owner, field_name) if other is not node]
            yield _Replacement(owner, field_name, None, kept)
        elif isinstance(node, ast.stmt):
            yield from (_Replacement(owner, field_name, index, new) for new in _changed_statement(node, signs))
        elif isinstance(node, ast.expr) and isinstance(getattr(node, "ctx", ast.Load()), ast.Load):
            for new in _changed(node, owner, around, signs):
                yield _Replacement(owner, field_name, index, new)
            for new in _other_sign(node, around, signs):
                yield _Replacement(owner, field_name, index, new, signs.is_declared(node) and new.__class__ is ast.Call)


def _places(node: ast.AST, around: Around) -> Iterator[tuple[ast.AST, str, int | None, ast.AST, Around]]:
    """Every part of the code: whose it is, in which field and where in its list, itself, and what it is part of."""
    within = (*around, node)
    for field_name, value in ast.iter_fields(node):
        if isinstance(value, ast.arguments) or (isinstance(node, ast.Call) and field_name == "func"):
            value = value.value if isinstance(value, ast.Attribute) else None
            if not isinstance(value, ast.Name) and isinstance(value, ast.AST):
                yield from _places(value, within)
            if isinstance(node, ast.Call):
                yield node, "func", None, node.func, within
            continue
        for index, part in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if isinstance(part, ast.AST):
                yield node, field_name, index, part, within
                yield from _places(part, within)


def _changed_statement(node: ast.stmt, signs: Signs) -> Iterator[ast.stmt]:
    if isinstance(node, ast.AugAssign) and isinstance(node.target, ast.Name):
        for operator in _OPERATORS.get(type(node.op), ()):
            yield ast.AugAssign(node.target, operator(), node.value)
        yield ast.Assign([ast.Name(node.target.id, ast.Store())], node.value, lineno=0)
    elif isinstance(node, ast.If | ast.For) or (isinstance(node, ast.Assign) and signs.again(node)):
        yield ast.Pass()


_OPERATORS: dict[type[ast.AST], tuple[type[Any], ...]] = {
    ast.Add: (ast.Sub, ast.Mult),
    ast.Sub: (ast.Add,),
    ast.Mult: (ast.Div, ast.Add),
    ast.Div: (ast.Mult, ast.FloorDiv),
    ast.FloorDiv: (ast.Div,),
    ast.Mod: (ast.FloorDiv,),
    ast.Pow: (ast.Mult,),
    ast.MatMult: (ast.Mult,),
    ast.BitAnd: (ast.BitOr,),
    ast.BitOr: (ast.BitAnd,),
    ast.And: (ast.Or,),
    ast.Or: (ast.And,),
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
}
_TURNED = (ast.Sub, ast.Div, ast.MatMult, ast.Pow, ast.FloorDiv)
"""Operators whose operands may not change places."""

_NAMES = {
    "any": ("all",),
    "all": ("any",),
    "max": ("min", "sum"),
    "min": ("max",),
    "maximum": ("minimum",),
    "minimum": ("maximum",),
    "sin": ("cos",),
    "cos": ("sin",),
    "arctan": ("arcsin",),
    "sum": ("mean",),
    "mean": ("sum", "median"),
    "median": ("mean",),
    "nanmean": ("mean", "nanmedian"),
    "nanmedian": ("median", "nanmean"),
    "var": ("std",),
    "rint": ("floor", "ceil"),
    "floor": ("ceil",),
    "inv": ("transpose_of",),
    "pinv": ("inv",),
    "ones_like": ("zeros_like",),
    "zeros_like": ("ones_like",),
    "inf": ("nan",),
    "pi": ("e",),
}
_EITHER_WAY = {"maximum", "minimum", "hypot"}
"""Functions whose arguments may change places."""


def _changed(node: ast.expr, owner: ast.AST, around: Around, signs: Signs) -> Iterator[ast.expr]:
    """What may stand in the place of an expression, but for the same with another sign."""
    if isinstance(node, ast.BinOp):
        yield from _changed_operation(node, around)
    elif isinstance(node, ast.BoolOp):
        yield ast.BoolOp(_OPERATORS[type(node.op)][0](), node.values)
        yield from node.values
    elif isinstance(node, ast.Compare):
        yield from _changed_comparison(node)
    elif isinstance(node, ast.UnaryOp) and not _without_sign(around):
        yield node.operand
    elif isinstance(node, ast.IfExp):
        yield from (node.body, node.orelse)
    elif isinstance(node, ast.Constant):
        yield from _changed_constant(node, around)
    elif isinstance(node, ast.Attribute):
        yield from _changedname_of(node)
    elif isinstance(node, ast.Call):
        yield from _changed_call(node)
    elif isinstance(node, ast.Name):
        yield from (ast.Name(other, ast.Load()) for other in signs.parameters_beside(node.id))
    elif isinstance(node, ast.Tuple | ast.List) and isinstance(owner, ast.Return | ast.Call | ast.Tuple | ast.List):
        for i in range(len(node.elts) - 1):
            swapped = [*node.elts[:i], node.elts[i + 1], node.elts[i], *node.elts[i + 2 :]]
            yield type(node)(swapped, node.ctx)


def _other_sign(node: ast.expr, around: Around, signs: Signs) -> Iterator[ast.expr]:
    """An expression negated, its absolute value, and what is more than 0 of it, where the code lets these differ."""
    owner = around[-1]
    if not signs.is_number(node, around):
        return
    product = isinstance(owner, ast.BinOp) and isinstance(owner.op, ast.Mult | ast.Div | ast.MatMult)
    difference = isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub)
    even = _without_sign(around)
    if not (product or difference or even):
        yield ast.UnaryOp(ast.USub(), node)
    if signs.never_negative(node):
        return
    if not even:
        yield _call("abs", node)
    above = isinstance(owner, ast.Compare) and node is owner.left and isinstance(owner.ops[0], ast.Gt)
    if not (above and isinstance(owner.comparators[0], ast.Constant) and owner.comparators[0].value == 0):
        yield _call("maximum", node, ast.Constant(0))


def _without_sign(around: Around) -> bool:
    """Whether what is next around an expression does not depend on the expression's sign."""
    owner = around[-1]
    if isinstance(owner, ast.BinOp) and isinstance(owner.op, ast.Pow):
        return isinstance(owner.right, ast.Constant) and owner.right.value % 2 == 0
    return isinstance(owner, ast.Call) and name_of(owner.func) in ("abs", "norm", "cos", "hypot", "var")


def _call(name: str, *arguments: ast.expr) -> ast.Call:
    return ast.Call(ast.Attribute(ast.Name("np", ast.Load()), name, ast.Load()), list(arguments), [])


def _changed_operation(node: ast.BinOp, around: Around) -> Iterator[ast.expr]:
    for operator in _OPERATORS.get(type(node.op), ()):
        yield ast.BinOp(node.left, operator(), node.right)
    if isinstance(node.op, _TURNED) and not (isinstance(node.op, ast.Sub) and _without_sign(around)):
        yield ast.BinOp(node.right, node.op, node.left)
    yield from (node.left, node.right)  # one term dropped


def _changed_comparison(node: ast.Compare) -> Iterator[ast.expr]:
    for i, operator in enumerate(node.ops):
        for other in _OPERATORS.get(type(operator), ()):
            yield ast.Compare(node.left, [*node.ops[:i], other(), *node.ops[i + 1 :]], node.comparators)
    yield from (ast.Constant(True), ast.Constant(False))
    yield from _moved_boundaries(node)


def _moved_boundaries(node: ast.Compare) -> Iterator[ast.expr]:
    """The comparison with a limit that lies a hundredth higher or lower."""
    for i, limit in enumerate(node.comparators):
        if isinstance(node.ops[i], ast.Lt | ast.LtE | ast.Gt | ast.GtE) and not isinstance(limit, ast.Constant):
            for factor in (0.99, 1.01):
                moved = ast.BinOp(ast.Constant(factor), ast.Mult(), limit)
                yield ast.Compare(node.left, node.ops, [*node.comparators[:i], moved, *node.comparators[i + 1 :]])


def _changed_constant(node: ast.Constant, around: Around) -> Iterator[ast.expr]:
    value = node.value
    if isinstance(value, bool) and value:
        yield ast.Constant(False)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return
    others: list[float] = [value + 1, value - 1, 0, 1, 2]
    counted = any(isinstance(one, ast.Subscript | ast.keyword | ast.For) for one in around[-4:])
    if not counted:
        others += [value * 1.01] if _without_sign(around) else [-value, value * 1.01]
    if isinstance(value, float):
        others += [value * 10, value / 10]
    yield from (ast.Constant(other) for other in dict.fromkeys(others) if other != value)


def _changedname_of(node: ast.Attribute) -> Iterator[ast.expr]:
    if node.attr in ("T", "real"):
        yield node.value
    if node.attr == "nan":
        yield from (ast.Constant(0.0), ast.Attribute(node.value, "inf", node.ctx))
    if node.attr == "inv":  # of what is taken for a rotation
        yield ast.Attribute(ast.Name("np", ast.Load()), "transpose", node.ctx)
    for other in _NAMES.get(node.attr, ()):
        if other != "transpose_of":
            yield ast.Attribute(node.value, other, node.ctx)


def _changed_call(node: ast.Call) -> Iterator[ast.expr]:
    for i, one in enumerate(node.args[:-1] if name_of(node.func) not in _EITHER_WAY else []):
        swapped = [*node.args[:i], node.args[i + 1], one, *node.args[i + 2 :]]
        yield ast.Call(node.func, swapped, node.keywords)
    if name_of(node.func) not in ("array", "asarray"):
        yield from node.args  # `np.abs(x)` becomes x, `np.where(a, b, c)` becomes b
    for keyword in node.keywords:
        if keyword.arg != "axis":
            continue
        for axis in (0, None, -1, 1):
            others = [
                other if other is not keyword else ast.keyword("axis", ast.Constant(axis)) for other in node.keywords
            ]
            yield ast.Call(node.func, node.args, others)
