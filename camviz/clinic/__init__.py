"""The clinic: what is wrong with a calibration, and what to do about it."""

from camviz.clinic.findings import Finding, Inspection, inspect, inspect_file, kinds

__all__ = ["Finding", "Inspection", "inspect", "inspect_file", "kinds"]
