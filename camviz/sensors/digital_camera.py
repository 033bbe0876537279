"""The whole chain: a scene's light through a lens onto a sensor under colour filters, and out as a picture."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from math import isfinite
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from camviz.cameras import Camera
from camviz.colour.spectra import WAVELENGTHS_NM, illuminant, observer, sensitivities
from camviz.lenses.arrays import FrameLike, LinearPictureLike, Seconds, Share
from camviz.lenses.base import Array
from camviz.mosaics import BAYER, Pattern, demosaic, mosaic
from camviz.scenes.light import to_display
from camviz.scenes.scene import Scene, render
from camviz.sensors.counting import Floats
from camviz.sensors.sensor import Exposure, Sensor
from camviz.sensors.steps import Words

PLANCK_J_S, LIGHT_M_PER_S = 6.62607015e-34, 299792458.0
LUMENS_PER_WATT = 683.0  # at 555 nm: the definition of the lumen


class Channels(NamedTuple):
    """What 1 lux of white light brings to each channel, red, green, blue and unfiltered, (4,) each.

    Photons behind the filter, and the electrons that they free on average: both per second and µm².
    """

    photons: Array
    electrons: Array


@dataclass(frozen=True, eq=False)
class Shot:
    """One photograph, step by step; `balanced` and `picture` are developed when asked for.

    Attributes:
        camera: That took it.
        exposure_s: In seconds.
        light: (height, width, 3), the scene's linear light, 1 for a white wall.
        illuminance_lux: (height, width, 3), what arrives on the sensor.
        photons: (height, width), what is expected behind each pixel's own filter.
        exposure: The sensor's steps from there on.

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> camera = DigitalCamera(Camera(Intrinsics.from_fov(8, 6, 10)))
    >>> shot = camera.take(np.ones((6, 8, 3)), camera.white_exposure_s(), np.random.default_rng(0))
    >>> shot.raw.shape, shot.picture.shape
    ((6, 8), (6, 8, 3))
    """

    camera: DigitalCamera
    exposure_s: float
    light: Floats
    illuminance_lux: Floats
    photons: Floats
    exposure: Exposure

    @property
    def raw(self) -> Words:
        """The mosaic of digital numbers (height, width)."""
        return self.exposure.dn

    @cached_property
    def balanced(self) -> Array:
        """Linear light (height, width, 3), demosaiced and white-balanced; 1 where the fullest channel saturates."""
        return self.camera.developed(self.raw)

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """The photograph (height, width, 3) as sRGB bytes."""
        return to_display(self.balanced)


@dataclass(frozen=True)
class DigitalCamera:
    """A camera with a lens, a sensor and colour filters: from a scene's light to the numbers, and out as a picture.

    Where the scene's linear light is 1 it is a white, matt wall. A scene has three colours of light and no spectra: its
    red, green and blue are taken to be what the filters let through. Their peaks are published as equal, so a filter is
    taken to pass all at its peak, where the sensor's quantum efficiency, a single figure or a curve, applies.

    Args:
        camera: Where it stands and looks, its lens and its pixels.
        sensor: Behind the filters.
        pitch_um: From pixel to pixel.
        f_number: Of the lens, N.
        transmittance: The share of light that the lens lets through, above 0 and at most 1.
        pattern: Of the filters.
        filters: One of the cameras that `camviz.colour.sensitivities` knows.
        illuminant: One of the lights that `camviz.colour.illuminant` knows.
        scene_lux: On the white wall.
        temperature_c: Of the sensor.
        demosaicing: One of `camviz.mosaics.ALGORITHMS`.

    Raises: ValueError for a pitch, f-number or light that is not positive, and a transmittance outside 0 … 1.
    Source: EMVA Standard 1288, release 4.0 linear (2021), for the sensor; Szeliski (2022), section 2.3, for the chain.

    10 000 lux on a white wall are π L T / (4 N²) = 10 000 · 0.9 / 64 lux on the sensor:

    >>> from camviz.cameras import Camera
    >>> from camviz import Intrinsics
    >>> camera = DigitalCamera(Camera(Intrinsics.from_fov(9, 7, 60)), f_number=4, transmittance=0.9)
    >>> float(camera.illuminance_lux(np.ones((7, 9, 3), np.float32))[3, 4, 0])
    140.625
    """

    camera: Camera
    sensor: Sensor = field(default_factory=Sensor)
    pitch_um: float = 3.45
    f_number: float = 4.0
    transmittance: float = 0.9
    pattern: Pattern = BAYER["RGGB"]
    filters: str = "Nikon D5100"
    illuminant: str = "D65"
    scene_lux: float = 10_000.0
    temperature_c: float = 20.0
    demosaicing: str = "bilinear"

    def __post_init__(self) -> None:
        for name in ("pitch_um", "f_number", "scene_lux"):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0):
                raise ValueError(f"{name} must be positive and finite, got {value}")
        if not 0 < self.transmittance <= 1:
            raise ValueError(f"transmittance must be a share above 0 and at most 1, got {self.transmittance}")

    def shoot(self, scene: Scene, exposure_s: Seconds, rng: np.random.Generator, supersample: int = 1) -> Shot:
        """Photograph a scene.

        Args:
            supersample: Each pixel's light is the mean of supersample² rays.
        """
        return self.take(render(scene, self.camera, supersample), exposure_s, rng)

    def take(self, light: LinearPictureLike, exposure_s: Seconds, rng: np.random.Generator) -> Shot:
        """Photograph a picture of light, as `render` traces it.

        Raises: ValueError for light that has not the camera's size.
        """
        linear = np.asarray(light, dtype=np.float32)
        pixels = self.camera.intrinsics
        if linear.shape != (pixels.height, pixels.width, 3):
            raise ValueError(f"light must have shape {(pixels.height, pixels.width, 3)}, got {linear.shape}")
        lux = self.illuminance_lux(linear)
        photons, electrons = self._arriving(lux, exposure_s)
        exposure = self.sensor.collect(electrons, exposure_s, self.temperature_c, rng, photons)
        return Shot(self, exposure_s, linear, lux, photons, exposure)

    def illuminance_lux(self, light: Floats) -> Floats:
        """The light on the sensor: E = π L T cos⁴θ / (4 N²), with π L = light · scene_lux for a matt surface.

        Args:
            light: (height, width, 3), linear, 1 for a white wall.

        Returns: (height, width, 3), in lux, float32.
        """
        on_axis = self.scene_lux * self.transmittance / (4 * self.f_number**2)
        return light * (np.float32(on_axis) * self._falloff)[..., None]

    @cached_property
    def _falloff(self) -> Floats:
        """cos⁴θ of each pixel's ray (height, width); nothing where there is no ray."""
        pixels = self.camera.intrinsics
        rays = self.camera.lens.unproject(pixels.from_pixels(pixels.grid()))
        return np.nan_to_num(np.maximum(rays[..., 2], 0) ** 4).astype(np.float32)

    @cached_property
    def channels(self) -> Channels:
        """What a lux brings to red, green, blue and unfiltered pixels of this camera."""
        efficiency = self.sensor.efficiency(WAVELENGTHS_NM)
        return channels(self.illuminant, self.filters, tuple(np.asarray(efficiency).tolist()))

    def _arriving(self, lux: Floats, exposure_s: float) -> tuple[Floats, Floats]:
        """Photons behind each pixel's filter, and the electrons they are expected to free, (height, width) each."""
        gathered = mosaic(lux, self.pattern).astype(np.float32) * np.float32(exposure_s * self.pitch_um**2)
        kind = self.pattern.channels(*gathered.shape)
        photons, electrons = (np.asarray(one, dtype=np.float32).take(kind) for one in self.channels)
        return gathered * photons, gathered * electrons

    def white_exposure_s(self, share: Share = 0.8) -> Seconds:
        """The exposure at which a white wall on the axis fills the fullest channel to a share of saturation."""
        lux = self.scene_lux * self.transmittance / (4 * self.f_number**2)
        fullest = self.channels.electrons[list(self.pattern.present)].max()
        return float(share * self.sensor.saturation_e / (lux * self.pitch_um**2 * fullest))

    def developed(self, raw: FrameLike) -> Array:
        """Linear light of raw numbers: offset off, white balanced, demosaiced.

        Returns: (height, width, 3), linear; 1 where the fullest channel saturates.
        """
        electrons = (np.asarray(raw, dtype=float) - self.sensor.offset_dn) / self.sensor.gain_dn_per_e
        balance = (self._balance / self.sensor.saturation_e)[self.pattern.channels(*electrons.shape)]
        return demosaic(electrons * balance, self.pattern, self.demosaicing)

    @cached_property
    def _balance(self) -> Array:
        """Factors (4,) for red, green, blue and unfiltered pixels that make white light white, 1 for the fullest."""
        freed = self.channels.electrons
        return np.asarray(freed[list(self.pattern.present)].max() / freed, dtype=np.float64)


@lru_cache(maxsize=8)
def channels(light: str, filters: str, efficiency: tuple[float, ...]) -> Channels:
    """What 1 lux of `light` brings to each channel, with quantum efficiencies at 380, 385, … 780 nm.

    683 ∫ S V dλ = 1 lux gives the spectrum's scale, S λ/hc counts its photons. The filters' published responses are to
    power, S λ-weighted: divided by λ, and by their peak, they are the share of photons let through.
    """
    watts = illuminant(light) * np.gradient(WAVELENGTHS_NM)
    watts[[0, -1]] /= 2  # the trapezoidal rule
    watts /= LUMENS_PER_WATT * watts @ observer()[:, 1]  # per m² and lux
    flux = watts * WAVELENGTHS_NM * 1e-9 / (PLANCK_J_S * LIGHT_M_PER_S) * 1e-12  # photons / s µm²
    passed = sensitivities(filters) / WAVELENGTHS_NM[:, None]
    passed = np.column_stack([passed / passed.max(axis=0), np.ones(len(flux))])
    return Channels(flux @ passed, (flux * np.array(efficiency)) @ passed)
