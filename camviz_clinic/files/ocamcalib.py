"""OCamCalib's calib_results.txt: Scaramuzza's polynomial, centre, stretch and image size, a line for each."""

from __future__ import annotations

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.scaramuzza import Scaramuzza
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.files.format import File, Format
from camviz_clinic.files.section import Section, agreed_size, as_size, explained
from camviz_clinic.files.text import HEAD
from camviz_clinic.files.trees import scalar

TITLE = "OCamCalib calib_results.txt"
MEANINGS = ("the polynomial", "the inverse polynomial", "the centre", "the stretch", "the image size")
MOST_WORDS = 64
INVERSE = "The file's inverse polynomial is an approximation and is passed over: the polynomial itself is inverted."


def read(file: File) -> Calibration:
    """The camera at the origin; OCamCalib's rows and columns are y and x here, and its z points backward."""
    section = _lines(file.text)
    count, *s = section.vector(MEANINGS[0], list(range(4, 9)), "a number of coefficients and as many coefficients")
    if count != len(s) or s[1] != 0 or not s[0] < 0:
        raise section.error(MEANINGS[0], "its length, s0 < 0, s1 = 0, s2 …", " ".join(f"{x:g}" for x in [count, *s]))
    row, column = section.vector(MEANINGS[2], [2], "row column")
    c, d, e = section.vector(MEANINGS[3], [3], "c d e")
    height, width = section.vector(MEANINGS[4], [2], "height width")
    size = agreed_size(as_size(width, height, MEANINGS[4]), file.size, MEANINGS[4])
    f = -s[0]
    with explained(MEANINGS[0]):
        coefficients = {f"a{k}": -x * f ** (k - 1) for k, x in enumerate(s[2:], 2)}
        lens = Scaramuzza(**coefficients, c=c, d=d, e=e)
        camera = Camera(Intrinsics(*size, f, f, column, row), lens)
    return Calibration({"camera": camera}, file.path, TITLE, notes=(INVERSE,))


def _lines(text: str) -> Section:
    """The lines of numbers, in their order; remarks between them begin with #."""
    rows: dict[str, list[object]] = {}
    for line in text.splitlines():
        if line.strip() and not line.lstrip().startswith("#"):
            if len(rows) == len(MEANINGS):
                raise CalibrationError(f"expected {len(MEANINGS)} lines of numbers, got more")
            rows[MEANINGS[len(rows)]] = [scalar(word) for word in line.split(maxsplit=MOST_WORDS)]
    return Section(rows)


FORMAT = Format(
    name="ocamcalib",
    title=TITLE,
    file="calib_results.txt",
    recognise=lambda file: "polynomial coefficients for the direct mapping" in file.text[:HEAD].lower(),
    read=read,
    models="s0 s2 s3 s4, and as far as s6; c d e",
    says="rows are y, columns x; z backward; the polynomial itself is inverted, not read inverted",
    example=b"""#polynomial coefficients for the DIRECT mapping function (ocam_model.ss in MATLAB).

5 -2.75e+02 0.000000e+00 1.25e-03 -2.5e-07 1.5e-09

#polynomial coefficients for the inverse mapping function (ocam_model.invpol in MATLAB).

3 400.0 250.0 10.0

#center: "row" and "column", starting from 0 (C convention)

241.5 318.25

#affine parameters "c", "d", "e"

1.001 -0.0008 0.0003

#image size: "height" and "width"

480 640
""",
    rank=34,
)
