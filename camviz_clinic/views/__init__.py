"""What the clinic shows of a calibration: one view per module, each from plain arrays or `.of(...)` the calibration."""
