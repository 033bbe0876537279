"""What lesson 14 says about image sensors, recomputed with NumPy and SciPy."""

EXCEPTIONS: dict[str, str] = {}
