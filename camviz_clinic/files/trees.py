"""From text to a plain tree of dicts, lists, strings and numbers, for YAML, JSON and OpenCV's XML alike.

The text comes from strangers. The trees are built from the parsers' events, one by one and without recursion, so that
depth, node count and the expansion of aliases are bounded as they grow, and no tag or entity can start anything.
"""

from __future__ import annotations

import re
from itertools import islice
from typing import Any
from xml.parsers import expat

import yaml

from camviz_clinic.calibration.types import CalibrationError

MAX_DEPTH = 32
MAX_NODES = 1_000_000
MAX_KEYS = 10_000  # of one mapping: readers go through all of them for each name that has several spellings
XML_ROOTS = ("opencv_storage", "calibration", "document")

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_YAML_TAG = "tag:yaml.org,2002:"
_PLAIN_TAGS = {None, "!", *(_YAML_TAG + name for name in ("map", "seq", "str", "int", "float", "bool", "null"))}
_OPENCV_TAGS = {_YAML_TAG + name for name in ("opencv-matrix", "opencv-nd-matrix")}

_MATRIX = "!!opencv-matrix"
_HEADER = re.compile(r"(?:[ \t\r\n]|#[^\n]*\n)*+(%YAML[^\n]*)")
_NO_SPACE = re.compile(r"^([ \t]*[A-Za-z_][\w.]*):(?=[-+.\d\[\"])", re.MULTILINE)
_INTEGER = re.compile(r"[-+]?[0-9]{1,18}")
_REAL = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]{1,9})?")
_SPECIAL = re.compile(r"([-+]?)\.?(nan|inf)", re.IGNORECASE)
_WORDS = {"": None, "~": None, "null": None, "true": True, "false": False}
_XML_WORD = re.compile(r'"([^"]*)"|(\S+)')


def parse(text: str) -> Any:
    """The tree of a calibration file's text; CalibrationError naming the line where it stops being one."""
    return parse_xml(text) if text.lstrip().startswith("<") else parse_yaml(text)


def scalar(word: str) -> Any:
    """A number, a truth value, None or the word itself. Plain `1e-5` is a number here, as its writers mean it."""
    if _INTEGER.fullmatch(word):
        return int(word)
    if _REAL.fullmatch(word):
        return float(word)
    if special := _SPECIAL.fullmatch(word):
        return float(special[1] + special[2])
    return _WORDS.get(word.lower(), word)


class Tree:
    """A tree that grows by one event at a time, within its bounds. Mappings get a key before each value."""

    def __init__(self) -> None:
        self.documents: list[Any] = []
        self.nodes = 0
        self._open: list[tuple[Any, str | None, int]] = []  # container, anchor, nodes when it began
        self._keys: list[str | None] = []  # the key that waits for its value, one for each open container
        self._anchors: dict[str, tuple[Any, int]] = {}

    @property
    def wants_key(self) -> bool:
        """Whether a mapping is open and its next key has not come."""
        return bool(self._open) and isinstance(self._open[-1][0], dict) and self._keys[-1] is None

    def key(self, key: str) -> None:
        """The key of the value that comes next."""
        mapping = self._open[-1][0]
        if key in mapping:
            raise CalibrationError(f"the key {shown(key)} appears twice")
        refuse_many_keys(len(mapping) + 1)
        self._keys[-1] = key

    def leaf(self, value: Any, anchor: str | None = None) -> None:
        """A value that holds no others."""
        self._count(1)
        self._place(value)
        if anchor:
            self._anchors[anchor] = value, 1

    def begin(self, container: Any, anchor: str | None = None) -> None:
        """The start of a list or mapping, which is empty."""
        if len(self._open) == MAX_DEPTH:
            raise CalibrationError(f"nested more than {MAX_DEPTH} levels deep, which no calibration is")
        self._count(1)
        self._open.append((container, anchor, self.nodes))
        self._keys.append(None)

    def end(self) -> None:
        """The end of the list or mapping that began last."""
        container, anchor, start = self._open.pop()
        self._keys.pop()
        if anchor:
            self._anchors[anchor] = container, self.nodes - start + 1
        self._place(container)

    def alias(self, anchor: str) -> None:
        """The value of an anchor once more, counted in full."""
        if anchor not in self._anchors:
            raise CalibrationError(f"the alias {shown(anchor)} points to nothing that came before it")
        value, size = self._anchors[anchor]
        self._count(size)
        self._place(value)

    def _count(self, nodes: int) -> None:
        self.nodes += nodes
        if self.nodes > MAX_NODES:
            raise CalibrationError(f"unfolds to more than {MAX_NODES:,} values, which no calibration has")

    def _place(self, value: Any) -> None:
        if not self._open:
            self.documents.append(value)
        elif isinstance(parent := self._open[-1][0], list):
            parent.append(value)
        elif (key := self._keys[-1]) is None:
            raise CalibrationError("expected a word as the key of a mapping, got a list or a mapping")
        else:
            parent[key] = value
            self._keys[-1] = None


def refuse_many_keys(count: int) -> None:
    """CalibrationError for more keys than any calibration has in one mapping."""
    if count > MAX_KEYS:
        raise CalibrationError(f"expected at most {MAX_KEYS:,} keys in a mapping, got more")


def parse_yaml(text: str) -> Any:
    """The one document of a YAML or JSON text, or of OpenCV's dialect, which a line `%YAML:1.0` begins."""
    text = _plain_yaml(text)
    tree, line = Tree(), 0
    try:
        for event in yaml.parse(text, Loader=_Loader):
            line = event.start_mark.line if event.start_mark else line
            _grow(tree, event)
    except CalibrationError as error:
        raise CalibrationError(f"line {line + 1}: {error}") from None
    except yaml.YAMLError as error:
        raise CalibrationError(f"not valid YAML or JSON: {_yaml_problem(error)}") from None
    documents = [document for document in tree.documents if document is not None]
    if len(documents) > 1:
        raise CalibrationError(f"expected one YAML document, got {len(documents)}")
    return documents[0] if documents else None


def _plain_yaml(text: str) -> str:
    """Without OpenCV's header, comments before it too, and with the space after a colon that OpenCV can do without.

    OpenCV's matrices tell its dialect too, where the header was lost in copying.
    """
    if header := _HEADER.match(text):
        text = text[: header.start(1)] + text[header.end(1) :]
    return _NO_SPACE.sub(r"\1: ", text) if header or _MATRIX in text else text


def _grow(tree: Tree, event: yaml.Event) -> None:
    tag = getattr(event, "tag", None)
    if tag not in _PLAIN_TAGS and not (tag in _OPENCV_TAGS and isinstance(event, yaml.MappingStartEvent)):
        raise CalibrationError(
            f"the tag {shown(tag)} is refused: a calibration holds numbers, words, lists and mappings"
        )
    match event:
        case yaml.ScalarEvent() if tree.wants_key:
            tree.key(event.value)
        case yaml.ScalarEvent():
            plain = not event.style and tag != _YAML_TAG + "str"
            tree.leaf(scalar(event.value) if plain else event.value, event.anchor)
        case yaml.SequenceStartEvent():
            tree.begin([], event.anchor)
        case yaml.MappingStartEvent():
            tree.begin({}, event.anchor)
        case yaml.CollectionEndEvent():
            tree.end()
        case yaml.AliasEvent():
            tree.alias(str(event.anchor))


def _yaml_problem(error: yaml.YAMLError) -> str:
    mark, problem = getattr(error, "problem_mark", None), getattr(error, "problem", None)
    if mark is None or problem is None:
        return "it holds characters that YAML does not allow"
    return f"{problem} (line {mark.line + 1}, column {mark.column + 1})"


def parse_xml(text: str) -> Any:
    """The tree inside `<opencv_storage>`, or Metashape's `<calibration>` or `<document>` under its tag.

    Document types and entities are refused before they can unfold.
    """
    builder = _XmlBuilder()
    try:
        builder.parser.Parse(text.strip(), True)
    except CalibrationError as error:
        raise CalibrationError(f"line {builder.parser.CurrentLineNumber}: {error}") from None
    except expat.ExpatError as error:
        problem = expat.ErrorString(error.code)
        raise CalibrationError(f"not valid XML: {problem} (line {error.lineno}, column {error.offset + 1})") from None
    return builder.root


class _XmlBuilder:
    """Elements as keys. A leaf's words are its numbers.

    In OpenCV's XML `<_>` are the items of a list. In Metashape's, attributes are keys too, and an element that comes
    more than once is a list.
    """

    def __init__(self) -> None:
        self.root: Any = None
        self._nodes = 0
        self._opencv = True
        self._open: list[tuple[str, dict[str, Any], list[Any], list[str]]] = []  # name, keys, items, text
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text
        self.parser.StartDoctypeDeclHandler = self._refuse
        self.parser.EntityDeclHandler = self._refuse

    def _refuse(self, *_: Any) -> None:
        raise CalibrationError("document types and entities are refused: a calibration has no use for them")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        if not self._open:
            if name not in XML_ROOTS:
                expected = ", ".join(f"<{root}>" for root in XML_ROOTS)
                raise CalibrationError(f"expected the element {expected}, got <{name[:60]}>")
            self._opencv = name == XML_ROOTS[0]
        if len(self._open) == MAX_DEPTH:
            raise CalibrationError(f"nested more than {MAX_DEPTH} levels deep, which no calibration is")
        keys = {} if self._opencv else {key: _attribute(key, word) for key, word in attributes.items()}
        refuse_many_keys(len(keys))
        self._nodes += len(keys)
        self._open.append((name, keys, [], []))

    def _text(self, text: str) -> None:
        self._open[-1][3].append(text)

    def _end(self, name: str) -> None:
        _, keys, items, text = self._open.pop()
        value = self._value(keys, items, "".join(text))
        if not self._open:
            self.root = value if self._opencv else {f"<{name}>": value}
            return
        refuse_many_keys(len(self._open[-1][1]) + 1)
        if not self._opencv:
            _add_element(self._open[-1][1], name, value)
        elif name == "_":
            self._open[-1][2].append(value)
        elif name in self._open[-1][1]:
            raise CalibrationError(f"the element {shown(name)} appears twice")
        else:
            self._open[-1][1][name] = value

    def _value(self, keys: dict[str, Any], items: list[Any], text: str) -> Any:
        words = list(islice(map(_xml_word, _XML_WORD.finditer(text)), MAX_NODES + 1))
        self._nodes += len(words) + 1
        if self._nodes > MAX_NODES:
            raise CalibrationError(f"holds more than {MAX_NODES:,} values, which no calibration has")
        if not self._opencv:
            return keys or (words[0] if len(words) == 1 else words)
        if sum(map(bool, (keys, items, words))) > 1:
            raise CalibrationError("expected either elements or numbers inside an element, got both")
        return keys or items or (words[0] if len(words) == 1 else words)


class Repeated(list[Any]):
    """What an element holds each time it comes."""


def _add_element(parent: dict[str, Any], name: str, value: Any) -> None:
    if isinstance(parent.get(name), Repeated):
        parent[name].append(value)
    else:
        parent[name] = Repeated([parent[name], value]) if name in parent else value


def _attribute(name: str, word: str) -> Any:
    return word if name == "label" else scalar(word)


def _xml_word(match: re.Match[str]) -> Any:
    quoted, plain = match.groups()
    return scalar(plain) if plain else quoted


def shown(value: Any) -> str:
    """A value as an error message can quote it: on one line, escaped and short."""
    text = repr(value)
    return text if len(text) <= 60 else text[:56] + " ..."
