"""The clinic: what is wrong with a calibration, and what to do about it."""

from camviz.clinic.checks import faults, kinds
from camviz.clinic.deployed import check
from camviz.clinic.gate import Gate
from camviz.clinic.inspection import Inspection, inspect, inspect_file
from camviz.clinic.judgement import Check, Judgement
from camviz.clinic.registry import Finding

__all__ = ["Check", "Finding", "Gate", "Inspection", "Judgement", "check", "faults", "inspect", "inspect_file", "kinds"]
