"""The garden's quick pictures against traced ones, and the connection that carries them."""

import asyncio
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt, Perspective
from camviz.views import garden
from camviz_school import server

VIEW = Intrinsics.from_fov(640, 480, 90).within(garden.DRAFT)


@pytest.mark.parametrize("lens", [Perspective(), BrownConrady(-0.28, 0.07), BrownConrady(0.3), KannalaBrandt()])
def test_a_glimpse_shows_what_the_tracer_shows(lens):
    camera = Camera(VIEW, lens, RigidTransform.from_rotation(Rotation.from_euler("y", 20, degrees=True)))
    traced, _ = garden.taken(camera, garden.DRAFT)
    softened = cv2.GaussianBlur(traced, (0, 0), 0.7)
    assert cv2.PSNR(cv2.GaussianBlur(garden.glimpse(camera), (0, 0), 0.7), softened) > 29
    turned = camera.at(RigidTransform.from_rotation(Rotation.from_euler("y", 20.5, degrees=True)))  # one pixel aside
    assert cv2.PSNR(garden.glimpse(turned), softened) < 27


def test_a_camera_that_turns_where_it_stands_is_drafted_from_the_all_round_picture_of_that_place():
    """The first draft from a place is traced, for the camera may be on its way; the second is the same, but softer.

    At the origin, where a view begins, the first is such a one already: its all-round picture is kept in a file.
    """
    garden._drafts_from.cache_clear()
    here = Camera(VIEW)
    np.testing.assert_array_equal(garden.drafted(here)[0], garden.glimpse(here))
    for place in ([-0.6, -0.5, 0.2], [1.2, -0.3, 0.9]):
        camera = Camera(VIEW, world_from_cam=RigidTransform.from_translation(place))
        first, again = garden.drafted(camera)[0], garden.drafted(camera)[0]
        np.testing.assert_array_equal(first, garden.taken(camera, garden.DRAFT)[0])
        np.testing.assert_array_equal(again, garden.glimpse(camera))
        soft_first, soft_again = (cv2.GaussianBlur(picture, (0, 0), 1.0) for picture in (first, again))
        assert cv2.PSNR(soft_first, soft_again) > 28


def test_a_glimpse_has_a_join_behind_the_camera_that_nobody_sees():
    back = RigidTransform.from_rotation(Rotation.from_euler("y", 180, degrees=True))
    near = Intrinsics.from_fov(208, 156, 15)  # each texel of the all-round picture spreads over several pixels
    seen = garden.glimpse(Camera(near, Perspective(), back)).astype(int)
    step = np.abs(np.diff(seen, axis=1)).mean(axis=(0, 2))
    assert step[near.width // 2 - 8 : near.width // 2 + 8].max() < 2 * np.median(step) + 1


def test_pixels_without_a_ray_are_grey_in_a_glimpse_as_in_a_traced_picture():
    camera = Camera(VIEW, BrownConrady(-0.6))
    traced, _ = garden.taken(camera, garden.DRAFT)
    assert np.isnan(camera.rays()[0, 0]).all()
    np.testing.assert_array_equal(garden.glimpse(camera)[0, 0], traced[0, 0])


def test_the_server_sends_pictures_without_waiting_for_the_browsers_acknowledgement():
    calls = []

    class Connection:
        websocket_handler = SimpleNamespace(set_nodelay=lambda on: calls.append(("nodelay", on)))

        def connect(self):
            calls.append(("connect",))
            return "connected"

    app = SimpleNamespace(
        kernel_websocket_connection_class=Connection,
        web_app=SimpleNamespace(settings={}),
        contents_manager=SimpleNamespace(get=None),
    )
    server._load_jupyter_server_extension(app)
    assert app.web_app.settings["kernel_websocket_connection_class"]().connect() == "connected"
    assert calls == [("nodelay", True), ("connect",)]


def test_the_server_hands_out_notebooks_with_the_python_that_runs_here():
    """As JupyterLab would otherwise write into each notebook that it opens, and call it unsaved."""

    def at_once(language):
        return {"type": "notebook", "content": {"metadata": {"language_info": {"name": language, "version": "0"}}}}

    async def later(language):
        return at_once(language)

    here = {"name": "python", "version": sys.version.split()[0]}
    for get, model in (
        (at_once, server.naming_this_python(at_once)("python")),
        (later, asyncio.run(server.naming_this_python(later)("python"))),
    ):
        assert model["content"]["metadata"]["language_info"] == here, get
    assert server.naming_this_python(at_once)("julia") == at_once("julia")
    directory = {"type": "directory", "content": []}
    assert server.naming_this_python(lambda path: directory)("") is directory


def test_an_installation_leaves_other_jupyter_servers_alone():
    """Only `camviz lab` switches the extension on, for the server that it starts."""
    assert server._jupyter_server_extension_points()[0]["module"] == "camviz_school.server" == server.__name__
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    assert "shared-data" not in project["tool"]["hatch"]["build"]["targets"]["wheel"]
