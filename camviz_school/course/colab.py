"""What a lesson needs on Google Colab: a badge that opens it there, and one cell that installs camviz, only there."""

from __future__ import annotations

from copy import deepcopy

from camviz_school.course.notebooks import Cell, Notebook, tagged

INSTALL = """\
# On Google Colab this cell installs camviz; anywhere else it does nothing.
import subprocess
import sys

if "google.colab" in sys.modules:
    camviz = "camviz[lab] @ git+https://github.com/camviz/camviz"
    subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", camviz], check=True)
    from google.colab import output

    output.enable_custom_widget_manager()"""
"""The first code of a lesson that is prepared for Colab, in a cell tagged `colab`."""

_BADGE = "[![Open in Colab](images/colab.svg)]"
_FOLDED = {"jupyter": {"source_hidden": True}, "cellView": "form"}  # in Jupyter's front ends, and in Colab
_OPENS = "https://colab.research.google.com/github/camviz/camviz/blob/main/lessons"


def badge(file_name: str) -> str:
    """The badge that opens a lesson on Colab, as Markdown.

    >>> badge("05_distortion.ipynb").rpartition("/")[2]
    '05_distortion.ipynb)'
    """
    return f"{_BADGE}({opens(file_name)})"


def opens(file_name: str) -> str:
    """The address that opens a lesson on Colab.

    >>> opens("05_distortion.ipynb").rpartition("/")[2]
    '05_distortion.ipynb'
    """
    return f"{_OPENS}/{file_name}"


def prepared(notebook: Notebook, file_name: str) -> Notebook:
    """A copy with the badge beside Binder's and the cell above all other code; the same where it has both.

    Raises ValueError where the lesson has no badge of Binder's or no cell tagged setup.
    """
    import nbformat

    made = deepcopy(notebook)
    told = _with_badges(made)
    if badge(file_name) not in told.source:
        binder = next((line for line in told.source.split("\n") if "mybinder.org" in line), None)
        if binder is None:
            raise ValueError(f"{file_name}: expected Binder's badge in the first cell, there is none")
        told.source = told.source.replace(binder, f"{binder}\n{badge(file_name)}")
    if not tagged(made, "colab"):
        places = [number for number, cell in enumerate(made.cells) if cell.cell_type == "code"]
        if not tagged(made, "setup"):
            raise ValueError(f"{file_name}: expected a cell tagged setup, there is none")
        cell = nbformat.v4.new_code_cell(INSTALL, id="colab", metadata=deepcopy(_FOLDED) | {"tags": ["colab"]})
        made.cells.insert(places[0], cell)
    return made


def _with_badges(notebook: Notebook) -> Cell:
    """The cell that says what a lesson is about, where it has one below its first view; else its first cell."""
    return next(iter(tagged(notebook, "about")), notebook.cells[0])
