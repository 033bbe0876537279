"""The laws that every lens obeys, whatever its parameters and whatever the shape of its points, and its oracles."""

from dataclasses import FrozenInstanceError
from math import atan, inf, pi, sqrt

import cv2
import lens_examples
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from camviz import lenses
from camviz.lenses import (
    LENSES,
    BrownConrady,
    Cylindrical,
    DoubleSphere,
    Equidistant,
    Equirectangular,
    Equisolid,
    ExtendedUnified,
    FieldOfView,
    KannalaBrandt,
    ModifiedBrownConrady,
    Orthographic,
    Perspective,
    Scaramuzza,
    Stereographic,
    UnifiedSphere,
    same_lenses,
)
from camviz.lenses.base import Lens, on_plane, unit

FOCAL_PX = 500
TOLERANCE = 1e-9 / FOCAL_PX  # 1e-9 px

EXAMPLES = {
    "_".join(filter(None, (name, label))): (LENSES[name](*parameters), widest_deg)
    for name, label, parameters, widest_deg in lens_examples.EXAMPLES
}

every_lens = pytest.mark.parametrize(("lens", "widest_deg"), EXAMPLES.values(), ids=EXAMPLES)
ROUND = {name: example for name, example in EXAMPLES.items() if not example[0].goes_round}
every_round_lens = pytest.mark.parametrize(("lens", "widest_deg"), ROUND.values(), ids=ROUND)


def directions(theta, azimuth):
    """Unit vectors at angles `theta` from the axis, towards `azimuth`."""
    return np.stack(
        [np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta) + 0 * azimuth], axis=-1
    )


def all_directions():
    """Over the whole sphere, crowding towards what is delicate: the axis, 90° and straight behind."""
    tiny = np.geomspace(1e-12, 1e-2, 11)
    theta = np.concatenate([[0], tiny, np.linspace(0.02, 3.12, 311), pi / 2 - tiny, pi / 2 + tiny, pi - tiny, [pi / 2]])
    return directions(theta[:, None], np.linspace(0, 2 * pi, 12, endpoint=False) + 0.1).reshape(-1, 3)


def angle_between(a, b):
    return 2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1))


# Laws


@every_lens
def test_a_point_comes_back_to_its_image(lens, widest_deg):
    """project ∘ unproject is the identity to 1e-9 px wherever a ray has an image, up to 8 focal lengths out."""
    images = lens.project(all_directions())
    images = images[np.linalg.norm(images, axis=-1) < 8]
    assert len(images) > 100
    np.testing.assert_allclose(lens.project(lens.unproject(images)), images, rtol=0, atol=TOLERANCE)


@every_lens
def test_an_image_is_either_of_one_ray_or_of_none(lens, widest_deg):
    """Over a grid of image points, a ray has length 1 and goes back to where it came from, or it is NaN altogether."""
    x = np.linspace(-4, 4, 161)
    xy = np.stack(np.meshgrid(x, x), axis=-1)
    rays = lens.unproject(xy)
    none = np.isnan(rays).any(axis=-1)
    assert np.isnan(rays[none]).all()
    np.testing.assert_allclose(np.linalg.norm(rays[~none], axis=-1), 1, rtol=0, atol=1e-14)
    np.testing.assert_allclose(lens.project(rays[~none]), xy[~none], rtol=0, atol=TOLERANCE)


@every_lens
def test_a_ray_comes_back_from_its_image(lens, widest_deg):
    """unproject ∘ project is the identity to 1e-9 radians inside the field; no two rays share an image."""
    theta = np.radians(widest_deg) * np.linspace(0, 0.97, 60)
    rays = directions(theta[:, None], np.linspace(0, 2 * pi, 24))
    images = lens.project(rays)
    assert np.isfinite(images).all()
    assert angle_between(lens.unproject(images), rays).max() < 1e-9


@every_lens
def test_whatever_has_an_image_has_it_alone(lens, widest_deg):
    """Every ray with an image comes back as itself, however near to the edge of the field it lies."""
    rays = all_directions()
    images = lens.project(rays)
    near = np.linalg.norm(images, axis=-1) < 8
    assert angle_between(lens.unproject(images[near]), rays[near]).max() < 1e-5  # the square root of a rounding error


def drawn(cls, rng):
    """A lens of a class with random parameters, many times as strong as a lens maker's: the first that it takes."""
    tangential = ("p1", "p2", "s1", "s2", "s3", "s4", "sx1", "sy1")
    while True:
        values = {}
        for name in cls.parameters():
            sizes = (0, 1e-3, 0.01, 0.03) if name in tangential else (0, 1e-8, 1e-3, 0.03, 0.3, 1)
            values[name] = rng.normal() * rng.choice(sizes)
            if name in ("tau_x", "tau_y", "d", "e"):
                values[name] = rng.uniform(-0.1, 0.1)
            if name in ("alpha", "beta", "xi", "omega", "c"):
                values[name] = rng.uniform(0.5, 1.5) if name == "c" else rng.uniform(0, 1.5)
        try:
            return cls(**values)
        except ValueError:
            continue


@pytest.mark.parametrize("cls", [cls for cls in LENSES.values() if cls.parameters()], ids=lambda cls: cls.__name__)
def test_with_any_parameters_what_has_an_image_has_a_ray_that_returns_to_it(cls, thorough):
    """Where `project` is finite, up to 8 focal lengths out, `unproject` is finite and its image is the same."""
    rng, rays = np.random.default_rng(0), all_directions()
    for _ in range(1000 if thorough else 60):
        lens = drawn(cls, rng)
        images = lens.project(rays)
        images = images[np.linalg.norm(images, axis=-1) < 8]
        back = lens.unproject(images)
        assert np.isfinite(back).all(), lens
        np.testing.assert_allclose(lens.project(back), images, rtol=0, atol=4 * TOLERANCE, err_msg=str(lens))


@pytest.mark.parametrize(
    "lens",
    [
        BrownConrady(p1=-0.236, p2=-0.196, k5=-0.0232, k6=-0.0195, s1=-0.015, s2=0.3, s3=-0.0142, tau_y=0.278),
        BrownConrady(0.42, k4=-0.0038, k5=0.023, s3=0.0104, tau_x=-0.09, tau_y=-0.09),  # images on the tilt's horizon
        ModifiedBrownConrady(0.0184, 0.0441, p2=0.54, k3=0.418),
    ],
)
def test_beside_a_tangential_fold_every_image_has_a_ray(lens):
    images = lens.project(all_directions())
    images = images[np.linalg.norm(images, axis=-1) < 8]
    assert len(images) > 500
    np.testing.assert_allclose(lens.project(lens.unproject(images)), images, rtol=0, atol=4 * TOLERANCE)


def test_scaramuzzas_polynomial_of_degree_6_has_a_ray_for_every_image():
    """The ray of (x, y) is (x, y, 1 + a2 r² + … + a6 r⁶): written down, and not solved for."""
    lens = Scaramuzza(-0.35, 0.02, -0.03, 0.01, -0.02)
    x = np.linspace(-5, 5, 41)
    xy = np.stack(np.meshgrid(x, x), axis=-1)
    r = np.hypot(*np.moveaxis(xy, -1, 0))
    expected = unit(np.dstack([xy, 1 - 0.35 * r**2 + 0.02 * r**3 - 0.03 * r**4 + 0.01 * r**5 - 0.02 * r**6]))
    assert lens.fold is None
    np.testing.assert_allclose(lens.unproject(xy), expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(lens.project(expected), xy, rtol=0, atol=1e-12)


@every_lens
@pytest.mark.parametrize("shape", [(), (1,), (0,), (5,), (2, 3), (2, 0, 3), (2, 1, 3, 2)])
def test_leading_axes_are_kept(lens, widest_deg, shape):
    points = np.random.default_rng(0).uniform([-0.2, -0.2, 1], [0.2, 0.2, 3], size=(*shape, 3))
    images = lens.project(points)
    rays = lens.unproject(images)
    assert images.shape == (*shape, 2)
    assert rays.shape == (*shape, 3)
    one_by_one = [lens.project(point) for point in points.reshape(-1, 3)]
    np.testing.assert_array_equal(images.reshape(-1, 2), np.reshape(one_by_one, (-1, 2)))


@every_lens
def test_more_points_than_a_block_are_all_projected(lens, widest_deg):
    points = np.random.default_rng(1).uniform([-0.1, -0.1, 1], [0.1, 0.1, 2], size=(40_000, 3))
    images = lens.project(points)
    np.testing.assert_array_equal(images[::1999], lens.project(points[::1999]))
    assert angle_between(lens.unproject(images), unit(points)).max() < 1e-9


@every_lens
def test_the_axis_lands_exactly_on_the_origin(lens, widest_deg):
    np.testing.assert_array_equal(lens.project([[0, 0, 1], [0, 0, 1e-9], [0, 0, 7e6]]), np.zeros((3, 2)))
    np.testing.assert_array_equal(lens.unproject([0, 0]), [0, 0, 1])


@every_lens
def test_next_to_the_axis_no_digit_is_lost(lens, widest_deg):
    """At an angle ε the image lies at r'(0) ε: the same relative position at 1e-3 of it, down to 1e-100."""
    tiny = np.geomspace(1e-100, 1e-9, 12)
    x, y = lens.project(np.stack([3 * tiny, -4 * tiny, np.ones_like(tiny)], axis=-1)).T
    np.testing.assert_allclose(x / tiny, x[-1] / tiny[-1], rtol=1e-7)
    np.testing.assert_allclose(y / tiny, y[-1] / tiny[-1], rtol=1e-7)
    rays = lens.unproject(np.stack([x, y], axis=-1))
    np.testing.assert_allclose(rays[:, 0] / tiny, 3, rtol=1e-7)


@every_lens
def test_the_distance_of_a_point_does_not_matter(lens, widest_deg):
    rays = directions(np.radians(min(widest_deg, 100)) * 0.8, np.linspace(0, 2 * pi, 12))
    for distance in (1e-6, 3.0, 1e9):
        np.testing.assert_allclose(lens.project(distance * rays), lens.project(rays), rtol=1e-12, atol=1e-13)


@every_lens
def test_what_is_no_direction_has_no_image(lens, widest_deg):
    assert np.isnan(lens.project([[0, 0, 0], [np.nan, 0, 1], [0, np.nan, 1], [0, 0, np.nan]])).all()
    assert np.isnan(lens.unproject([[np.nan, 0], [0, np.nan]])).all()


@every_round_lens
def test_straight_behind_there_is_no_image(lens, widest_deg):
    assert np.isnan(lens.project([[0, 0, -1], [0, 0, -1e9], [-0.0, 0, -1]])).all()


@every_lens
def test_wrong_shapes_are_refused_by_name(lens, widest_deg):
    with pytest.raises(ValueError, match=r"points_cam must have shape \(\.\.\., 3\), got \(2,\)"):
        lens.project([1, 2])
    with pytest.raises(ValueError, match=r"xy must have shape \(\.\.\., 2\), got \(4, 3\)"):
        lens.unproject(np.zeros((4, 3)))


@every_lens
def test_a_lens_is_a_value(lens, widest_deg):
    """Equal parameters make equal lenses with equal hashes, and nobody changes a lens."""
    lens.unproject(lens.project([0.1, 0, 1]))
    same = type(lens)(**{name: getattr(lens, name) for name in lens.__dataclass_fields__})
    assert same == lens
    assert hash(same) == hash(lens)
    with pytest.raises(FrozenInstanceError):
        lens.k1 = 0.5


def test_every_lens_has_a_name_and_examples_with_labels_of_their_own():
    assert set(LENSES.values()) == {type(lens) for lens, _ in EXAMPLES.values()}
    assert len(EXAMPLES) == len(lens_examples.EXAMPLES)


def test_the_lenses_that_camviz_has_always_had_are_found():
    assert set(LENSES) >= {
        *("perspective", "brown_conrady", "kannala_brandt", "thin_prism_fisheye", "equidistant", "equisolid"),
        *("orthographic", "stereographic", "unified_sphere", "extended_unified", "double_sphere", "field_of_view"),
        *("equirectangular", "cylindrical"),
    }
    assert [name for name in lenses.__all__ if not hasattr(lenses, name)] == []


@pytest.mark.parametrize("cls", [cls for cls in LENSES.values() if cls.__dataclass_fields__], ids=lambda c: c.__name__)
@pytest.mark.parametrize("bad", [np.nan, inf, -inf, 1e200])
def test_parameters_must_be_finite(cls, bad):
    names = list(cls.__dataclass_fields__)
    for name in names:
        with pytest.raises(ValueError, match=f"{name} must be"):
            cls(**{**dict.fromkeys(names, 0.5), name: bad})


@pytest.mark.parametrize(("lens", "parameters", "message"), lens_examples.INVALID)
def test_parameters_outside_their_published_range_are_refused(lens, parameters, message):
    with pytest.raises(ValueError, match=message):
        LENSES[lens](*parameters)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: UnifiedSphere.from_alpha(1), "alpha must be at least 0 and below 1, got 1"),
        (lambda: BrownConrady.from_coefficients([0.1] * 6), "coefficients must be 4, 5, 8, 12 or 14 numbers, got 6"),
        (lambda: BrownConrady.from_coefficients([]), "coefficients must be 4, 5, 8, 12 or 14 numbers, got 0"),
    ],
)
def test_other_ways_to_make_a_lens_refuse_what_they_cannot_take(make, message):
    with pytest.raises(ValueError, match=message):
        make()


# Where each lens ends


@pytest.mark.parametrize(
    ("lens", "edge_deg"),
    [
        (Perspective(), 90),
        (BrownConrady(), 90),
        (BrownConrady(-0.3), 46.508),  # arctan(1/√0.9)
        (BrownConrady(k4=-0.25), 63.435),  # the pole at r = 2
        (KannalaBrandt(-0.1), np.degrees(sqrt(1 / 0.3))),
        (Orthographic(), 90),
        (UnifiedSphere(0), 90),
        (UnifiedSphere(0.5), 120),  # Z > -ξ D
        (UnifiedSphere(2), 120),  # Z > -D/ξ
        (ExtendedUnified(1 / 3, 1), 120),
        (ExtendedUnified(2 / 3, 1), 120),
        (DoubleSphere(0, 2 / 3), 120),
        (DoubleSphere(0.5, 1), 116.565),  # w1 = 0, w2 = 0.5/√1.25
        (DoubleSphere(-0.5, 0), 60),  # beyond, ξ D₁ + Z < 0: no image although inside the published half-space
    ],
)
def test_the_field_ends_where_it_is_published_to_end(lens, edge_deg):
    azimuth = np.linspace(0, 2 * pi, 16)
    assert np.isfinite(lens.project(directions(np.radians(edge_deg - 0.01), azimuth))).all()
    assert np.isnan(lens.project(directions(np.radians(edge_deg + 0.01), azimuth))).all()


@pytest.mark.parametrize(
    ("lens", "radius"),
    [
        (BrownConrady(-0.3), 2 / 3 / sqrt(0.9)),  # g at the fold
        (KannalaBrandt(-0.1), 2 / 3 * sqrt(1 / 0.3)),
        (Equidistant(), pi),
        (Equisolid(), 2),
        (Orthographic(), 1),
        (UnifiedSphere(2), 1 / sqrt(3)),  # r² ≤ 1/(ξ² - 1)
        (ExtendedUnified(0.8, 1.5), 1 / sqrt(1.5 * 0.6)),  # r² ≤ 1/(β (2α - 1))
        (FieldOfView(1.2), pi / 1.2),
    ],
)
def test_no_ray_arrives_beyond_the_edge_of_the_image(lens, radius):
    azimuth = np.linspace(0, 2 * pi, 16)
    rim = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    assert np.isfinite(lens.unproject(radius * (1 - 1e-9) * rim)).all()
    assert np.isnan(lens.unproject(radius * (1 + 1e-9) * rim)).all()


FOLDING = {name: lens for name, (lens, _) in EXAMPLES.items() if lens.fold and lens.fold.angle < inf}


@pytest.mark.parametrize("lens", FOLDING.values(), ids=FOLDING)
def test_a_fold_ends_the_field_and_its_image_is_the_farthest(lens):
    """Where the tangential part of a polynomial mirrors before, the field ends there."""
    angle = lens.fold.angle
    beyond = directions(angle + np.array([1e-6, 1e-3, 0.1]), 0.0)
    assert np.isnan(lens.project(beyond)).all()
    seen = lens.project(directions(np.linspace(0, angle * (1 - 1e-9), 50), 0.0))
    radii = np.linalg.norm(seen[np.isfinite(seen[:, 0])], axis=-1)
    assert (np.diff(radii) > 0).all()
    if not any(getattr(lens, name, 0) for name in ("p1", "p2", "s1", "s2", "s3", "s4", "sx1", "sy1", "tau_x")):
        assert radii[-1] == pytest.approx(lens.fold.image, rel=1e-6)


@every_lens
def test_only_a_lens_that_can_fold_folds(lens, widest_deg):
    assert lens.can_fold or lens.fold is None


@every_lens
def test_the_same_lens_under_another_name_has_the_same_images(lens, widest_deg):
    """At its own focal length: a pinhole is Brown-Conrady without coefficients, a unified sphere with ξ is α's."""
    rays = directions(np.radians(0.9 * widest_deg) * np.linspace(0, 1, 9)[:, None], np.linspace(0, 6, 7))
    for other, scale in same_lenses(lens):
        np.testing.assert_allclose(scale * other.project(rays), lens.project(rays), rtol=1e-12, atol=1e-15)
        assert any(type(lens) is type(back) for back, _ in same_lenses(other))


@every_lens
def test_the_jacobian_foretells_how_far_an_image_moves(lens, widest_deg):
    xy = np.tan(np.radians(min(widest_deg, 60) * 0.4)) * np.array([[0.5, 0.3], [-0.2, 0.6], [0.1, -0.1]])
    step = 1e-5 * np.eye(2)
    ahead, behind = (lens.project(on_plane(xy[:, None] + way * step)) for way in (1, -1))
    numeric = np.swapaxes((ahead - behind) / 2e-5, -1, -2)
    np.testing.assert_allclose(lens.jacobian(xy), numeric, rtol=1e-5, atol=1e-7)


def test_a_point_behind_a_pinhole_has_no_image():
    assert np.isnan(Perspective().project([[1, 1, 0], [1, 1, -1], [1, 1, -1e-300]])).all()


def test_the_second_sheet_of_a_tangential_fold_has_no_image():
    """With p1 alone the determinant is (1 + 2 p1 y)(1 + 6 p1 y) on the y axis: positive again below y = -1/(2 p1)."""
    lens = BrownConrady(p1=0.1)
    assert np.linalg.det(lens.jacobian([0, -6])) > 0
    assert lens.valid([[0, -1.66], [0, -1.67], [0, -4], [0, -6]]).tolist() == [True, False, False, False]
    assert np.isnan(lens.project([0, -6, 1])).all()


def test_the_poles_of_a_panorama():
    lens = Equirectangular()
    np.testing.assert_allclose(lens.project([[0, 1, 0], [0, -3, -0.0]]), [[0, pi / 2], [0, -pi / 2]])
    np.testing.assert_allclose(lens.unproject([[0, pi / 2], [2, -pi / 2]]), [[0, 1, 0], [0, -1, 0]], atol=1e-15)
    np.testing.assert_allclose(lens.project([0, 0, -1]), [pi, 0])
    assert np.isnan(lens.unproject([[3.2, 0], [0, 1.6]])).all()
    assert np.isnan(Cylindrical().project([[0, 1, 0], [-0.0, -1, 0]])).all()
    assert np.isnan(Cylindrical().unproject([-3.2, 0])).all()


# Golden values


@pytest.mark.parametrize(
    ("lens", "radii"),
    [
        (Stereographic(), [0.535898, 1.154701, 2]),
        (Equidistant(), [0.523599, 1.047198, 1.570796]),
        (Equisolid(), [0.517638, 1, 1.414214]),
        (Orthographic(), [0.5, 0.866025, 1]),
    ],
)
def test_classical_fisheyes_at_30_60_and_90_degrees(lens, radii):
    theta = np.radians([30, 60, 90])
    np.testing.assert_allclose(lens.radial(theta), radii, atol=5e-7)
    np.testing.assert_allclose(lens.project(directions(theta, 0))[:, 0], radii, atol=5e-7)


def test_kannala_brandt_gives_the_published_pixel():
    lens = KannalaBrandt(0.00693023, -0.0013828, -0.000272596, -0.000452646)
    pixel = lens.project([1, 2, 5]) * [379.045, 379.008] + [505.512, 509.969]
    np.testing.assert_allclose(pixel, [576.882637, 652.696340], atol=5e-7)


@pytest.mark.parametrize("form", ["unified", "extended", "double"])
def test_three_spheres_give_the_published_pixels(form):
    """The unified sphere's published α form; EUCM with β = 1 and the double sphere with ξ = 0 are the same lens."""
    alpha, f = 0.6291060871161842, np.array([191.14799816648748, 191.13150946585135])
    lens, scale = {
        "unified": (UnifiedSphere.from_alpha(alpha), f / (1 - alpha)),
        "extended": (ExtendedUnified(alpha, 1), f),
        "double": (DoubleSphere(0, alpha), f),
    }[form]
    pixels = lens.project([[1, 2, 5], [10, 0, -1]]) * scale + [254.95857715233118, 256.8815466235898]
    np.testing.assert_allclose(pixels, [[291.022703, 329.003576], [576.132373, 256.881547]], atol=5e-7)


def test_the_unified_sphere_at_one_is_the_stereographic_projection_at_half_scale():
    rays = directions(np.linspace(0, 2.9, 30)[:, None], np.linspace(0, 6, 7))
    np.testing.assert_allclose(2 * UnifiedSphere(1).project(rays), Stereographic().project(rays), rtol=1e-12)


@pytest.mark.parametrize("lens", [UnifiedSphere(1), ExtendedUnified(0.5, 1), DoubleSphere(0, 0.5)])
def test_straight_backwards_the_spheres_lose_no_digit_that_the_stereographic_lens_keeps(lens):
    off_axis = np.geomspace(1e-15, 0.1, 15)
    rays = np.stack([off_axis, 0 * off_axis, -np.ones(15)], axis=-1)
    exact = 2 * (np.hypot(off_axis, 1) + 1) / off_axis  # 2 tan(θ/2) = 2 (D - Z) / R
    focal_length = 2 if isinstance(lens, UnifiedSphere) else 1
    np.testing.assert_allclose(focal_length * lens.project(rays)[:, 0], exact, rtol=1e-15)


def test_a_vanishing_field_of_view_parameter_is_a_pinhole():
    points = np.random.default_rng(2).uniform([-1, -1, 0.5], [1, 1, 2], size=(100, 3))
    np.testing.assert_allclose(FieldOfView(1e-7).project(points), Perspective().project(points), rtol=1e-12)


# Oracles

coefficient = st.floats(-0.05, 0.05)


@pytest.mark.parametrize("count", [4, 5, 8, 12, 14])
@settings(max_examples=40, deadline=None, derandomize=True)
@given(data=st.data())
def test_brown_conrady_agrees_with_opencv(count, data):
    """To 1e-9 px for any coefficients, wherever the lens says that there is an image."""
    coefficients = data.draw(st.lists(coefficient, min_size=count, max_size=count))
    lens = BrownConrady.from_coefficients(coefficients)
    points = np.random.default_rng(3).uniform([-0.7, -0.6, 1], [0.7, 0.6, 1.5], size=(200, 3))
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array(coefficients))[0].reshape(-1, 2)
    np.testing.assert_allclose(lens.distort(points[:, :2] / points[:, 2:]), expected, rtol=0, atol=TOLERANCE)
    images = lens.project(points)
    seen = np.isfinite(images[:, 0])
    np.testing.assert_allclose(images[seen], expected[seen], rtol=0, atol=TOLERANCE)
    np.testing.assert_allclose(lens.project(lens.unproject(images[seen])), images[seen], rtol=0, atol=TOLERANCE)


mild = st.one_of(st.just(0.0), st.floats(-0.5, 0.5), st.floats(-1e-6, 1e-6))
wild = st.one_of(mild, st.floats(-1e4, 1e4))
any_coefficients = st.tuples(
    wild, wild, mild, mild, *[wild] * 4, *[mild] * 4, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(any_coefficients)
@example((0, 0, 1000, 0))
@example((0, 0, 0, 0, -1e4, 0, 0, 1e4, 0, 0, 0, 0, 0.3, 0))
def test_no_coefficients_however_wild_make_brown_conrady_lie(coefficients):
    """What it calls valid has a positive Jacobian and has one image; what it unprojects goes back to 2e-9 px."""
    lens = BrownConrady(*coefficients)
    rays = directions(np.arctan(np.geomspace(1e-4, 3, 40))[:, None], np.linspace(0, 2 * pi, 9)).reshape(-1, 3)
    ideal = rays[:, :2] / rays[:, 2:]
    valid = lens.valid(ideal)
    assert (np.linalg.det(lens.jacobian(ideal[valid])) > -1e-9).all()
    images = lens.project(rays)
    assert (np.isfinite(images[:, 0]) == valid).all()
    images = images[np.linalg.norm(images, axis=-1) < 8]
    assert not (np.linalg.norm(lens.project(lens.unproject(images)) - images, axis=-1) > 2 * TOLERANCE).any()


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.lists(st.floats(-0.03, 0.03), min_size=4, max_size=4))
def test_kannala_brandt_agrees_with_opencv_inside_the_hemisphere(coefficients):
    lens = KannalaBrandt(*coefficients)
    rays = directions(np.linspace(0, 1.5, 40)[:, None], np.linspace(0, 6, 7)).reshape(-1, 3)
    K, D, origin = np.eye(3), np.array(coefficients), np.zeros(3)
    expected = cv2.fisheye.projectPoints(rays[None], origin, origin, K, D)[0].reshape(-1, 2)
    images = lens.project(rays)
    seen = np.isfinite(images[:, 0])
    assert seen.sum() > 100
    np.testing.assert_allclose(images[seen], expected[seen], rtol=0, atol=TOLERANCE)
    assert angle_between(lens.unproject(images[seen]), rays[seen]).max() < 1e-6


def test_beyond_the_hemisphere_opencv_mirrors_and_kannala_brandt_does_not():
    ray = directions(np.radians(100), 0)
    mirrored = cv2.fisheye.projectPoints(ray[None, None], np.zeros(3), np.zeros(3), np.eye(3), np.zeros(4))[0].ravel()
    np.testing.assert_allclose(np.abs(mirrored), [np.radians(80), 0], atol=1e-12)
    np.testing.assert_allclose(KannalaBrandt().project(ray), [np.radians(100), 0], atol=1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(st.floats(0, 3), st.lists(coefficient, min_size=4, max_size=4))
def test_the_unified_sphere_agrees_with_opencv(xi, coefficients):
    lens = UnifiedSphere(xi, *coefficients)
    rays = directions(np.linspace(0, 1.4, 40)[:, None], np.linspace(0, 6, 7)).reshape(-1, 3)
    expected = cv2.omnidir.projectPoints(
        rays[None], np.zeros(3), np.zeros(3), np.eye(3), float(xi), np.array([coefficients])
    )[0].reshape(-1, 2)
    images = lens.project(rays)
    seen = np.isfinite(images[:, 0])
    assert seen.sum() > 50
    np.testing.assert_allclose(images[seen], expected[seen], rtol=0, atol=TOLERANCE)


COLMAP = [
    ("OPENCV", BrownConrady(-0.2, 0.05, 1e-3, -2e-3), [-0.2, 0.05, 1e-3, -2e-3], 55),
    ("FULL_OPENCV", EXAMPLES["brown_conrady_8"][0], [0.5, 0.1, 1e-3, -5e-4, 0.01, 0.6, 0.2, 0.02], 55),
    ("OPENCV_FISHEYE", KannalaBrandt(0.01, -0.002, 3e-4, -4e-4), [0.01, -0.002, 3e-4, -4e-4], 85),
    ("FISHEYE", Equidistant(), [], 85),
    ("THIN_PRISM_FISHEYE", EXAMPLES["thin_prism_fisheye"][0], [0.02, -0.01, 1e-3, -5e-4, 2e-3, -3e-4, 1e-3, -2e-3], 85),
    ("FOV", FieldOfView(0.93), [0.93], 85),
    ("EUCM", ExtendedUnified(0.6, 1.1), [0.6, 1.1], 85),
]


@pytest.mark.parametrize(("model", "lens", "parameters", "widest_deg"), COLMAP, ids=[row[0] for row in COLMAP])
def test_lenses_agree_with_colmap(model, lens, parameters, widest_deg):
    """COLMAP puts the centre of the first pixel at 0.5."""
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap, the oracle of this test, is not installed")
    camera = pycolmap.Camera(model=model, width=640, height=480, params=[500, 510, 320.5, 240.5, *parameters])
    rays = directions(np.radians(widest_deg) * np.linspace(0, 1, 40)[:, None], np.linspace(0, 6, 7)).reshape(-1, 3)
    expected = camera.img_from_cam(rays) - 0.5
    np.testing.assert_allclose(lens.project(rays) * [500, 510] + [320, 240], expected, rtol=0, atol=1e-9)


def test_a_panorama_agrees_with_colmap():
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap, the oracle of this test, is not installed")
    camera = pycolmap.Camera(model="EQUIRECTANGULAR", width=640, height=320, params=[640, 320])
    rays = all_directions()
    expected = camera.img_from_cam(rays) - 0.5
    pixels = Equirectangular().project(rays) * [640 / (2 * pi), 320 / pi] + [319.5, 159.5]
    np.testing.assert_allclose(pixels, expected, rtol=0, atol=1e-9)


# Brown-Conrady's own


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name.startswith("brown_conrady")])
def test_jacobians_agree_with_finite_differences(name):
    lens = EXAMPLES[name][0]
    xy = np.random.default_rng(4).uniform(-0.5, 0.5, size=(50, 2))
    step = 1e-6 * np.eye(2)
    numeric = (lens.distort(xy[:, None] + step) - lens.distort(xy[:, None] - step)) / 2e-6
    np.testing.assert_allclose(lens.jacobian(xy), np.swapaxes(numeric, -1, -2), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("name", [name for name in EXAMPLES if name.startswith("brown_conrady")])
def test_closed_derivatives_are_those_of_differences(name):
    """By the ray and by every coefficient: those of `Lens`, which knows only what `project_unchecked` answers."""
    lens, widest_deg = EXAMPLES[name]
    reach = 0.7 * np.tan(np.radians(min(widest_deg, 40)))
    rays = unit(on_plane(np.random.default_rng(5).uniform(-reach, reach, size=(2, 25, 2))))
    np.testing.assert_allclose(lens.ray_jacobian(rays), Lens.ray_jacobian(lens, rays), rtol=1e-8, atol=1e-8)
    for parameter in lens.parameters():
        ours, theirs = (
            each(lens, parameter, rays) for each in (type(lens).parameter_jacobian, Lens.parameter_jacobian)
        )
        np.testing.assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8, err_msg=parameter)


def test_the_jacobian_keeps_leading_axes():
    lens = EXAMPLES["brown_conrady_14"][0]
    assert lens.jacobian([0.1, 0.2]).shape == (2, 2)
    assert lens.jacobian(np.zeros((3, 0, 2))).shape == (3, 0, 2, 2)
    assert lens.valid([0.1, 0.2]).shape == ()


def test_the_raw_polynomial_goes_on_beyond_its_fold():
    """k1 = -0.3 turns back at r = 1.0541 (46.5°): there g has its maximum, and beyond it two rays share a pixel."""
    lens = BrownConrady(-0.3)
    assert round(lens.fold_radius, 4) == 1.0541
    assert round(np.degrees(atan(lens.fold_radius)), 1) == 46.5
    assert lens.radial(lens.fold_radius) > lens.radial(lens.fold_radius + 1e-3)
    np.testing.assert_allclose(lens.distort([1.5, 0]), [1.5 * (1 - 0.3 * 2.25), 0])
    assert np.isnan(lens.project([1.5, 0, 1])).all()


def test_strong_pincushion_is_inverted_where_opencvs_default_stops_short():
    """cv2.undistortPoints with its 5 iterations returned 0.35 for a true 2.0 at k1 = 0.5."""
    lens = BrownConrady(k1=0.5)
    ray = lens.unproject(lens.distort([2.0, 0]))
    assert ray[0] / ray[2] == pytest.approx(2.0, abs=1e-12)


def test_coefficients_in_a_row_or_a_column_are_in_opencvs_order():
    lens = BrownConrady.from_coefficients(np.arange(1, 15)[:, None] / 100)
    assert (lens.k1, lens.k2, lens.p1, lens.p2, lens.k3, lens.tau_y) == (0.01, 0.02, 0.03, 0.04, 0.05, 0.14)
    assert BrownConrady.from_coefficients([1, 2, 3, 4]) == BrownConrady(1, 2, 3, 4)
