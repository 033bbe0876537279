"""What lesson 15 says about sensor noise, recomputed with NumPy, SciPy and OpenCV."""

EXCEPTIONS: dict[str, str] = {}
