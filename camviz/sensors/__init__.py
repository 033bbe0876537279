"""Image sensors: what turns light into numbers, after EMVA Standard 1288, release 4.0 (linear)."""

from camviz.sensors.counting import poisson
from camviz.sensors.dark import band_gap_ev, dark_current_ratio, doubling_temperature_k
from camviz.sensors.efficiency import EfficiencyCurve
from camviz.sensors.fixed_pattern import FixedPattern
from camviz.sensors.published import PUBLISHED, SHUTTERS, MeasuredShutter, PublishedSensor
from camviz.sensors.readout import (
    Brigade,
    bloomed,
    bucket_brigade,
    gliding,
    rolling_picture,
    rolling_rays,
    row_times,
    smeared,
    transferred,
)
from camviz.sensors.sensor import (
    Exposure,
    Sensor,
    amplify,
    convert,
    decibel,
    fill,
    leak,
    quantise,
    read,
)

__all__ = [
    "PUBLISHED",
    "SHUTTERS",
    "Brigade",
    "EfficiencyCurve",
    "Exposure",
    "FixedPattern",
    "MeasuredShutter",
    "PublishedSensor",
    "Sensor",
    "amplify",
    "band_gap_ev",
    "bloomed",
    "bucket_brigade",
    "convert",
    "dark_current_ratio",
    "decibel",
    "doubling_temperature_k",
    "fill",
    "gliding",
    "leak",
    "poisson",
    "quantise",
    "read",
    "rolling_picture",
    "rolling_rays",
    "row_times",
    "smeared",
    "transferred",
]
