"""Image sensors: what turns light into numbers, after EMVA Standard 1288, release 4.0 (linear)."""

from camviz.sensors.correction import NoiseModel, average, flattened, less_dark, merged, smoothed
from camviz.sensors.counting import poisson
from camviz.sensors.dark import band_gap_ev, dark_current_ratio, doubling_temperature_k
from camviz.sensors.digital_camera import DigitalCamera, Shot
from camviz.sensors.efficiency import EfficiencyCurve
from camviz.sensors.fixed_pattern import FixedPattern
from camviz.sensors.published import PUBLISHED, SHUTTERS, MeasuredShutter, PublishedSensor
from camviz.sensors.readout import (
    CcdRegister,
    bloomed,
    bucket_brigade,
    gliding,
    rolling_picture,
    rolling_rays,
    row_times,
    smeared,
    transferred,
)
from camviz.sensors.sensor import Exposure, Sensor, decibel
from camviz.sensors.steps import amplify, convert, fill, leak, quantise, read

__all__ = [
    "PUBLISHED",
    "SHUTTERS",
    "CcdRegister",
    "DigitalCamera",
    "EfficiencyCurve",
    "Exposure",
    "FixedPattern",
    "MeasuredShutter",
    "NoiseModel",
    "PublishedSensor",
    "Sensor",
    "Shot",
    "amplify",
    "average",
    "band_gap_ev",
    "bloomed",
    "bucket_brigade",
    "convert",
    "dark_current_ratio",
    "decibel",
    "doubling_temperature_k",
    "fill",
    "flattened",
    "gliding",
    "leak",
    "less_dark",
    "merged",
    "poisson",
    "quantise",
    "read",
    "rolling_picture",
    "rolling_rays",
    "row_times",
    "smeared",
    "smoothed",
    "transferred",
]
