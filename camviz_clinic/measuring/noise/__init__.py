"""A sensor's gain, noise and patterns, measured from its frames after EMVA Standard 1288, release 4.0 (linear)."""

from camviz_clinic.measuring.noise.measurement import Measurement
from camviz_clinic.measuring.noise.readings import Level
from camviz_clinic.measuring.noise.recording import Recording, RecordingError, measure, read_recording

__all__ = ["Level", "Measurement", "Recording", "RecordingError", "measure", "read_recording"]
