"""What the tracer shows is what `Camera.project` says, what geometry says, and nothing else."""

from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from plain_scenes import AHEAD, BLUE, GREEN, RED, facing, random_rays
from scipy.spatial.transform import RigidTransform, Rotation

import camviz.lenses
from camviz.cameras import Camera, Intrinsics, look_at
from camviz.lenses.base import as_points, unit
from camviz.scenes import (
    Column,
    Ground,
    Rectangle,
    Scene,
    Sphere,
    Texture,
    Wireframe,
    board_corners,
    box,
    render,
    textured_scene,
    to_display,
    wireframe_scene,
)
from camviz.scenes.rays import TILE, Bounds, Rays


@dataclass(frozen=True)
class Fish:
    """An equidistant lens of this test's own: r = θ, up to 100° from the axis, NaN beyond."""

    def project(self, points_cam):
        points = as_points(points_cam, 3, "points_cam")
        r = np.linalg.norm(points[..., :2], axis=-1, keepdims=True)
        theta = np.arctan2(r, points[..., 2:])
        return np.where(theta < 1.75, points[..., :2] * theta / np.maximum(r, 1e-300), np.nan)

    def unproject(self, xy):
        xy = as_points(xy, 2, "xy")
        theta = np.linalg.norm(xy, axis=-1, keepdims=True)
        ray = np.concatenate([np.sinc(theta / np.pi) * xy, np.cos(theta)], axis=-1)
        return np.where(theta < 1.75, ray, np.nan)


def lenses():
    """Perspective, the fish above, and every distorting lens that camviz has."""
    examples = {
        "BrownConrady": {"k1": -0.25, "k2": 0.06, "p1": 0.002, "p2": -0.003},
        "KannalaBrandt": {"k1": 0.02, "k2": -0.01},
        "DoubleSphere": {"xi": -0.2, "alpha": 0.55},
        "UnifiedSphere": {"xi": 0.9},
        "Stereographic": {},
    }
    found = {name: kwargs for name, kwargs in examples.items() if hasattr(camviz.lenses, name)}
    named = [pytest.param(getattr(camviz.lenses, name)(**kwargs), id=name) for name, kwargs in found.items()]
    return [pytest.param(camviz.lenses.Perspective(), id="Perspective"), pytest.param(Fish(), id="Fish"), *named]


# The picture and the projection are one geometry


@pytest.mark.parametrize("lens", lenses())
def test_the_boards_corners_are_rendered_where_the_camera_projects_them(lens):
    """Corners found and refined by OpenCV in the picture, within 0.1 px of Camera.project: off-centre, fx ≠ fy, tilted.

    The refinement works on linear light that a Gaussian of one pixel has softened, as every real lens does: OpenCV
    itself errs by more than 0.1 px on edges as sharp as a pinhole's.
    """
    eye = np.array([-0.9, 0.05, 1.3])
    camera = Camera(Intrinsics(640, 480, 470, 450, 333, 228), lens, look_at(eye, board_corners().mean(axis=0)))
    expected = camera.project(board_corners())
    assert camera.sees(board_corners()).all()
    light = render(textured_scene(), camera)
    found, corners = cv2.findChessboardCornersSB(to_display(light), (9, 6), flags=cv2.CALIB_CB_EXHAUSTIVE)
    assert found
    soft = cv2.GaussianBlur(light[..., 1], (0, 0), 1.0)
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-4)
    corners = cv2.cornerSubPix(soft, corners.reshape(-1, 1, 2), (5, 5), (-1, -1), stop).reshape(-1, 2)
    errors = min((np.linalg.norm(c - expected, axis=1) for c in (corners, corners[::-1])), key=np.max)
    assert errors.max() < 0.1
    assert errors.mean() < 0.04


def test_a_camera_with_an_identity_pose_sees_the_whole_board():
    camera = Camera(Intrinsics.from_fov(640, 480, 62))
    assert camera.sees(board_corners()).all()
    assert board_corners().shape == (54, 3)


def test_neighbouring_board_corners_are_a_tenth_of_a_metre_apart():
    grid = board_corners().reshape(6, 9, 3)
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=0), axis=-1), 0.1, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=1), axis=-1), 0.1, atol=1e-12)
    along, down = grid[0, 1] - grid[0, 0], grid[1, 0] - grid[0, 0]
    assert abs(along @ down) < 1e-12


@pytest.mark.parametrize("lens", lenses())
def test_points_at_the_traced_depth_project_back_to_their_pixels(lens):
    """Depth is measured along the ray: C + depth · ray lands on the pixel it came from."""
    camera = Camera(Intrinsics(160, 120, 100, 105, 76, 61), lens, look_at((2.8, -0.8, 0.2), (0, 0.4, 4)))
    rays = camera.rays()
    _, depth = textured_scene().trace(camera.centre, rays)
    points = camera.centre + depth[..., None] * rays
    seen = np.isfinite(depth)
    assert seen.mean() > 0.4
    np.testing.assert_allclose(camera.project(points)[seen], camera.intrinsics.grid()[seen], atol=1e-3)


# Closed forms


@pytest.mark.parametrize("tilt", [0.0, 0.4, -1.1])
def test_depth_of_a_tilted_plane_is_its_closed_form(tilt):
    """t = n·p / n·d, to float32's last digits."""
    across, down = np.array([np.cos(tilt), 0, np.sin(tilt)]) * 40, np.array([0, 40.0, 0])
    point = np.array([0.3, -0.2, 5.0])
    scene = Scene([Rectangle(point - across / 2 - down / 2, across, down, RED)])
    rays = Camera(Intrinsics.from_fov(64, 48, 50)).rays()
    normal = np.cross(across, down)
    expected = (normal @ point) / (rays @ normal)
    hit = expected[..., None] * rays - point
    inside = (expected > 0) & (np.abs(hit @ across) < 800) & (np.abs(hit @ down) < 800)
    _, depth = scene.trace(np.zeros(3), rays)
    np.testing.assert_allclose(depth[inside], expected[inside], rtol=2e-5)
    assert np.isnan(depth[~inside]).all()
    assert inside.any()


def test_depth_of_a_sphere_is_its_closed_form():
    """t = b - sqrt(b² - c² + r²) with b = d·c."""
    centre, radius = np.array([0.4, -0.3, 6.0]), 1.7
    rays = Camera(Intrinsics.from_fov(64, 48, 60)).rays()
    along = rays @ centre
    inside = along**2 - centre @ centre + radius**2
    expected = along - np.sqrt(np.where(inside > 0, inside, np.nan))
    _, depth = Scene([Sphere(centre, radius, RED)]).trace(np.zeros(3), rays)
    clear = np.abs(inside) > 1e-3
    np.testing.assert_allclose(depth[clear], expected[clear], rtol=1e-5)
    assert np.isfinite(expected).sum() > 200


def test_from_inside_a_sphere_every_ray_meets_it_one_radius_away():
    _, depth = Scene([Sphere(np.array([1.0, 2, 3]), 2.5, RED)]).trace((1, 2, 3), random_rays(500))
    np.testing.assert_allclose(depth, 2.5, rtol=1e-5)


def test_the_ground_is_met_at_height_over_sine_below_the_horizon_and_never_above():
    rays = random_rays(2000)
    _, depth = Scene([Ground(1.5, GREEN)]).trace((7, 0.5, -3), rays)
    down = rays[:, 1] > 1e-3
    np.testing.assert_allclose(depth[down], 1.0 / rays[down, 1], rtol=1e-5)
    assert np.isnan(depth[rays[:, 1] < 0]).all()


def test_a_column_is_met_on_its_near_side_between_foot_and_top():
    scene = Scene([Column(np.array([0, 1.0, 4]), 2.0, 0.5, RED)])
    rays = unit(np.array([AHEAD, [0, 0.9 / 3.5, 1], [0, 1.1 / 3.5, 1], [0.51 / 4, 0, 1], [0.45 / 4, 0, 1]]))
    _, depth = scene.trace(np.zeros(3), rays)
    assert depth[0] == pytest.approx(3.5)
    assert depth[1] == pytest.approx(np.hypot(3.5, 0.9))
    assert np.isnan(depth[2:4]).any()
    assert np.isfinite(depth[4])


def test_through_an_open_column_one_sees_its_far_wall():
    """From above the rim the near wall is missed and the inside of the far one is met, at z = 4.5."""
    scene = Scene([Column(np.array([0, 1.0, 4]), 1.0, 0.5, RED)])
    ray = unit(np.array([0, 0.5 + 0.2, 4.5 - 3.0]))
    _, depth = scene.trace((0, -0.5, 3.0), ray)
    assert depth * ray[2] + 3.0 == pytest.approx(4.5, abs=1e-5)


def test_a_box_hides_nothing_and_leaks_nothing():
    """From outside, every ray towards the inside of a box meets it before that point; from inside, none gets out
    except through the floor, which it does not have."""
    scene = Scene(box((0, 1, 5), (2, 2, 2), RED, yaw=0.3))
    inside = np.add(np.random.default_rng(1).uniform(-0.6, 0.6, (500, 3)), [0, 0, 5])
    _, depth = scene.trace(np.zeros(3), unit(inside))
    assert (depth < np.linalg.norm(inside, axis=-1)).all()
    rays = random_rays(500)
    _, depth = scene.trace((0, 0, 5), rays)
    assert np.isfinite(depth[rays[:, 1] < 0]).all()


def test_a_boxes_walls_face_outwards():
    walls = box((1, 2, 3), (1, 2, 3), RED, yaw=0.7)
    centre = np.array([1, 1, 3])
    for wall in walls:
        assert (wall.corners.mean(axis=0) - centre) @ wall.normal > 0.4


# Which surface is seen


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_the_nearest_surface_wins_whatever_the_order(order):
    surfaces = [facing(2, RED), facing(3, GREEN), Sphere(np.array([0.0, 0, 2]), 0.5, BLUE)]
    light, depth = Scene([surfaces[i] for i in order]).trace(np.zeros(3), unit(np.array([AHEAD, [0.4, 0, 1]])))
    np.testing.assert_allclose(depth, [1.5, np.hypot(2, 0.8)], rtol=1e-6)
    np.testing.assert_allclose(light, [[0, 0, 1], [1, 0, 0]], atol=1e-4)


def test_a_ray_that_meets_nothing_sees_the_sky_at_no_depth():
    light, depth = Scene([facing(2)], sky=GREEN).trace(np.zeros(3), -AHEAD)
    assert np.isnan(depth)
    np.testing.assert_allclose(light, [0, 1, 0], atol=1e-4)


def test_a_scene_without_surfaces_is_all_sky():
    light, depth = Scene([], sky=BLUE).trace(np.zeros(3), random_rays(100))
    assert np.isnan(depth).all()
    np.testing.assert_allclose(light, np.tile([0, 0, 1], (100, 1)), atol=1e-4)


def test_a_ray_that_is_not_there_is_neutral_grey_at_no_depth():
    rays = np.full((5, 7, 3), AHEAD)
    rays[2, 3] = np.nan
    light, depth = Scene([facing(2)]).trace(np.zeros(3), rays)
    assert np.isnan(depth[2, 3])
    assert np.isfinite(depth).sum() == 34
    assert np.ptp(light[2, 3]) == 0
    assert 0 < light[2, 3, 0] < 0.2


def test_directions_that_are_not_unit_vectors_are_refused():
    with pytest.raises(ValueError, match="directions must be unit vectors"):
        Scene([facing(2)]).trace(np.zeros(3), [0, 0, 2])


def test_origins_that_are_nowhere_are_refused():
    with pytest.raises(ValueError, match="origins must be finite"):
        Scene([facing(2)]).trace([0, np.nan, 0], AHEAD)


def test_rays_of_any_shape_come_back_in_it():
    scene, rays = textured_scene(), random_rays(60)
    flat, flat_depth = scene.trace(np.zeros(3), rays)
    light, depth = scene.trace(np.zeros((3, 1, 1, 3)), rays.reshape(1, 4, 15, 3))
    assert light.shape == (3, 4, 15, 3)
    assert depth.shape == (3, 4, 15)
    for block in range(3):
        np.testing.assert_allclose(light[block].reshape(-1, 3), flat, atol=2e-3)
        np.testing.assert_allclose(depth[block].ravel(), flat_depth, rtol=1e-5)
    assert scene.trace(np.zeros(3), rays[0])[1].shape == ()
    assert scene.trace(np.zeros(3), rays[:0])[0].shape == (0, 3)


@pytest.mark.parametrize("shuffled", [False, True])
def test_rays_with_origins_of_their_own_see_the_same_as_from_one_centre(shuffled):
    """Whole runs of rays are ruled out by their cone: neighbours or strangers, the picture must not change."""
    rays = Camera(Intrinsics.from_fov(96, 64, 80)).rays().reshape(-1, 3)
    if shuffled:
        rays = np.random.default_rng(2).permutation(rays)
    centre = np.array([0.2, 0.1, -0.3])
    light, depth = textured_scene().trace(centre, rays)
    own_light, own_depth = textured_scene().trace(np.tile(centre, (len(rays), 1)), rays)
    np.testing.assert_allclose(own_depth, depth, rtol=1e-5)
    np.testing.assert_allclose(own_light, light, atol=5e-3)


def test_moving_an_origin_back_along_its_ray_adds_to_the_depth_alone():
    """Every ray starts elsewhere, so the cones must grow by how far the origins lie apart."""
    rays = Camera(Intrinsics.from_fov(64, 48, 70)).rays().reshape(-1, 3)
    scene = Scene([Sphere(np.array([x, y, 6.0]), 0.4, RED) for x in (-2.0, 0, 2) for y in (-1.5, 0, 1.5)])
    _, depth = scene.trace(np.zeros(3), rays)
    step = np.random.default_rng(3).uniform(0, 3, (len(rays), 1))
    _, moved = scene.trace(-step * rays, rays)
    assert np.isfinite(depth).sum() > 100
    agree = np.isfinite(depth) == np.isfinite(moved)
    assert agree.mean() > 0.995  # float32 may decide otherwise on a rim
    both = np.isfinite(depth + moved)
    np.testing.assert_allclose((moved - step[:, 0])[both], depth[both], atol=2e-2)
    assert np.median(np.abs((moved - step[:, 0])[both] - depth[both])) < 1e-5


def test_the_shadow_of_a_sphere_in_parallel_light_is_a_disc_of_its_radius():
    """Parallel rays from a wide grid: neighbours share a direction but not an origin, and none may be ruled out."""
    across, up = np.meshgrid(np.linspace(-2, 2, 201), np.linspace(-2, 2, 201))
    origins = np.stack([across, up, 0 * up], axis=-1)
    _, depth = Scene([Sphere(np.array([0.3, -0.2, 50.0]), 0.41, RED)]).trace(origins, AHEAD)
    assert np.array_equal(np.isfinite(depth), np.hypot(across - 0.3, up + 0.2) < 0.41)


def test_every_surface_is_found_from_wherever_one_looks_straight_at_it():
    """No culling error: a ray aimed at a surface's own vertices' mean meets something no farther than that."""
    scene = textured_scene()
    rng = np.random.default_rng(4)
    for mesh in scene.faces():
        if mesh.name == "ground":
            continue
        target = (mesh.vertices * rng.dirichlet(np.ones(len(mesh.vertices)))[:, None]).sum(axis=0)
        eye = np.array([0.3, -0.4, -0.5])
        _, depth = scene.trace(eye, unit(target - eye))
        assert depth < np.linalg.norm(target - eye) + 0.5


def test_outside_the_field_of_a_fisheye_the_picture_is_neutral():
    light = render(textured_scene(), Camera(Intrinsics(64, 64, 15, 15, 31.5, 31.5), Fish()))
    assert np.ptp(light[0, 0]) == 0
    assert np.ptp(light[32, 32]) > 0


# The same world as lines and as meshes


def test_outlines_are_where_the_tracer_meets_the_surface():
    """Points on the board's outline, drawn in a little, lie at the traced depth."""
    scene = textured_scene()
    outline = scene.outlines().only("board").lines[0]
    points = outline.mean(axis=0) + 0.97 * (outline[:4] - outline.mean(axis=0))
    distance = np.linalg.norm(points, axis=-1)
    _, depth = scene.trace(np.zeros(3), unit(points))
    np.testing.assert_allclose(depth, distance, rtol=0.01)


@pytest.mark.parametrize(
    "surface",
    [
        facing(3, half=0.7),
        Sphere(np.array([0.3, 0.2, 5]), 0.8, RED),
        Column(np.array([-0.2, 1, 4]), 1.5, 0.3, RED),
    ],
    ids=lambda s: type(s).__name__,
)
def test_a_meshs_vertices_lie_on_the_surface_it_stands_for(surface):
    """Rays to the vertices that face the camera, drawn in by a thousandth, end on them."""
    vertices = surface.mesh().vertices
    middle = np.mean([centre for centre, _, _ in surface.bounding_spheres()], axis=0)
    inner = middle + 0.999 * (vertices - middle)
    distance = np.linalg.norm(inner, axis=-1)
    _, depth = Scene([surface]).trace(np.zeros(3), unit(inner))
    assert np.isfinite(depth).all()
    near = depth > distance - 0.02
    assert near.mean() > 0.3
    np.testing.assert_allclose(depth[near], distance[near], atol=0.02)


def test_every_mesh_has_a_picture_and_whole_quads():
    for mesh in textured_scene().faces():
        assert mesh.picture.dtype == np.uint8
        assert mesh.uv.shape == (len(mesh.vertices), 2)
        assert mesh.quads.max() == len(mesh.vertices) - 1
        assert len(mesh.rgb) == 3


def test_the_wireframe_holds_house_ground_board_and_axes():
    wire = wireframe_scene()
    assert set(wire.names) == {"ground", "house", "board", "axis x", "axis y", "axis z"}
    np.testing.assert_allclose(wire.only("axis z").lines[0], [[0, 0, 0], [0, 0, 1]])
    corners = board_corners()
    lines = np.stack(wire.only("board").lines)
    gaps = np.linalg.norm(np.cross(corners[:, None] - lines[:, 0], unit(lines[:, 1] - lines[:, 0])), axis=-1)
    assert ((gaps < 1e-9).sum(axis=1) == 2).all()


@pytest.mark.parametrize("max_length", [0.03, 0.25, 10.0])
def test_subdividing_keeps_corners_and_length_and_leaves_no_long_piece(max_length):
    wire = wireframe_scene()
    fine = wire.subdivided(max_length)
    assert fine.names == wire.names
    for before, after in zip(wire.lines, fine.lines, strict=True):
        steps = np.linalg.norm(np.diff(after, axis=0), axis=1)
        assert steps.max() <= max_length + 1e-9
        assert steps.sum() == pytest.approx(np.linalg.norm(np.diff(before, axis=0), axis=1).sum())
        assert all(np.abs(after - corner).sum(axis=1).min() < 1e-12 for corner in before)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Rectangle(np.zeros(3), np.ones(3), 2 * np.ones(3), RED), "across and down must span an area"),
        (lambda: Rectangle(np.zeros(2), np.ones(3), np.ones(3), RED), "corner must be three finite numbers"),
        (lambda: Sphere(np.zeros(3), 0.0, RED), "radius must be a positive length in metres, got 0.0"),
        (lambda: Sphere(np.array([0, np.nan, 0]), 1.0, RED), "centre must be three finite numbers"),
        (lambda: Column(np.zeros(3), -1.0, 1.0, RED), "height must be a positive length in metres, got -1.0"),
        (lambda: Ground(1.0, RED, tile=0.0), "tile must be a positive length in metres, got 0.0"),
        (lambda: Ground(1.0, RED, sight=float("nan")), "sight must be a positive distance in metres, got nan"),
        (lambda: Texture(np.zeros((4, 4))), r"light must have shape \(height, width, 3\), got \(4, 4\)"),
        (lambda: Wireframe((np.zeros((2, 3)),), ()), "names must be one for each of 1 lines, got 0"),
        (lambda: wireframe_scene().subdivided(0), "max_length must be a positive length in metres, got 0"),
    ],
)
def test_what_cannot_be_is_refused_by_name(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_pixels_without_a_ray_are_not_traced():
    """A mirror's picture is round; what lies around it meets no surface, and that is known beforehand."""
    directions = np.full((1, 2 * TILE, 3), np.nan)
    directions[:, TILE:] = (0, 0, 1)
    rays = Rays.gather(np.zeros(3), directions)
    ball = (np.array([0.0, 0, 5]), 1.0, np.zeros(3))
    assert rays.may_intersect(Bounds.around([[ball], Ground(1.0, RED).bounding_spheres()])).tolist() == [
        [False, True],
        [False, True],
    ]


@pytest.mark.parametrize("seed", range(6))
def test_tiles_are_ruled_out_for_surfaces_that_none_of_their_rays_meets_and_for_few_others(seed):
    """Whatever the camera looks at: every surface of the garden, met ray by ray, against what the cones say."""
    rng = np.random.default_rng(seed)
    turn = Rotation.from_euler("yxz", rng.uniform(-180, 180, 3) * [1, 0.2, 0.2], degrees=True)
    pose = RigidTransform.from_components(rng.uniform((-3, -2, -1), (3, 0.5, 9)), turn)
    camera = Camera(Intrinsics.from_fov(96, 72, 80), world_from_cam=pose)
    garden = textured_scene()
    rays = Rays.gather(camera.centre, camera.rays())
    corners = {i: wall.corners for i, wall in enumerate(garden.surfaces) if isinstance(wall, Rectangle)}
    may_intersect = rays.may_intersect(
        Bounds.around([surface.bounding_spheres() for surface in garden.surfaces], corners)
    )
    tiles = rays.directions.shape[1]
    with np.errstate(all="ignore"):
        depths = [
            one.intersect(rays.origins.reshape(3, 1), rays.directions.reshape(3, -1)).depth for one in garden.surfaces
        ]
    meets = (np.array(depths) < np.inf).reshape(-1, tiles, TILE).any(axis=2)
    assert not (meets & ~may_intersect).any()
    flat = np.array(list(corners))
    assert may_intersect[flat].sum() <= 1.6 * meets[flat].sum() + tiles


def test_every_ray_begins_where_it_is_said_to():
    """Two bundles of parallel rays, one of which begins beside a wall and passes it by; each is one tile."""
    origins = np.repeat([[5.0, 0, 0], [0.0, 0, 0]], TILE, axis=0)
    wall = Rectangle(np.array([-1.0, -1, 2]), np.array([2.0, 0, 0]), np.array([0, 2.0, 0]), RED)
    _, depth = Scene([wall]).trace(origins, np.broadcast_to([0.0, 0, 1], origins.shape))
    np.testing.assert_array_equal(np.isnan(depth), np.repeat([True, False], TILE))


@pytest.mark.parametrize(("yaw", "x"), [(12, -0.6), (140, 1.0), (-60, 3.0)])
def test_surfaces_that_are_alike_look_together_as_they_do_one_by_one(yaw, x):
    """The garden's lamps and walls are traced together; a scene for each surface tells which of them is nearest."""
    garden = textured_scene()
    pose = RigidTransform.from_components([x, -0.4, 0.2], Rotation.from_euler("y", yaw, degrees=True))
    camera = Camera(Intrinsics.from_fov(160, 120, 90), world_from_cam=pose)
    light, depth = garden.trace(camera.centre, camera.rays(), spread=0.005)
    alone = [Scene([surface], garden.sky).trace(camera.centre, camera.rays(), 0.005) for surface in garden.surfaces]
    distances = np.nan_to_num([distance for _, distance in alone], nan=np.inf)
    nearest = distances.argmin(axis=0)
    np.testing.assert_allclose(np.nan_to_num(depth, nan=np.inf), distances.min(axis=0), rtol=2e-5)
    expected = np.take_along_axis(np.array([seen for seen, _ in alone]), nearest[None, ..., None], axis=0)[0]
    same = np.abs(light - expected).max(axis=-1) < 1e-3
    assert same.mean() > 0.999  # where two walls join, either may be the nearer by a rounding
