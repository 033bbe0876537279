"""Instruments: how sharp a camera is, and how noisy its sensor, from photographs of its own."""
