"""The views that one lesson alone uses; their files lie beside the lesson, in lessons/material/NN.

A lesson imports one as it imports any other module: `from camviz_school.views.pinhole import PinholeView`. Therefore no
two lessons have files of the same name. `exercises`, which every lesson has, is loaded by
`camviz_school.course.material.module`.
"""

from camviz_school.course.material import material

__path__ = [str(folder) for folder in sorted(material().glob("[0-9][0-9]"))]
