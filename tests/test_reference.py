"""The API reference: every public name has a summary, an executed example and numpydoc's sections.

CONTRIBUTING.md ("Docstrings") shows the form. A public name is one in the `__all__` of `camviz` or of a part of it.
What SciPy makes is documented by SciPy, and a module by its parts. A type that is only another name for types needs no
example, and a constant is documented by the string below it.
"""

import ast
import doctest
import functools
import importlib
import inspect
import io
import random
import re
import textwrap
import types
import typing
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from docutils.core import publish_doctree
from numpydoc.docscrape import NumpyDocString, get_doc_object
from numpydoc.docscrape_sphinx import SphinxDocString
from numpydoc.validate import validate

import camviz

matplotlib.use("agg")

ROOT = Path(camviz.__file__).parents[1]
PACKAGES = ("camviz", "camviz_clinic", "camviz_school")
HELD = {  # numpydoc.validate's codes; left out are those that would say twice what the house's form says once
    *("GL01", "GL02", "GL03", "GL05", "GL06", "GL07", "GL08", "GL10", "SS01", "SS03", "SS04", "SS06"),
    *("PR02", "PR05", "PR07", "PR09", "PR10", "RT01", "RT02", "RT03", "RT05", "YD01"),
}  # PR01, PR03 and PR04 are asked below, because a class may list its fields under Attributes as well
ARRAY = re.compile(r"\b(ArrayLike|Array|NDArray|ndarray|Mask|Gray|Colours)\b")
SHAPE = re.compile(r"\([^()]*\)|\bscalar\b|\bany shape\b")
UNIT = re.compile(
    r"pixel|metre|\bmm\b|\bcm\b|\bm\b|µm|\bum\b|\bnm\b|micro|nano|radian|degree|°|focal length|homogeneous|second"
    r"|kelvin|\bbits?\b|electron|photon|candela|lux|hertz|per cent|%|unit|0 to 1|0 … 1|ratio|factor|share|true|index"
    r"|number|\bDN\b|linear|encoded|sRGB|grey|colour|chromaticit|XYZ|Lab\b|RGB|disparit|field|matrix",
    re.IGNORECASE,
)
ALONE = {"show_class_members": False}  # a class is asked about itself; its methods are asked each for itself
SOURCE = re.compile(r"\b(18|19|20)\d\d\b|\bet al\b|\beq\. |\bISBN\b|\bdoi\b", re.IGNORECASE)
SECTION = re.compile(r"^(References|Examples)\n-+$", re.MULTILINE)


@functools.cache
def sources():
    """The text of every module that can be imported without doing anything, by the module's name."""
    every = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
    paths = [path for path in every if path.stem not in ("__main__", "server")]
    names = [".".join(path.relative_to(ROOT).with_suffix("").parts) for path in paths]
    texts = [path.read_text("utf-8") for path in paths]
    return {name.removesuffix(".__init__"): text for name, text in zip(names, texts, strict=True)}


def imported(name):
    if name == "camviz_clinic.meshes":
        pytest.importorskip("pyvista")
    return importlib.import_module(name)


PARTS = [name for name, text in sources().items() if re.search(r"^__all__\b", text, re.MULTILINE)]
TESTED = [name for name, text in sources().items() if ">>>" in text]


# What is written of a name --------------------------------------------------------------------------------------------


@functools.cache
def written_below(module):
    """The strings that stand below assignments of a module, by the assigned name: the docstrings of its constants."""
    body = ast.parse(sources()[module]).body
    found = {}
    for one, below in pairwise(body):
        text = below.value if isinstance(below, ast.Expr) else None
        if isinstance(one, (ast.Assign, ast.AnnAssign)) and isinstance(getattr(text, "value", None), str):
            targets = one.targets if isinstance(one, ast.Assign) else [one.target]
            found |= {target.id: inspect.cleandoc(text.value) for target in targets if isinstance(target, ast.Name)}
    return found


def constant_docstring(part, name):
    """The string below a constant, in the part itself or in the module that it comes from."""
    value = getattr(importlib.import_module(part), name)
    for module in sorted(sources(), key=lambda each: not (each + ".").startswith(part + ".")):
        if name in written_below(module) and getattr(importlib.import_module(module), name) is value:
            return written_below(module)[name]
    return ""


def is_documented_by_itself(value):
    return inspect.isclass(value) or inspect.isroutine(inspect.unwrap(value))


def is_alias(value):
    return isinstance(value, (types.GenericAlias, types.UnionType)) or typing.get_origin(value) is not None


def is_of(part, name, value):
    """Whether a name is a part's own: it may be in the `__all__` of others, and is asked for once."""
    module = getattr(value, "__module__", None) or part
    homes = [each for each in PARTS if (module + ".").startswith(each + ".")]
    homes = [each for each in homes if name in importlib.import_module(each).__all__]
    return part == max(homes, key=len, default=part)


def faults(part, name):
    """What the documentation of a public name lacks, in sentences."""
    value = getattr(importlib.import_module(part), name)
    if not is_of(part, name, value):
        return []
    if inspect.ismodule(value) or getattr(value, "__module__", "camviz").partition(".")[0] in ("scipy", "numpy"):
        return []
    if is_alias(value) or not is_documented_by_itself(value):
        text = constant_docstring(part, name)
        lacks = [] if text else ["no string stands below it"]
        return lacks + ([] if is_alias(value) else without_example(text))
    if inspect.isclass(value):
        own = [f"{method}: {fault}" for method, each in methods(value) for fault in of_routine(each)]
        return of_class(value) + without_example(inspect.getdoc(value)) + own
    return of_routine(value) + without_example(inspect.getdoc(value))


def without_example(text):
    return [] if doctest.DocTestParser().get_examples(text or "") else ["it has no example"]


def methods(cls):
    """The public methods and properties that a class itself defines, unless a base has said what they do."""
    if getattr(cls, "_is_protocol", False):  # its members are declarations
        return
    for name, member in vars(cls).items():
        if name.startswith("_") or not isinstance(
            member, (types.FunctionType, classmethod, staticmethod, property, functools.cached_property)
        ):
            continue
        inherited = any(getattr(getattr(base, name, None), "__doc__", None) for base in cls.__mro__[1:])
        if not (inherited and not member.__doc__):
            yield name, member if is_property(member) else getattr(cls, name)


def is_property(member):
    return isinstance(member, (property, functools.cached_property))


def held(value):
    """What numpydoc finds, as far as the house's form has it."""
    found = validate(get_doc_object(value, config=ALONE))["errors"]
    return [f"{code} {said}" for code, said in found if code in HELD] + as_a_page(inspect.getdoc(value) or "")


def as_a_page(text):
    """What goes wrong when the docstring becomes a page, such as |x| in a formula, which has another meaning there."""
    said = io.StringIO()
    page = str(SphinxDocString(text)).replace(".. only:: latex", "")  # which Sphinx has, and docutils has not
    publish_doctree(page, settings_overrides={"warning_stream": said})
    return said.getvalue().splitlines()


def of_class(cls):
    """A class says what it is made with under Parameters, or under Attributes where readers are only given one."""
    text = NumpyDocString(inspect.getdoc(cls) or "")
    has_constructor = "__init__" in vars(cls) and not getattr(cls, "_is_protocol", False)
    found = of_parameters(cls, text["Parameters"] + text["Attributes"]) if has_constructor else []
    checks = vars(cls).get("__post_init__")
    if checks and does_raise(checks) and not text["Raises"]:
        found.append("it raises an error, and has no section Raises")
    return held(cls) + found + unnamed_sources(inspect.getdoc(cls))


def of_routine(value):
    if is_property(value):
        text = inspect.getdoc(value) or ""
        return ([] if text else ["GL08 it has no docstring"]) + unnamed_sources(text)
    text = NumpyDocString(inspect.getdoc(value) or "")
    found = held(inspect.unwrap(value)) + of_parameters(value, text["Parameters"] + text["Other Parameters"])
    if does_raise(inspect.unwrap(value)) and not text["Raises"]:
        found.append("it raises an error, and has no section Raises")
    returned = str(inspect.signature(value).return_annotation)
    if ARRAY.search(returned) and text["Returns"] and not SHAPE.search(said_of(text["Returns"])):
        found.append("Returns names no shape")
    return found + unnamed_sources(inspect.getdoc(value))


def said_of(section):
    return " ".join(f"{each.name} {each.type} {' '.join(each.desc)}" for each in section)


def of_parameters(value, documented):
    """Every parameter in its order; those that are arrays with their shapes and units."""
    signature = inspect.signature(value).parameters
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    expected = [stars.get(each.kind, "") + name for name, each in signature.items() if name not in ("self", "cls")]
    entries = {name.replace("\\", ""): each for each in documented for name in each.name.split(", ")}
    listed = [name for name in entries if name in expected]
    found = []
    if listed != expected:
        found.append(f"its parameters are {', '.join(expected)}, and documented are {', '.join(listed) or 'none'}")
    for name, each in entries.items():
        annotation = str(signature[name].annotation) if name in signature else ""
        said = f"{each.type} {' '.join(each.desc)}"
        if not each.type and not name.startswith("*"):
            found.append(f"PR04 {name} has no type")
        if ARRAY.search(annotation) and "Callable" not in annotation:
            found += [] if SHAPE.search(said) else [f"{name} is an array, and its shape is not said"]
            found += [] if UNIT.search(said) else [f"{name} is an array, and its unit is not said"]
    return found


def unnamed_sources(text):
    """A book or a paper that stands in the text stands under References, where it is looked for."""
    before = SECTION.split(text or "")[0]
    cited = SOURCE.search(before)
    return [f"{cited.group()!r} names a source outside of the section References"] if cited else []


def does_raise(function):
    """Whether the function's own lines raise an error of their own."""
    (tree,) = ast.parse(textwrap.dedent(inspect.getsource(function))).body
    return any(isinstance(node, ast.Raise) and node.exc is not None for node in ast.walk(tree))


# The tests ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", PARTS)
def test_every_public_name_is_documented(part):
    module = imported(part)
    lacking = {name: found for name in module.__all__ if (found := faults(part, name))}
    if found := as_a_page(module.__doc__ or ""):
        lacking["__doc__"] = found
    assert not lacking, "\n".join(f"{part}.{name}: {fault}" for name, found in lacking.items() for fault in found)


def test_contributing_shows_a_docstring_as_it_is():
    shown = re.search(r'```python\ndef project.*?"""(.*?)"""', (ROOT.parent / "CONTRIBUTING.md").read_text(), re.DOTALL)
    assert shown
    assert inspect.cleandoc(shown[1]) == inspect.getdoc(camviz.Camera.project)


def examples(module):
    """The examples in the docstrings of a module's functions and classes, in its own, and below its constants."""
    found = doctest.DocTestFinder(exclude_empty=True).find(module)
    parser, file = doctest.DocTestParser(), module.__file__
    below = written_below(module.__name__).items()
    constants = [parser.get_doctest(text, vars(module), f"{module.__name__}.{name}", file, 0) for name, text in below]
    return [each for each in [*found, *constants] if each.examples]


def around(name, module):
    """What an example may use: of a public name what `from PART import *` brings, of another what its module has."""
    homes = [each for each in PARTS if f"{module.__name__}.".startswith(f"{each}.")]
    homes = [each for each in homes if name in importlib.import_module(each).__all__]
    if not homes:
        return vars(module)
    part = importlib.import_module(max(homes, key=len))
    return {name: getattr(part, name) for name in part.__all__}


@pytest.mark.parametrize("name", TESTED)
def test_the_examples_come_out_as_they_say(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    module = imported(name)
    said = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    for each in examples(module):
        random.seed(1)
        np.random.seed(1)  # noqa: NPY002 - for the libraries that draw from it
        each.globs = {"np": np, **around(each.name.removeprefix(f"{name}.").partition(".")[0], module)}
        with np.printoptions(legacy=False):  # whatever another library has set
            runner.run(each, out=said.append)
    tried = runner.summarize(verbose=False)
    assert tried.failed == 0, "".join(said)
    count = sum(">>> " in line for line in sources()[name].splitlines())
    assert tried.attempted == count, f"{tried.attempted} of the {count} examples were found"
