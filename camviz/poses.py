"""Rotations and rigid transforms: SciPy's, imported from here by all of camviz."""

from scipy.spatial.transform import RigidTransform, Rotation

__all__ = ["OPENGL", "RigidTransform", "Rotation"]

OPENGL = RigidTransform.from_rotation(Rotation.from_matrix([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]]))
"""From axes x right, y down, z forward to OpenGL's, y up and z backward, and the other way round."""
