"""Memory that a picture needed goes back to the system."""

import gc
import subprocess
import sys
import weakref
from dataclasses import fields

import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.scenes import snapshot, textured_scene
from camviz.scenes.scene import _kept_rays
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz.widgets import explore
from camviz.widgets.memory import give_back
from camviz_school.views import garden_field
from camviz_school.views.exposure import ExposureView
from camviz_school.views.light_field import LightFieldView
from camviz_school.views.noise import PhotonTransferView
from camviz_school.views.omnidirectional import OmnidirectionalView

PROGRAM = """
import numpy as np, psutil
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
from camviz.widgets.memory import give_back_after_cells
give_back_after_cells()
give_back_after_cells()
rss = lambda: psutil.Process().memory_info().rss / 2**20
scraps = [np.ones(8000) for _ in range(2000)]   # 128 MB in pieces that the C library keeps for itself when freed
full = rss()
kept, scraps = scraps[-1], None
shell.events.trigger("post_run_cell", None)
print(full - rss(), len([f for f in shell.events.callbacks["post_run_cell"] if f.__name__ == "give_back"]))
"""

FAULTS = """
import resource
import numpy as np
from camviz.widgets.memory import keep_between_pictures

def pages(pictures=40):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(pictures):
        scraps = [np.ones(60_000) for _ in range(8)]   # half a megabyte each, as the arrays of a picture are
        del scraps
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

pages()
alone = pages()
keep_between_pictures()
pages()
print(alone, pages())
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="only glibc can be asked to give memory back")
def test_what_a_cell_no_longer_needs_is_given_back_after_it():
    freed, hooks = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    ).stdout.split()
    assert float(freed) > 100
    assert int(hooks) == 1


def test_the_rays_of_the_last_camera_are_given_back_too():
    snapshot(textured_scene(), Camera(Intrinsics.from_fov(32, 24, 60)))
    assert _kept_rays.cache_info().currsize == 1
    give_back()
    assert _kept_rays.cache_info().currsize == 0


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform != "linux", reason="only glibc can be asked to keep memory")
def test_a_picture_s_memory_is_that_of_the_last_one():
    """Counted in pages that the system had to clear and hand out."""
    alone, kept = subprocess.run(
        [sys.executable, "-c", FAULTS], capture_output=True, text=True, check=True
    ).stdout.split()
    assert int(kept) < int(alone) / 20


CIRCLES = """
import gc, weakref
from camviz.widgets.memory import give_back

class Ring(list):
    pass

def circle(length):
    ring = Ring()
    ring.extend([ring] for _ in range(length))
    return weakref.ref(ring)

gc.collect()
alive = []
for length in (10, 30_000):
    ring = circle(length)
    give_back()
    alive.append(ring() is not None)
print(*alive)
"""


def test_many_objects_in_a_circle_are_given_back_and_a_few_wait():
    """As matplotlib's closed figures are; Python itself would keep both until a quarter of all objects are new."""
    alive = subprocess.run([sys.executable, "-c", CIRCLES], capture_output=True, text=True, check=True).stdout.split()
    assert alive == ["True", "False"]


def test_what_a_view_has_worked_out_is_given_back_and_worked_out_again():
    view = ExposureView()
    drawn = explore(view).frame["html"]
    worked_out = vars(view).keys() - {field.name for field in fields(view)}
    assert worked_out
    give_back()
    assert not vars(view).keys() & worked_out
    assert view.figure().flow() == drawn


@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", [EpipolarView, FrustumView, LightFieldView, OmnidirectionalView, PhotonTransferView])
def test_the_garden_is_given_back_while_its_views_are_shown(kind):
    shown = explore(kind())
    garden = weakref.ref(textured_scene())
    give_back()
    gc.collect()
    assert garden() is None
    assert shown.view.figure().flow() == shown.frame["html"]


@pytest.mark.thorough
def test_light_fields_of_the_garden_are_taken_once_and_those_through_openings_given_back():
    shown = explore(LightFieldView(fence=True, opening=1.0, panels="picture views"))
    pinholes = garden_field.garden_field(True)
    give_back()
    assert garden_field.opened_field.cache_info().currsize == garden_field.all_views.cache_info().currsize == 0
    assert garden_field.garden_field(fence=True) is pinholes
    assert shown.view.figure().flow() == shown.frame["html"]
