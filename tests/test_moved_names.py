"""What once stood elsewhere is answered with its new place, which is there."""

import importlib
from importlib.util import find_spec

import pytest

import camviz

OLD = [f"{old}.{name.partition(':')[0]}" for old, _, names in camviz._MOVED for name in names.split()]
NAMES = [(name, camviz._where(name).split(" is now ")[1]) for name in OLD]


@pytest.mark.parametrize(("old", "new"), NAMES)
def test_an_old_name_is_answered_with_its_place(old, new):
    sentence, (place, _, name) = f"{old} is now {new}", old.rpartition(".")
    if place.partition(".")[0] == "camviz":
        with pytest.raises(AttributeError, match=f"^{sentence}$"):
            getattr(importlib.import_module(place), name)
    with pytest.raises(ImportError, match=f"^{sentence}$"):
        importlib.import_module(f"{old}.anything")
    with pytest.raises(ImportError, match=f"^{sentence}$"):
        exec(f"from {place} import {name}")


@pytest.mark.parametrize("new", [new for _, new in NAMES])
def test_the_new_place_is_there(new):
    package, _, name = new.rpartition(".")
    assert find_spec(new) or hasattr(importlib.import_module(package), name)


@pytest.mark.parametrize("part", ["camviz", "camviz.optics", "camviz.scenes", "camviz.sensors", "camviz.views"])
def test_a_name_that_never_was_here_is_told_as_python_tells_it(part):
    with pytest.raises(AttributeError, match=f"module '{part}' has no attribute 'lode'"):
        importlib.import_module(part).lode  # noqa: B018 - it raises
    with pytest.raises(ModuleNotFoundError, match=rf"No module named .{part}\.lode."):
        importlib.import_module(f"{part}.lode")
