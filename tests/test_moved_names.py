"""What stood elsewhere before camviz became three packages is answered with its new place, which is there."""

import importlib
from importlib.util import find_spec

import pytest

import camviz

NAMES = [
    (f"{old}.{name}", camviz._where(f"{old}.{name}").split(" is now ")[1])
    for (old, _), names in camviz._MOVED.items()
    for name in names.split()
]


@pytest.mark.parametrize(("old", "new"), NAMES)
def test_an_old_name_is_answered_with_its_place(old, new):
    sentence, (package, _, name) = f"{old} is now {new}", old.rpartition(".")
    with pytest.raises(ImportError, match=f"^{sentence}$"):
        importlib.import_module(f"{old}.anything")
    with pytest.raises(ImportError, match=f"^{sentence}$"):
        exec(f"from {package} import {name}")


@pytest.mark.parametrize(("old", "new"), [one for one in NAMES if one[0].count(".") == 1])
def test_an_old_name_of_the_package_itself_is_answered_where_it_is_looked_up(old, new):
    with pytest.raises(AttributeError, match=f"^{old} is now {new}$"):
        getattr(camviz, old.partition(".")[2])


@pytest.mark.parametrize("new", [new for _, new in NAMES])
def test_the_new_place_is_there(new):
    package, _, name = new.rpartition(".")
    assert find_spec(new) or hasattr(importlib.import_module(package), name)


def test_a_name_that_never_was_here_is_told_as_python_tells_it():
    with pytest.raises(AttributeError, match="module 'camviz' has no attribute 'lode'"):
        camviz.lode  # noqa: B018 - it raises
    with pytest.raises(ModuleNotFoundError, match=r"No module named .camviz\.lode."):
        importlib.import_module("camviz.lode")
