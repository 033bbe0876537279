"""From photons to digital numbers: each step of a sensor by itself, a function with units (EMVA 1288)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from camviz.lenses.arrays import Electrons32, ElectronsLike, Seconds
from camviz.sensors.counting import Floats, poisson, poisson_alike

Words = NDArray[np.uint16]


def convert(photons: ArrayLike, efficiency: ArrayLike, rng: np.random.Generator) -> Electrons32:
    """Electrons that light sets free, each photon with a chance of `efficiency`.

    A random number of photons, thinned at random, is again Poisson: e ~ Poisson(η μ_p).

    Args:
        photons: any shape, how many photons arrive on average.
        efficiency: any shape, η, electrons per photon.

    Source: EMVA Standard 1288, release 4.0 linear (2021).

    >>> convert(np.full(100_000, 1000), 0.6, np.random.default_rng(0)).mean().round()
    np.float32(600.0)
    """
    return poisson(np.multiply(photons, efficiency, dtype=np.float32), rng)


def leak(
    shape: tuple[int, ...], dark_current_e_per_s: float, exposure_s: Seconds, rng: np.random.Generator
) -> Electrons32:
    """Electrons that heat sets free during the exposure: Poisson(dark current · t).

    Args:
        shape: Of what is returned.
        dark_current_e_per_s: In electrons per second and pixel.

    Source: EMVA Standard 1288, release 4.0 linear (2021).

    >>> leak((500, 500), dark_current_e_per_s=2, exposure_s=10, rng=np.random.default_rng(0)).mean().round()
    np.float32(20.0)
    """
    return poisson_alike(dark_current_e_per_s * exposure_s, shape, rng)


def fill(electrons: ArrayLike, full_well_e: float) -> Electrons32:
    """What the wells hold of charges.

    Args:
        electrons: any shape, charges in electrons.
        full_well_e: The most that a well holds.

    >>> fill([9_000, 12_000], full_well_e=10_000)
    array([ 9000., 10000.], dtype=float32)
    """
    return np.minimum(electrons, full_well_e, dtype=np.float32)


def read(
    charge_e: ElectronsLike, offset_e: ElectronsLike, read_noise_e: float, rng: np.random.Generator
) -> Electrons32:
    """The signal as the amplifier reports it: with each pixel's own offset, and fresh noise each time.

    Args:
        read_noise_e: A standard deviation in electrons.

    >>> read(np.zeros(100_000), offset_e=0, read_noise_e=5, rng=np.random.default_rng(0)).std().round(1)
    np.float32(5.0)
    """
    charge = np.asarray(charge_e, dtype=np.float32)
    signal: Floats = rng.standard_normal(charge.shape, dtype=np.float32)
    signal *= np.float32(read_noise_e)
    signal += charge
    signal += np.asarray(offset_e, dtype=np.float32)
    return signal


def amplify(signal_e: ElectronsLike, gain_dn_per_e: float, offset_dn: float) -> Floats:
    """The voltage before the converter, counted in its steps: K e + offset.

    Args:
        gain_dn_per_e: K.
        offset_dn: The black level.

    Returns: any shape, in DN, not yet whole, float32.

    >>> amplify([0, 100], gain_dn_per_e=0.5, offset_dn=64)
    array([ 64., 114.], dtype=float32)
    """
    return np.multiply(signal_e, gain_dn_per_e, dtype=np.float32) + np.float32(offset_dn)


def quantise(voltage_dn: ArrayLike, bits: int) -> Words:
    """The nearest whole digital numbers; what lies beyond 0 … 2^bits - 1 is cut off.

    Args:
        voltage_dn: any shape, in DN.
        bits: Of the converter, at most 16.

    Returns: any shape, in DN, uint16.

    >>> quantise([-3, 10.4, 10.6, 9000], bits=12)
    array([   0,   10,   11, 4095], dtype=uint16)
    """
    nearest = np.asarray(np.rint(voltage_dn))
    return np.clip(nearest, 0, 2**bits - 1, out=nearest).astype(np.uint16)
