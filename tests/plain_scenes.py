"""Squares in plain colours, and rays all over."""

import numpy as np

from camviz.lenses.base import unit
from camviz.scenes import Rectangle, Texture

RED, GREEN, BLUE = (Texture(np.eye(3)[i].reshape(1, 1, 3)) for i in range(3))
AHEAD = np.array([0.0, 0.0, 1.0])


def random_rays(n, seed=0):
    return unit(np.random.default_rng(seed).normal(size=(n, 3)))


def facing(z, texture=RED, half=1.0, **kwargs):
    """A square at distance z in front of the origin."""
    corner = np.array([-half, -half, z])
    return Rectangle(corner, np.array([2 * half, 0, 0]), np.array([0, 2 * half, 0]), texture, **kwargs)
