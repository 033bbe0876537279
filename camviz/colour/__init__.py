"""Colour: spectra of light, things and cameras, and what an eye and a camera make of them."""

from camviz.colour.balance import fit_matrix, grey_world, metamer, neutral, response, seen, white_patch
from camviz.colour.charts import FoundChart, find_chart
from camviz.colour.developing import developed
from camviz.colour.spaces import (
    adaptation,
    chromaticity,
    delta_e_2000,
    from_lab,
    from_srgb,
    to_lab,
    to_srgb,
    tristimulus,
)
from camviz.colour.spectra import WAVELENGTHS_NM, daylight, illuminant, observer, planckian, reflectances, sensitivities
from camviz.colour.temperature import locus_xy, xy_of_temperature

__all__ = [
    "WAVELENGTHS_NM",
    "FoundChart",
    "adaptation",
    "chromaticity",
    "daylight",
    "delta_e_2000",
    "developed",
    "find_chart",
    "fit_matrix",
    "from_lab",
    "from_srgb",
    "grey_world",
    "illuminant",
    "locus_xy",
    "metamer",
    "neutral",
    "observer",
    "planckian",
    "reflectances",
    "response",
    "seen",
    "sensitivities",
    "to_lab",
    "to_srgb",
    "tristimulus",
    "white_patch",
    "xy_of_temperature",
]
