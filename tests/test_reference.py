"""The API reference: every public name has a summary, an executed example and the sections it needs, in Google's form.

CONTRIBUTING.md ("Docstrings") shows the form. A public name is one in the `__all__` of `camviz` or of a part of it.
What SciPy makes is documented by SciPy, and a module by its parts. A type that is only another name for types needs no
example, and a constant is documented by the string below it. A parameter or a result whose type is a name for arrays,
such as `Pixels`, is documented by what that name says; a parameter that is called as one of our classes, by the class.
"""

import ast
import doctest
import functools
import importlib
import inspect
import io
import random
import re
import sys
import textwrap
import types
import typing
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from docutils.core import publish_doctree

import camviz
import camviz.poses

matplotlib.use("agg")

ROOT = Path(camviz.__file__).parents[1]
PACKAGES = ("camviz", "camviz_clinic", "camviz_school")
sys.path.insert(0, str(ROOT / "tools/website"))

import docstrings  # noqa: E402

SECTIONS = ("Args", "Attributes", "Returns", "Yields", "Raises", "Source")  # in this order
HEAD = re.compile(rf"({'|'.join(SECTIONS)}):(?: (.+))?")
NAMED = re.compile(r"([\w\\*]+(?:, [\w\\*]+)*): (.*)")
UNKNOWN = re.compile(r"[A-Z]\w*( \w+)?:|-{3,}|={3,}|Parameters|References|Examples")
ARRAY = re.compile(r"\b(ArrayLike|Array|NDArray|ndarray|Mask|Gray|Colours)\b")
SHAPE = re.compile(
    r"(?:array |[a-z]+ of (?:str to )?)?(?:\([^()]*\)|scalar\b|any shape\b)"
)  # what is said begins with it
UNIT = re.compile(
    r"pixel|metre|\bmm\b|\bcm\b|\bm\b|µm|\bum\b|\bnm\b|micro|nano|radian|degree|°|focal length|homogeneous|second"
    r"|kelvin|\bbits?\b|electron|photon|candela|lux|hertz|per cent|%|unit|0 to 1|0 … 1|ratio|factor|share|true|index"
    r"|number|\bDN\b|linear|encoded|sRGB|grey|colour|chromaticit|XYZ|Lab\b|RGB|disparit|field|matrix",
    re.IGNORECASE,
)
SOURCE = re.compile(r"\b(18|19|20)\d\d\b|\bet al\b|\beq\. |\bISBN\b|\bdoi\b", re.IGNORECASE)


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


def said_by(alias):
    """What a name for arrays says of their shape and unit; "" of everything else."""
    return alias.__metadata__[0] if typing.get_origin(alias) is typing.Annotated else ""


@functools.cache
def offered_aliases():
    """The names for arrays that a part offers, and what each says; a reader finds them on the part's page."""
    saying = [importlib.import_module(part) for part in PARTS if "Annotated[" in sources()[part]]
    found = [(name, getattr(part, name)) for part in saying for name in part.__all__]
    return {name: (value, said_by(value)) for name, value in found if said_by(value)}


def of_alias(function, annotation):
    """What an annotation says of itself, if it is a name for arrays that the function's module takes from a part."""
    alias, said = offered_aliases().get(annotation, (None, ""))
    module = sys.modules[inspect.unwrap(function).__module__]
    return said if said and vars(module).get(annotation) is alias else ""


def is_one_of_ours(function, annotation):
    """Whether an annotation is a documented class of ours, or SciPy's that `camviz.poses` offers, by its bare name."""
    value = vars(sys.modules[inspect.unwrap(function).__module__]).get(annotation.strip("'\""))
    ours = inspect.isclass(value) and value.__module__.partition(".")[0] in PACKAGES and bool(value.__doc__)
    return ours or value in (camviz.poses.RigidTransform, camviz.poses.Rotation)


def is_named_after(name, annotation):
    """Whether a parameter is called as its class, `camera: Camera`, or as the frames of a transform, `a_from_b`."""
    if annotation == "RigidTransform":
        return re.fullmatch(r"\w+_from_\w+", name) is not None
    return name == re.sub("(?<=[a-z])(?=[A-Z])", "_", annotation).lower()


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
    if said := said_by(value):
        return without_shape_or_unit(name, said) + ([] if said.endswith(".") else ["it does not end with a period"])
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


@functools.cache
def sections(text):
    """The lines of each section by its title, and those outside under ""; an entry's first line has no indent."""
    found, title = {"": []}, ""
    for line in text.split("\n"):
        if head := HEAD.fullmatch(line):
            title, first = head.groups()
            found[title] = [first] if first else []
        elif title and (line.startswith("    ") or (title == "Source" and line)):
            found[title].append(line.removeprefix("    "))
        else:
            title = ""
            found[""].append(line)
    return found


def entries(text, title):
    """What a section says, by name; a result that has no name is the only one, under ""."""
    lines = sections(text).get(title, [])
    if title == "Raises" and lines and not NAMED.match(lines[0]):  # Raises: ValueError for another shape.
        lines = [lines[0].replace(" ", ": ", 1), *lines[1:]]
    one = title in ("Returns", "Yields") and (len(lines) == 1 or not all(map(NAMED.match, starts(lines))))
    if title == "Source" or one:
        return {"": " ".join(map(str.strip, lines))} if lines else {}
    said = {}
    for line in lines:
        names, text = NAMED.match(line).groups() if NAMED.match(line) else (line, "")
        if line.startswith(" "):
            said[next(reversed(said))] += " " + line.strip()
        else:
            said[names.replace("\\", "")] = text
    return {name: text for names, text in said.items() for name in names.split(", ")}


def starts(lines):
    return [line for line in lines if not line.startswith(" ")]


def prose(text):
    """The lines that stand outside of sections and examples."""
    paragraphs = "\n".join(sections(text)[""]).split("\n\n")
    introduced = {one for one, below in pairwise(paragraphs) if below.startswith(">>>") and one.endswith(":")}
    return [line for one in paragraphs if ">>> " not in one and one not in introduced for line in one.split("\n")]


def of_form(text):
    """What the form of a docstring lacks; the text is what is written between the quotes, cleaned."""
    if not text.strip():
        return ["it has no docstring"]
    found = sections(text)
    titles = [title for title in found if title]
    summary = text.split("\n\n")[0]
    lacks = [] if "\n" not in summary else ["its summary has more than one line"]
    lacks += [] if summary.endswith(".") else ["its summary does not end with a period"]
    lacks += [] if text == text.strip() else ["it begins or ends with an empty line, or is indented"]
    lacks += ["it has two empty lines in a row"] if "\n\n\n" in text else []
    lacks += ["it has a tabulator"] if "\t" in text else []
    lacks += [f"{line!r} is no section of ours" for line in prose(text) if UNKNOWN.fullmatch(line)]
    lacks += [] if titles == sorted(titles, key=SECTIONS.index) else [f"its sections come as {', '.join(titles)}"]
    lacks += [f"{title} is empty" for title in titles if not entries(text, title)]
    for title in titles:
        for name, said in entries(text, title).items():
            where = f"{title} {name}".strip()
            lacks += [] if said else [f"{where} has no description"]
            lacks += [] if said.endswith((".", "```")) else [f"{where} does not end with a period"]
    return lacks + as_a_page(text)


def as_a_page(text):
    """What goes wrong when the docstring becomes a page, such as |x| in a formula, which has another meaning there."""
    said = io.StringIO()
    publish_doctree("\n".join(docstrings.as_page(text.split("\n"))), settings_overrides={"warning_stream": said})
    return said.getvalue().splitlines()


def of_class(cls):
    """A class says what it is made with under Args, or under Attributes where readers are only given one."""
    text = inspect.getdoc(cls) or ""
    has_constructor = "__init__" in vars(cls) and not getattr(cls, "_is_protocol", False)
    given, own = entries(text, "Args"), entries(text, "Attributes")
    found = of_parameters(cls, given, own) if has_constructor else []
    found += [f"there is no attribute {name}" for name in own if not is_typed(cls, name)]
    checks = vars(cls).get("__post_init__")
    if checks and does_raise(checks) and not entries(text, "Raises"):
        found.append("it raises an error, and has no section Raises")
    return of_form(text) + found + unnamed_sources(text)


def is_typed(cls, name):
    """Whether a class says the type of an attribute: as a field, or as a property."""
    annotated = any(name in vars(base).get("__annotations__", {}) for base in cls.__mro__)
    made = inspect.signature(cls).parameters
    return (
        annotated
        or is_property(getattr(cls, name, None))
        or (name in made and made[name].annotation is not made[name].empty)
    )


def of_routine(value):
    text = inspect.getdoc(value) or ""
    if is_property(value):
        return ([] if text else ["it has no docstring"]) + unnamed_sources(text)
    found = of_form(text) + of_parameters(value, entries(text, "Args"))
    if does_raise(inspect.unwrap(value)) and not entries(text, "Raises"):
        found.append("it raises an error, and has no section Raises")
    return found + of_results(value, text) + unnamed_sources(text)


def of_results(value, text):
    """What comes back is said, an array with its shape and its unit."""
    returned = str(inspect.signature(value).return_annotation)
    title = "Yields" if inspect.isgeneratorfunction(inspect.unwrap(value)) else "Returns"
    said = entries(text, title)
    if not said and title == "Returns":
        each = results(returned) if returned.startswith("tuple[") else [returned]
        is_said = all(of_alias(value, one) for one in each) or is_one_of_ours(value, returned)
        is_said = is_said or (returned == "bool" and text.startswith("Whether "))
        return [] if is_said or returned in ("None", "NoReturn") else ["it has no section Returns"]
    if not said:
        return [f"it has no section {title}"]
    each = results(returned) if len(said) > 1 else [returned]
    if len(each) != len(said):
        return [f"{title} says {len(said)} results of {returned}"]
    arrays = [text for text, its in zip(said.values(), each, strict=True) if ARRAY.search(its)]
    names_shape = SHAPE.search if "Callable" in returned else SHAPE.match
    return [f"{title} names no shape of {text!r}" for text in arrays if not names_shape(text)]


def results(annotation):
    """The annotations of what a tuple holds."""
    tuples = [node for node in ast.walk(ast.parse(annotation)) if isinstance(node, ast.Subscript)]
    tuples = [node.slice.elts for node in tuples if ast.unparse(node.value) == "tuple"]
    return [ast.unparse(one) for one in tuples[0]] if tuples else []


def of_parameters(value, given, own=types.MappingProxyType({})):
    """Every parameter in its order and with its type; those that are arrays with their shapes and units."""
    signature = inspect.signature(value).parameters
    stars = {inspect.Parameter.VAR_POSITIONAL: "*", inspect.Parameter.VAR_KEYWORD: "**"}
    expected = {
        stars.get(each.kind, "") + name: each for name, each in signature.items() if name not in ("self", "cls")
    }
    said = {**given, **{name: text for name, text in own.items() if name in expected}}
    types_ = {name: str(each.annotation) for name, each in expected.items()}
    silent = {name: of_alias(value, its) for name, its in types_.items() if name not in said and of_alias(value, its)}
    found = [fault for name, text in silent.items() for fault in without_shape_or_unit(name, text)]
    known = {name for name, its in types_.items() if is_one_of_ours(value, its) and is_named_after(name, its)}
    known |= {name for name, its in types_.items() if (name, its) == ("rng", "np.random.Generator")}
    expected = {name: each for name, each in expected.items() if name in said or name not in silent.keys() | known}
    if list(said) != list(expected):
        found.append(f"its parameters are {', '.join(expected)}, and documented are {', '.join(said) or 'none'}")
    for name in [name for name in expected if name in said]:
        annotation = str(expected[name].annotation)
        if expected[name].annotation is inspect.Parameter.empty:
            found.append(f"nothing says the type of {name}")
        if ARRAY.search(annotation) and "Callable" not in annotation:
            found += without_shape_or_unit(name, said[name])
    return found


def without_shape_or_unit(name, text):
    found = [] if SHAPE.match(text) else [f"{name} is an array, and its shape is not said"]
    return found + ([] if UNIT.search(text) else [f"{name} is an array, and its unit is not said"])


def unnamed_sources(text):
    """A book or a paper that stands in the text stands behind Source, where it is looked for."""
    inside = [line for title in SECTIONS[:-1] for line in sections(text or "").get(title, [])]
    said = prose(text or "") + inside
    cited = SOURCE.search("\n".join(said))
    return [f"{cited.group()!r} names a source outside of Source"] if cited else []


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
    shown = re.search(r'```python\ndef project.*?"""(.*?)"""', (ROOT / "docs/CONTRIBUTING.md").read_text(), re.DOTALL)
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
