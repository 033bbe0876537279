"""What is kept from one picture to the next has a bound."""

import ast
import gc
import weakref
from pathlib import Path

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.scenes import snapshot, textured_scene
from camviz.scenes.scene import _kept_rays
from camviz.views.distortion import DistortionView
from camviz.widgets import explore

ROOT = Path(__file__).resolve().parents[1]
SOURCES = [path for folder in ("camviz", "lessons/material") for path in sorted((ROOT / folder).rglob("*.py"))]


def test_a_cache_without_a_bound_knows_nothing_but_words():
    """Themes, classes of the style sheet, names of tables: few there are. Numbers, cameras and arrays have no end."""
    unbounded = []
    for path in SOURCES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef) and {"cache", "lru_cache(maxsize=None)"} & _decorators(node):
                unbounded += [f"{path.name}: {node.name}({ast.unparse(node.args)})"] * _takes_more_than_words(node.args)
    assert unbounded == []


def _decorators(function):
    return {ast.unparse(each) for each in function.decorator_list}


def _takes_more_than_words(arguments):
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    return any(each.annotation is None or ast.unparse(each.annotation) != "str" for each in every)


def test_only_the_last_camera_s_rays_are_kept():
    for width in (32, 40):
        snapshot(textured_scene(), Camera(Intrinsics.from_fov(width, 24, 60)))
    assert _kept_rays.cache_info().currsize == 1


def test_an_explorer_keeps_its_first_view_and_the_present_one():
    shown, seen = explore(DistortionView()), []
    for k1 in np.linspace(-0.2, 0.2, 9).tolist():
        shown.k1 = k1
        seen.append(weakref.ref(shown.view))
    gc.collect()
    assert [view() for view in seen if view()] == [shown.view]
