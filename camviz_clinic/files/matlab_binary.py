"""MATLAB's .mat files (level 5, which `save` writes unless told -v7.3) as a plain tree of dicts, lists and numbers.

The layout is that of "MAT-File Format", MathWorks, chapter 1. The file comes from strangers: sizes are checked against
the bytes that are there, what is compressed unfolds into a bounded buffer, and nothing is allocated on a file's word.
"""

# scipy.io.loadmat is not used. Measured with SciPy 1.17: cells nested 30,000 deep (1.4 MB) end the process with a
# segmentation fault, 184 bytes that announce 2**28 cells take 5 s and 2.1 GB, and a nested variable is read past the
# length that it announces. A check before it would have to follow every variable, its dimensions and its length:
# all of this reader but its last 40 lines.

from __future__ import annotations

import struct
import zlib
from base64 import b64decode
from collections.abc import Iterator
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np

from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files import matlab
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.section import Section
from camviz_clinic.files.text import MAX_BYTES
from camviz_clinic.files.trees import MAX_DEPTH, MAX_NODES, shown

SIGNATURE = b"MATLAB 5.0 MAT-file"
HOW = "in MATLAB, s = toStruct(params); save('camera.mat', 's', '-v7') makes one that can be read"
_HEADER = 128
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
_ENCODINGS = {16: "utf-8", 17: "utf-16", 18: "utf-32"}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_LOGICAL = 0x200
_MOST_DIMENSIONS = 32  # NumPy's bound; a file may announce millions

Part = tuple[int, bytes]  # an element's type and its data


def read(file: File) -> Calibration:
    """From the one variable that holds parameters, or the variables that are them."""
    variables = parse(file.content)
    held = [Section(each, name, file.mended) for name, each in variables.items() if isinstance(each, dict)]
    found = [each for each in [Section(variables, mended=file.mended), *held] if matlab.is_parameters(each)]
    if len(found) != 1:
        names = ", ".join(shown(name) for name in list(variables)[:6]) or "nothing"
        raise CalibrationError(
            f"expected one struct with {matlab.RADIAL}, IntrinsicMatrix or FocalLength, or with CameraParameters1 and "
            f"CameraParameters2, got {len(found)} among {names}; {HOW}"
        )
    return matlab.read_parameters(found[0], file)


def parse(content: bytes) -> dict[str, Any]:
    """The variables of a .mat file by name; CalibrationError where it stops being one."""
    if len(content) < _HEADER or content[126:128] not in (b"IM", b"MI"):
        raise CalibrationError("expected a .mat file of level 5, its header is broken")
    order = "<" if content[126:128] == b"IM" else ">"
    reader = _ElementReader(order)
    variables: dict[str, Any] = {}
    for kind, data in reader.elements(content[_HEADER:]):
        if kind == _COMPRESSED:
            kind, data = next(reader.elements(reader.inflated(data)), (0, b""))
        if kind == _MATRIX:
            name, value = reader.variable(data)
            variables[name] = value
    return variables


@dataclass
class _ElementReader:
    """Reads elements in the file's byte order, and counts what it makes of them."""

    order: str
    nodes: int = 0
    room: int = MAX_BYTES  # for what is compressed, all variables together

    def inflated(self, data: bytes) -> bytes:
        """What is compressed, within the bound that holds for a file."""
        try:
            unfolded = zlib.decompressobj().decompress(data, self.room + 1)
        except zlib.error as error:
            raise CalibrationError(f"a compressed variable is broken ({error})") from None
        self.room -= len(unfolded)
        if self.room < 0:
            raise CalibrationError(f"expected variables of at most {MAX_BYTES >> 20} MB, they unfold to more")
        return unfolded

    def elements(self, data: bytes) -> Iterator[Part]:
        """The data elements one after another: their type and bytes."""
        at = 0
        while at + 8 <= len(data):
            word, size = struct.unpack_from(f"{self.order}II", data, at)
            if word >> 16:  # small: type and size in one word, the data in the other
                kind, size, start, end = word & 0xFFFF, word >> 16, at + 4, at + 8
                if size > 4:
                    raise CalibrationError(f"a small element announces {size} bytes, it has room for 4")
            else:
                kind, start = word, at + 8
                end = start + size if kind == _COMPRESSED else start + size + (-size % 8)
                if start + size > len(data):
                    raise CalibrationError(f"an element announces {size:,} bytes, {len(data) - start:,} are left")
            yield kind, data[start : start + size]
            at = end

    def variable(self, data: bytes, depth: int = 0) -> tuple[str, Any]:
        """Name and value of one matrix element."""
        self._count(1)
        if depth > MAX_DEPTH:
            raise CalibrationError(f"expected at most {MAX_DEPTH} levels of nesting")
        if not data:
            return "", []
        parts = self.elements(data)
        flags = self._integers(parts, "class", 6)
        if not flags:
            raise CalibrationError("a variable lacks its class")
        kind, logical = flags[0] & 0xFF, bool(flags[0] & _LOGICAL)
        if kind in (_OBJECT, _FUNCTION, _OPAQUE):
            raise CalibrationError(f"expected numbers and structs, a variable is a MATLAB object; {HOW}")
        sides = self._integers(parts, "dimensions", 5)
        name = self._part(parts, "name")[1].decode("latin-1")
        return name, self._value(kind, logical, sides, parts, depth)

    def _value(self, kind: int, logical: bool, sides: list[int], parts: Iterator[Part], depth: int) -> Any:
        if not 2 <= len(sides) <= _MOST_DIMENSIONS or min(sides) < 0:
            raise CalibrationError(f"expected 2 to {_MOST_DIMENSIONS} dimensions, got {len(sides)}: {sides[:4]}")
        count = prod(sides)
        if kind == _STRUCT:
            return self._struct(count, parts, depth)
        if kind == _CELL:
            self._count(count)
            return [self._inner(parts, depth) for _ in range(count)]
        if kind == _CHAR:
            return self._words(*self._part(parts, "text"))
        if kind == _SPARSE or len(sides) > 2:
            return None  # no part of a calibration that is read
        values = self._array(*self._part(parts, "numbers"))
        if values.size != count:
            raise CalibrationError(f"expected {sides[0]} × {sides[1]} numbers, got {values.size}")
        self._count(count)
        return _listed(values.reshape(sides, order="F"), logical)

    def _struct(self, count: int, parts: Iterator[Part], depth: int) -> Any:
        (length,) = self._integers(parts, "length of names", 5)[:1] or [0]
        names = self._part(parts, "names")[1]
        if length <= 0:
            raise CalibrationError("a struct's names have no length")
        fields = [names[i : i + length].split(b"\0")[0].decode("latin-1") for i in range(0, len(names), length)]
        count = count if fields else 0
        self._count(count)
        made = [{field: self._inner(parts, depth) for field in fields} for _ in range(count)]
        return made[0] if len(made) == 1 else made

    def _inner(self, parts: Iterator[Part], depth: int) -> Any:
        kind, data = self._part(parts, "value")
        if kind != _MATRIX:
            raise CalibrationError(f"expected a value, got an element of type {kind}")
        return self.variable(data, depth + 1)[1]

    def _words(self, kind: int, data: bytes) -> str:
        if kind in _ENCODINGS:
            encoding = _ENCODINGS[kind] + ("" if kind == 16 else "-le" if self.order == "<" else "-be")
            return data.decode(encoding, errors="replace")
        return "".join(chr(code) for code in self._array(kind, data).tolist() if 0 <= code < 0x110000)

    def _integers(self, parts: Iterator[Part], what: str, expected: int) -> list[int]:
        kind, data = self._part(parts, what)
        if kind != expected:
            raise CalibrationError(f"expected integers for the {what}, got an element of type {kind}")
        values: list[int] = self._array(kind, data).tolist()
        return values

    def _array(self, kind: int, data: bytes) -> np.ndarray:
        if kind not in _NUMBERS:
            raise CalibrationError(f"expected numbers, got an element of type {kind}")
        dtype = np.dtype(self.order + _NUMBERS[kind])
        return np.frombuffer(data[: len(data) // dtype.itemsize * dtype.itemsize], dtype)

    def _part(self, parts: Iterator[Part], what: str) -> Part:
        for part in parts:
            return part
        raise CalibrationError(f"a variable ends before its {what}")

    def _count(self, more: int) -> None:
        self.nodes += more
        if self.nodes > MAX_NODES:
            raise CalibrationError(f"expected at most {MAX_NODES:,} values")


def _listed(values: np.ndarray, logical: bool) -> Any:
    """As MATLAB's jsonencode writes a matrix: rows of a matrix, a flat list for a row or column, a bare scalar."""
    listed = values.astype(bool) if logical else values
    if values.size == 1:
        return listed.ravel()[0].item()
    return listed.ravel().tolist() if 1 in values.shape else listed.tolist()


_EXAMPLE = """\
DwAAAHkAAAB4nONjYGBwYGRgYAPSHEDMxAABrFA+IxwzMhSDxVkY+KFiukDslp+cmOOTmpdekgHSFlCUmZecWZCYE5CfmVfC4JmbmJ4anFmVygADfCD7GBD2sWGx
jwlKgwAnEAvANDvUO8BoisxhKIGYw5BHoTl1UHNaHACc1xUh"""  # s.FocalLength = [500 500]; s.PrincipalPoint = [320 240]; …

FORMAT = Format(
    name="mat",
    title="MATLAB .mat",
    file="camera.mat",
    recognise=lambda file: not file.path.is_dir() and file.content.startswith(SIGNATURE),
    read=read,
    models="as `matlab`",
    says=f"as `matlab`; of level 5: {HOW}",
    example=SIGNATURE.ljust(_HEADER - 4) + b"\0\1IM" + b64decode(_EXAMPLE),
    rank=20,
)
