"""What a function's code alone says about signs: which of its expressions are numbers, and which never negative."""

from __future__ import annotations

import ast
from collections.abc import Callable

Around = tuple[ast.AST, ...]
"""What an expression is part of, from the outside in."""
_SEVERAL = {"concatenate", "stack", "array", "column_stack"}
"""Functions whose argument is a list, where a sign or an absolute value is asked of the parts."""
_SHAPE = {"ones_like", "zeros_like", "zeros", "ones", "eye", "range", "arange", "len"}
"""Functions that look at the size of what they are given."""
_NO_SIGN = {"abs", "norm", "hypot", "sqrt", "arange", "var", "arccos", "eye", "ones_like", "zeros_like", "len"}
_SIGN_OF_ALL = {"sum", "mean", "nanmean", "median", "nanmedian", "max", "maximum", "minimum", "asarray", "diag"}
_SIGN_OF_ALL |= {
    "arctan",
    "degrees",
    "radians",
    "cbrt",
    "stack",
    "array",
    "concatenate",
    "meshgrid",
    "rint",
    "broadcast_to",
    "moveaxis",
}


class Signs:
    """What the code alone says about its names: which are numbers, and which of these are never negative."""

    def __init__(self, tree: ast.Module, declared: list[str]) -> None:
        functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        self._parameters = [a.arg for a in functions[0].args.args]
        self._known = set(self._parameters) | {a.arg for f in functions for a in f.args.args}
        self._declared = set(declared)
        self._positive: set[str] = set()
        self._conditions: set[str] = set()
        self._values: dict[str, list[ast.expr]] = {}
        self._firsts: set[ast.AST] = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Assign | ast.For | ast.comprehension):
                self._learn(node)
        for name, values in self._values.items():
            if all(map(self._is_condition, values)):
                self._conditions.add(name)
            if name not in self._parameters and all(map(self.never_negative, values)):
                self._positive.add(name)
            elif name not in self._parameters and all(self.never_negative(v) or self.is_declared(v) for v in values):
                self._declared.add(name)

    def _learn(self, node: ast.Assign | ast.For | ast.comprehension) -> None:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        for target in targets:
            for part in ast.walk(target):
                if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store):
                    if part.id not in self._known:
                        self._firsts.add(node)
                    self._known.add(part.id)
                    whole = isinstance(target, ast.Name) or isinstance(getattr(node, "value", None), ast.Call)
                    plain = isinstance(node, ast.Assign) and whole
                    self._values.setdefault(part.id, []).append(node.value if plain else ast.Constant(-1))

    def parameters_beside(self, name: str) -> list[str]:
        """The function's other parameters, where the name is one."""
        return [other for other in self._parameters if other != name] if name in self._parameters else []

    def again(self, node: ast.Assign) -> bool:
        """Whether the code runs without an assignment: its name had a value before."""
        return node not in self._firsts

    def _is_condition(self, node: ast.expr) -> bool:
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitAnd | ast.BitOr):
            return self._is_condition(node.left) or self._is_condition(node.right)
        if isinstance(node, ast.Call):
            return name_of(node.func) in ("all", "any", "allclose")
        known = isinstance(node, ast.Name) and node.id in self._conditions
        return known or isinstance(node, ast.Compare | ast.BoolOp)

    def is_number(self, node: ast.expr, around: Around) -> bool:
        """Whether an expression may stand for numbers whose sign has a say."""
        owner = around[-1]
        if isinstance(owner, ast.Attribute | ast.keyword | ast.Slice | ast.withitem | ast.For):
            return False
        if isinstance(owner, ast.Subscript):  # it is asked of the part
            return False
        calls = [name_of(one.func) for one in around if isinstance(one, ast.Call)]
        if _SHAPE & set(calls) or (isinstance(owner, ast.Call) and calls[-1] in _SEVERAL):
            return False
        if isinstance(node, ast.Name):
            return node.id in self._known and node.id not in self._conditions
        return isinstance(node, ast.Subscript | ast.BinOp | ast.Call) and not self._is_condition(node)

    def is_declared(self, node: ast.expr) -> bool:
        """Whether a table says that an expression is never negative, or what it is made of."""
        if ast.unparse(node) in self._declared:
            return True
        return not self.never_negative(node) and self._shown(node, self.is_declared)

    def never_negative(self, node: ast.expr) -> bool:
        """Whether the code alone shows that no number of an expression is less than 0."""
        if isinstance(node, ast.Constant):
            return isinstance(node.value, int | float) and node.value >= 0
        if isinstance(node, ast.Name):
            return node.id in self._positive
        return self._shown(node, self.never_negative)

    def _shown(self, node: ast.expr, known: Callable[[ast.expr], bool]) -> bool:
        """Whether an expression is never negative because its parts are not."""

        def both(part: ast.expr) -> bool:
            return self.never_negative(part) or known(part)

        if isinstance(node, ast.Subscript):
            return both(node.value)
        if isinstance(node, ast.Attribute):
            return node.attr in ("inf", "nan", "pi") or (node.attr == "T" and both(node.value))
        if isinstance(node, ast.List | ast.Tuple):
            return all(map(both, node.elts))
        if isinstance(node, ast.IfExp):
            return both(node.body) and both(node.orelse)
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow):
            even = isinstance(node.right, ast.Constant) and node.right.value % 2 == 0
            return even or both(node.left)
        if isinstance(node, ast.BinOp):
            grows = isinstance(node.op, ast.Add | ast.Mult | ast.Div | ast.MatMult | ast.Mod | ast.FloorDiv)
            return grows and both(node.left) and both(node.right)
        if isinstance(node, ast.Call):
            if name_of(node.func) == "where":
                return all(map(both, node.args[1:]))
            parts = node.args or ([node.func.value] if isinstance(node.func, ast.Attribute) else [])
            return name_of(node.func) in _NO_SIGN or (name_of(node.func) in _SIGN_OF_ALL and all(map(both, parts)))
        return False


def name_of(function: ast.expr) -> str:
    """The last part of what is called: "norm" for `np.linalg.norm`."""
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""
