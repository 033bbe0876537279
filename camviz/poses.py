"""Rotations and rigid transforms: SciPy's, imported from here by all of camviz."""

from scipy.spatial.transform import RigidTransform, Rotation

__all__ = ["RigidTransform", "Rotation"]
