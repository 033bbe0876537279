"""The tables of spectra, written afresh from colour-science: `python -m camviz.colour.bake`.

A reader's kernel only opens the tables: colour-science takes 100 MB and more than a second to import. Everything lies
on one grid, 380 … 780 nm in steps of 5, at which the CIE publishes its lamps; the observer goes on to where it ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array

GRID = np.arange(380, 781, 5)  # nm
WIDE = np.arange(360, 831, 5)  # all that the standard observer sees
_LICENCE = "Taken from colour-science {version}, BSD-3-Clause (see LICENSE in this folder)."


@dataclass(frozen=True)
class Table:
    """One file: where its numbers were published, its columns by name, and the wavelengths (n,) of their values."""

    source: str
    columns: Mapping[str, Array]
    nm: NDArray[np.int_] = field(default_factory=lambda: GRID)


def tables() -> dict[str, Table]:
    """Every table by its file's name."""
    import colour

    dslr = colour.MSDS_CAMERA_SENSITIVITIES
    npl = "Measured at the National Physical Laboratory; each channel is scaled to a peak of 1. M. M. Darrodi et al., "
    npl += "Reference data set for camera spectral sensitivity estimation, JOSA A 32 (2015) 381-391. "
    basis = colour.colorimetry.SDS_BASIS_FUNCTIONS_CIE_ILLUMINANT_D_SERIES
    lamps = ("A", "D50", "D65", "FL2", "FL7", "FL11", "LED-B3")
    return {
        "observer": Table(
            "Colour-matching functions of the CIE 1931 standard colorimetric observer (2 degrees). CIE 015:2018.",
            _columns(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"], ("x", "y", "z"), WIDE),
            WIDE,
        ),
        "illuminants": Table(
            "Relative spectral power of CIE illuminants A, D50, D65, fluorescent lamps FL2, FL7 and FL11, and the "
            "white LED LED-B3. CIE 015:2018.",
            {name: _sampled(colour.SDS_ILLUMINANTS[name]) for name in lamps},
        ),
        "daylight": Table(
            "The mean and the two characteristic vectors of daylight (Judd, MacAdam and Wyszecki 1964). CIE 015:2018.",
            {name: _sampled(basis[name]) for name in ("S0", "S1", "S2")},
        ),
        "chart": Table(
            "Reflectance of the 24 patches of a ColorChecker. N. Ohta, The basis of color reproduction engineering "
            "(1997), as published by the Munsell Color Science Laboratory, Rochester; the same numbers as in ISO "
            "17321-1:2012.",
            {name.partition(" (")[0]: _sampled(sd) for name, sd in colour.SDS_COLOURCHECKERS["cc_ohta"].items()},
        ),
        "nikon_5100": Table(
            f"Spectral sensitivity of a Nikon D5100. {npl}",
            _columns(dslr["Nikon 5100 (NPL)"], ("red", "green", "blue")),
        ),
        "sigma_sd_merrill": Table(
            f"Spectral sensitivity of a Sigma SD1 Merrill, whose three layers lie one above the other. {npl}Published "
            "every 10 nm from 400 to 680; straight lines in between, beyond taken as 0.",
            _columns(dslr["Sigma SDMerill (NPL)"], ("red", "green", "blue")),
        ),
        "primaries": Table(
            "Reflectances that add up to a perfect white, and that in D65 look like the red, green and blue of sRGB. "
            "I. Mallett and C. Yuksel, Spectral primary decomposition for rendering with sRGB reflectance, EGSR 2019.",
            _columns(colour.recovery.MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019, ("red", "green", "blue")),
        ),
    }


def _columns(msds: Any, names: Sequence[str], nm: NDArray[np.int_] = GRID) -> dict[str, Array]:
    """The columns of several spectra under other names."""
    return {name: _sampled(msds.signals[label], nm) for name, label in zip(names, msds.labels, strict=True)}


def _sampled(spectrum: Any, nm: NDArray[np.int_] = GRID) -> Array:
    """The values at `nm` (n,): as published where they are, straight lines in between, 0 beyond their ends."""
    values = np.interp(nm, spectrum.domain, spectrum.range, left=0, right=0)
    return np.round(values, 12) + 0.0  # colour-science's own interpolation leaves crumbs such as −1e-19


def text(table: Table) -> str:
    """The file: its source as comments, a line of names, and a line for each wavelength."""
    from colour import __version__

    comments = [table.source, _LICENCE.format(version=__version__)]
    lines = [f"# {comment}" for comment in comments] + [",".join(["nm", *table.columns])]
    rows = np.stack([table.nm, *table.columns.values()], axis=-1)
    return "\n".join(lines + [",".join(f"{value:.7g}" for value in row) for row in rows]) + "\n"


def main() -> None:
    """Write every table into the package."""
    with as_file(files("camviz.colour") / "tables") as folder:
        for name, table in tables().items():
            path = folder / f"{name}.csv"
            path.write_text(text(table), encoding="utf-8")
            print(f"{path.name:22} {len(table.columns)} columns, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
