"""What stood in camviz before it became three packages is answered with its new place, which is there."""

import importlib
from importlib.util import find_spec

import pytest

import camviz

NAMES = [(name, camviz._where(name).split(" is now ")[1]) for names in camviz._MOVED.values() for name in names.split()]


@pytest.mark.parametrize(("old", "new"), NAMES)
def test_an_old_name_is_answered_with_its_place(old, new):
    sentence = f"camviz.{old} is now {new}"
    with pytest.raises(AttributeError, match=f"^{sentence}$"):
        getattr(camviz, old)
    with pytest.raises(ImportError, match=f"^{sentence}$"):
        importlib.import_module(f"camviz.{old}.anything")
    with pytest.raises(ImportError, match=f"^{sentence}$"):
        exec(f"from camviz import {old}")


@pytest.mark.parametrize("new", [new for _, new in NAMES])
def test_the_new_place_is_there(new):
    package, _, name = new.partition(".")
    assert find_spec(new) or hasattr(importlib.import_module(package), name)


def test_a_name_that_never_was_here_is_told_as_python_tells_it():
    with pytest.raises(AttributeError, match="module 'camviz' has no attribute 'lode'"):
        camviz.lode  # noqa: B018 - it raises
    with pytest.raises(ModuleNotFoundError, match=r"No module named .camviz\.lode."):
        importlib.import_module("camviz.lode")
