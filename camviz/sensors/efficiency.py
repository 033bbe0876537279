"""Quantum efficiency by wavelength."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from camviz.lenses.arrays import NanometresLike


@dataclass(frozen=True)
class EfficiencyCurve:
    """Quantum efficiency by wavelength; straight lines between the values, nothing beyond them.

    Args:
        wavelength_nm: Increasing.
        value: Electrons per photon, 0 … 1.

    Raises:
        ValueError: For fewer than two values or unequal numbers of them, wavelengths that do not increase, and values
            outside 0 … 1.

    >>> EfficiencyCurve((400, 600), (0.2, 0.6)).at([300, 500, 600])
    array([0. , 0.4, 0.6])
    """

    wavelength_nm: tuple[float, ...]
    value: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.wavelength_nm) < 2 or len(self.wavelength_nm) != len(self.value):
            raise ValueError(
                f"wavelength_nm and value must be equally many, two or more, "
                f"got {len(self.wavelength_nm)} and {len(self.value)}"
            )
        if not np.all(np.diff(self.wavelength_nm) > 0):
            raise ValueError(f"wavelength_nm must increase, got {self.wavelength_nm}")
        if not all(0 <= value <= 1 for value in self.value):
            raise ValueError(f"value must hold efficiencies between 0 and 1, got {self.value}")

    def at(self, wavelength_nm: NanometresLike) -> Any:
        """The efficiency at wavelengths.

        Returns: array (...), electrons per photon, 0 … 1.
        """
        return np.interp(np.asarray(wavelength_nm, dtype=float), self.wavelength_nm, self.value, left=0.0, right=0.0)
