"""Pages that open without a network: a calibration in pictures, and what an inspection found."""
