"""The clinic: what is wrong with a calibration, and what to do about it."""

from camviz_clinic.checks.deployed import check
from camviz_clinic.checks.findings import faults, kinds
from camviz_clinic.checks.gate import Gate
from camviz_clinic.checks.inspection import Inspection, inspect, inspect_file
from camviz_clinic.checks.judgement import Check, Judgement
from camviz_clinic.checks.registry import Finding

__all__ = ["Check", "Finding", "Gate", "Inspection", "Judgement", "check", "faults", "inspect", "inspect_file", "kinds"]
