"""Corner files: `load_corners(paths)` reads the corners of boards that another program found in pictures.

Each format is a module here that exports FORMAT, a `CornerFormat`; nothing else lists the formats.
"""

from camviz_clinic.files.corners.format import CornerFile, CornerFormat, Corners, Given
from camviz_clinic.files.corners.loading import LoadedCorners, load_corners
from camviz_clinic.files.corners.registry import corner_formats

__all__ = ["CornerFile", "CornerFormat", "Corners", "Given", "LoadedCorners", "corner_formats", "load_corners"]
