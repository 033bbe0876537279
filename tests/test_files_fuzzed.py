"""Whatever is done to a file, it is read or refused: thousands of damaged ones."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import camviz_clinic
from camviz_clinic.files import CalibrationError, formats
from camviz_clinic.files.trees import parse

DATA = Path(__file__).parent / "data"
FILES = sorted(path for path in DATA.rglob("*") if path.is_file())
TREES = [path for path in FILES if path.suffix in (".yml", ".yaml", ".json")]
WORDS = [path for path in FILES if path.suffix in (".txt", ".xml", ".cameramodel", ".toml", ".conf", ".ini")]
EXAMPLES = {name: format.example for name, format in formats().items() if format.example}
SIZES = {"kitti_calib.txt": (1242, 375)}


def attempt(path, content):
    """Load whatever this is; anything but a calibration or a CalibrationError is a failure."""
    path.write_bytes(content)
    try:
        calibration = camviz_clinic.load(path, size=SIZES.get(path.name))
    except CalibrationError:
        return
    for camera in calibration.rig:
        assert camera.intrinsics.fx > 0
        assert np.isfinite(camera.world_from_cam.as_matrix()).all()


@pytest.fixture(scope="module")
def beside(tmp_path_factory):
    """Where the damaged copy of a file goes: under its own name, the other files of its folder beside it."""
    rooms = {folder: tmp_path_factory.mktemp("fuzz") for folder in {path.parent for path in FILES}}

    def place(original):
        room = rooms[original.parent]
        for path in FILES:
            if path.parent == original.parent != DATA:
                (room / path.name).write_bytes(path.read_bytes())
        return room / original.name

    return place


@pytest.fixture(scope="module")
def anywhere(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz") / "camera.yml"


FUZZ = settings.get_profile("damage")


@pytest.mark.sampled(15)
@pytest.mark.parametrize("original", FILES, ids=lambda path: path.name)
@FUZZ
@given(data=st.data())
def test_a_truncated_file_is_read_or_refused(beside, original, data):
    content = original.read_bytes()
    attempt(beside(original), content[: data.draw(st.integers(0, len(content) - 1))])


@pytest.mark.sampled(15)
@pytest.mark.parametrize("original", FILES, ids=lambda path: path.name)
@FUZZ
@given(data=st.data())
def test_a_file_with_bytes_overwritten_is_read_or_refused(beside, original, data):
    attempt(beside(original), overwritten(data, original.read_bytes()))


def overwritten(data, content):
    """With up to four pieces replaced."""
    content = bytearray(content)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    return bytes(content)


ODD = st.sampled_from(
    [
        "[]",
        "{}",
        "~",
        "true",
        "nothing",
        "0",
        "-1",
        "1e-300",
        "1e8",
        ".nan",
        "[1, [2, 3]]",
        "{rows: 1}",
        '""',
        "99999999999999",
    ]
)


@pytest.mark.sampled(8)
@pytest.mark.parametrize("original", TREES, ids=lambda path: path.name)
@FUZZ
@given(data=st.data())
def test_a_file_with_values_of_other_types_is_read_or_refused(beside, original, data):
    """Any one value, list or mapping of the tree becomes something else."""
    tree = parse(original.read_text())
    parent, key = data.draw(st.sampled_from(list(places(tree))))
    parent[key] = parse(data.draw(ODD))
    attempt(beside(original), flow(tree).encode())


@pytest.mark.parametrize("original", WORDS, ids=lambda path: path.name)
@FUZZ
@given(data=st.data())
def test_a_file_with_other_words_is_read_or_refused(beside, original, data):
    """Any one word becomes something else, is said twice, or is missing."""
    attempt(beside(original), reworded(data, original.read_bytes()))


def reworded(data, content):
    """With one word replaced, doubled or left out."""
    text = content.decode("latin-1")
    words = list(re.finditer(r"[-+.\w]+|[^-+.\w\s]", text))
    at = data.draw(st.sampled_from(words))
    word = data.draw(ODD | st.sampled_from(["", f"{at[0]} {at[0]}", "\n", "None", "b'x'", "(", "'", "<a>", "#"]))
    return (text[: at.start()] + word + text[at.end() :]).encode()


@pytest.mark.parametrize("name", EXAMPLES)
@FUZZ
@given(data=st.data())
def test_an_example_damaged_is_read_or_refused(anywhere, name, data):
    """The formats that are only read hold a small file each: some bytes of it, or one of its words, become others."""
    attempt(anywhere, data.draw(st.sampled_from([overwritten, reworded]))(data, EXAMPLES[name]))


def places(tree):
    """Every (container, key) of a tree."""
    for key, value in list(tree.items() if isinstance(tree, dict) else enumerate(tree)):
        yield tree, key
        if isinstance(value, (dict, list)):
            yield from places(value)


def flow(tree):
    """The tree as YAML in one line; numbers keep all digits."""
    if isinstance(tree, dict):
        return "{" + ", ".join(f'"{key}": {flow(value)}' for key, value in tree.items()) + "}"
    if isinstance(tree, list):
        return "[" + ", ".join(map(flow, tree)) + "]"
    return "~" if tree is None else f'"{tree}"' if isinstance(tree, str) else repr(tree)


@FUZZ
@given(text=st.text(max_size=200))
def test_any_text_is_refused(anywhere, text):
    attempt(anywhere, text.encode("utf-8", "surrogatepass"))


@FUZZ
@given(
    text=st.recursive(
        st.text("abc<>/&_ 1.", max_size=8), lambda inner: inner.map(lambda t: f"<a>{t}</a>"), max_leaves=9
    )
)
def test_any_xml_is_refused(anywhere, text):
    attempt(anywhere, f"<opencv_storage>{text}</opencv_storage>".encode())
