"""Real sensors: their published figures and the sources of these.

No sheet gives every figure that a simulation needs; `assumed` names those that ours had to choose.
"""

from __future__ import annotations

from dataclasses import dataclass

from camviz.sensors.efficiency import EfficiencyCurve
from camviz.sensors.sensor import Sensor

EMVA = "measured after EMVA 1288"
DATA_SHEET = "data sheet"
MEASURED = "measured in another way"


@dataclass(frozen=True)
class PublishedSensor:
    """A sensor as its sheet describes it.

    Attributes:
        name: Of the sensor.
        technology: "CMOS" or "CCD".
        camera: In which it was measured.
        pitch_um: From pixel to pixel.
        sensor: What it does. Where EMVA 1288 was followed, the full well is the saturation capacity.
        stated_dynamic_range_db: NaN where the sheet gives none.
        source: The sheet.
        assumed: The figures that no sheet gives, and that we had to choose.
        basis: What sort of sheet: measured after EMVA 1288, a maker's data sheet, or measured in another way.

    >>> sheet = PUBLISHED[0]
    >>> sheet.name, sheet.sensor.full_well_e, sheet.sensor.read_noise_e
    ('IMX174', 32691, 6.83)
    """

    name: str
    technology: str
    camera: str
    pitch_um: float
    sensor: Sensor
    stated_dynamic_range_db: float
    source: str
    assumed: tuple[str, ...]
    basis: str = DATA_SHEET


def _filling(full_well_e: float, bits: int, offset_dn: float) -> float:
    """The gain at which a full well just reaches the converter's end."""
    return (2**bits - 1 - offset_dn) / full_well_e


IMX174 = PublishedSensor(
    "IMX174",
    "CMOS",
    "Point Grey, global shutter",
    5.86,
    Sensor(0.77, 32_691, 6.83, 1 / 0.51, 0, 16, measured_at_nm=525),
    73.0,
    "Point Grey's EMVA 1288 figures of its camera, quoted on fhotolab.fherb.de, 7 September 2016",
    ("offset_dn", "bits", "dark_current_e_per_s", "dsnu_e", "prnu"),
    EMVA,
)

ICX625_POINT_GREY = PublishedSensor(
    "ICX625",
    "CCD",
    "Point Grey GS3-PGE-50S5M-C",
    3.45,
    Sensor(0.57, 5903, 8.28, _filling(5903, 14, 100), 100, 14, measured_at_nm=525),
    20 * 9.41 * 0.30103,
    "Point Grey's EMVA 1288 figures, quoted on mengineer.hatenablog.com, 2 May 2016; 9.41 bits",
    ("gain_dn_per_e", "offset_dn", "bits", "dark_current_e_per_s", "dsnu_e", "prnu"),
    EMVA,
)

ICX625_BASLER = PublishedSensor(
    "ICX625",
    "CCD",
    "Basler piA2400-17gm",
    3.45,
    Sensor(0.47, 7000, 13, _filling(7000, 12, 50), 50, 12, measured_at_nm=545),
    20 * 9.1 * 0.30103,
    "Basler's EMVA 1288 figures, quoted on mengineer.hatenablog.com, 2 May 2016; 9.1 bits",
    ("gain_dn_per_e", "offset_dn", "bits", "dark_current_e_per_s", "dsnu_e", "prnu"),
    EMVA,
)

CMV4000 = PublishedSensor(
    "CMV4000",
    "CMOS",
    "ams OSRAM, global shutter",
    5.5,
    Sensor(
        0.60, 13_500, 13, 0.075, 10, 10, dark_current_e_per_s=125, reference_temperature_c=25, prnu=0.01,
        dsnu_e=1 / 0.075, measured_at_nm=550,
    ),
    60.0,
    "CMV4000 datasheet v7-00, as summarised in a public star tracker's design notes; PRNU and DSNU are upper limits",
    ("offset_dn",),
)  # fmt: skip

KAF_3200ME = PublishedSensor(
    "KAF-3200ME",
    "CCD",
    "QSI 532, cooled",
    6.8,
    Sensor(
        0.79, 70_000, 12.6, 1 / 1.413, 1000, 16, dark_current_e_per_s=0.080, reference_temperature_c=0,
        measured_at_nm=656.3,
    ),
    float("nan"),
    'measured for the page "Parameters of CCD and CMOS cameras", astrosurf.com',
    ("offset_dn", "dsnu_e", "prnu"),
    MEASURED,
)  # fmt: skip

KAF_50100 = PublishedSensor(
    "KAF-50100",
    "CCD",
    "ON Semiconductor, with microlenses",
    6.0,
    # 42 pA/cm² on 36 µm² are 42e-12 · 36e-8 / 1.602e-19 = 94.4 electrons per second
    Sensor(
        0.62, 40_300, 12.5, _filling(40_300, 16, 1000), 1000, 16, dark_current_e_per_s=94.4,
        reference_temperature_c=60, measured_at_nm=550,
    ),
    70.2,
    "KAF-50100 datasheet, ON Semiconductor, as quoted in a public note; its peak efficiency is taken to be at 550 nm",
    ("gain_dn_per_e", "offset_dn", "bits", "measured_at_nm", "dsnu_e", "prnu"),
)  # fmt: skip

KAF_0400 = PublishedSensor(
    "KAF-0400",
    "CCD",
    "Kodak, no microlenses, no anti-blooming drain",
    9.0,
    Sensor(
        EfficiencyCurve((400, 550, 700, 1000), (0.03, 0.33, 0.40, 0.08)), 13 * 10 ** (76 / 20), 13,
        _filling(13 * 10 ** (76 / 20), 16, 1000), 1000, 16, dark_current_e_per_s=50, reference_temperature_c=25,
        measured_at_nm=550,
    ),
    76.0,
    "Kodak's KAF-0400 data sheet, quoted on astrosurf.com/audine; full well from its 76 dB",
    ("gain_dn_per_e", "offset_dn", "bits", "dsnu_e", "prnu"),
)  # fmt: skip

EMVA_REFERENCE = PublishedSensor(
    "reference camera",
    "not named",
    "the emva1288 project's reference data set",
    float("nan"),
    Sensor(0.45136, 0.45136 * 30_957, 10.898, 0.280769, 0, 12),
    61.732,
    "the emva1288 project's reference data set, 12 bits, evaluated after EMVA 1288",
    ("offset_dn", "dark_current_e_per_s", "dsnu_e", "prnu", "measured_at_nm"),
    EMVA,
)

PUBLISHED = (
    IMX174,
    CMV4000,
    ICX625_POINT_GREY,
    ICX625_BASLER,
    KAF_3200ME,
    KAF_50100,
    KAF_0400,
    EMVA_REFERENCE,
)
"""Sensors by their sheets. What the simulated sensor reaches is what the sheet states, in decibels:

>>> decibel(PUBLISHED[0].sensor.dynamic_range()).round(1), PUBLISHED[0].stated_dynamic_range_db
(np.float64(73.0), 73.0)
"""


@dataclass(frozen=True)
class MeasuredShutter:
    """How long a telephone's rolling shutter takes from the first row of a frame to the last.

    Attributes:
        name: Of the telephone.
        width, height: Of its frames, in pixels.
        frame_s: In seconds.
        source: Who measured it.

    >>> f"{MeasuredShutter('example', 640, 480, 0.0288, 'made up').row_s * 1e6:.0f} µs a row"
    '60 µs a row'
    """

    name: str
    width: int
    height: int
    frame_s: float
    source: str

    @property
    def row_s(self) -> float:
        """Time from one row to the next, in seconds."""
        return self.frame_s / self.height


_RINGABY = "Ringaby and Forssén 2012, IJCV 96"
SHUTTERS = (
    MeasuredShutter("iPhone 3GS", 640, 480, 30.84e-3, _RINGABY),
    MeasuredShutter("iPhone 4", 1280, 720, 31.98e-3, _RINGABY),
    MeasuredShutter("HTC Desire", 1280, 720, 43.834e-3, _RINGABY),
    MeasuredShutter("iPhone 4S", 1920, 1080, 1080 * 24.12e-6, "Oth et al. 2013, CVPR"),
    MeasuredShutter("Galaxy S3", 1920, 1080, 1080 * 30.25e-6, "Oth et al. 2013, CVPR"),
)
"""Rolling shutters of telephones (E. Ringaby and P.-E. Forssén, Efficient video rectification and stabilisation for
cell-phones, Int. J. Comput. Vis. 96 (2012); L. Oth, P. Furgale, L. Kneip and R. Siegwart, Rolling shutter camera
calibration, CVPR 2013).

>>> [f"{shutter.name}: {shutter.frame_s * 1000:.0f} ms" for shutter in SHUTTERS[:2]]
['iPhone 3GS: 31 ms', 'iPhone 4: 32 ms']
"""
