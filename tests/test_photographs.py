"""Photographs inside wheels: there without a network, each with its licence."""

import subprocess
import sys

import numpy as np
import pytest

from camviz.scenes.photographs import PHOTOGRAPHS, photograph, photograph_credit

# Shapes as scikit-image documents them in skimage.data; mean colour read with an independent decoder.
SHAPES = {"astronaut": (512, 512), "camera": (512, 512), "chelsea": (300, 451), "coffee": (400, 600)}
SHAPES |= {"rocket": (427, 640), "brick": (512, 512), "grass": (512, 512), "gravel": (512, 512)}


def test_the_list_of_photographs_is_complete():
    assert set(PHOTOGRAPHS) == set(SHAPES)


@pytest.mark.parametrize("name", SHAPES)
def test_a_photograph_is_rgb_bytes_of_its_published_size(name):
    picture = photograph(name)
    assert picture.shape == (*SHAPES[name], 3)
    assert picture.dtype == np.uint8
    assert picture.std() > 10


@pytest.mark.parametrize("name", ["astronaut", "coffee", "chelsea", "camera", "brick"])
def test_a_photograph_equals_what_scikit_image_reads(name):
    """An independent reader, and the same bytes: red is red."""
    data = pytest.importorskip("skimage.data")
    expected = getattr(data, name)()
    assert np.array_equal(
        photograph(name), expected if expected.ndim == 3 else np.repeat(expected[..., None], 3, axis=2)
    )


@pytest.mark.parametrize("name", SHAPES)
def test_every_photograph_names_its_licence(name):
    assert any(licence in photograph_credit(name) for licence in ("CC0", "public domain"))


@pytest.mark.parametrize("function", [photograph, photograph_credit])
def test_an_unknown_name_is_answered_with_the_known_ones(function):
    with pytest.raises(ValueError, match=r"astronaut, .*rocket, got 'lena'"):
        function("lena")


def test_reading_a_photograph_does_not_import_what_scikit_image_is_made_of():
    code = (
        "import sys; from camviz.scenes.photographs import photograph; photograph('brick'); "
        "print('skimage.io' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
