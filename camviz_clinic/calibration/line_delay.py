"""How long a rolling shutter takes from one row of the image to the next."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LineDelay:
    """The line delay of a camera.

    Args:
        seconds: From one row to the next; below zero where the bottom row is read first.
        sigma: Its standard deviation in seconds; None where it was given and not solved for.

    >>> LineDelay(2e-5, 1e-7).of_rows(480)  # ms for all rows
    (9.6, 0.048)
    """

    seconds: float
    sigma: float | None = None

    def of_rows(self, rows: int) -> tuple[float, float | None]:
        """How long so many rows take, with its standard deviation, in milliseconds."""
        sigma = None if self.sigma is None else round(1000 * rows * self.sigma, 12)
        return round(1000 * rows * self.seconds, 12), sigma

    @property
    def sentence(self) -> str:
        """In words, in µs.

        >>> LineDelay(2e-5, 1e-7).sentence
        'a row is read every 20.00 ± 0.10 µs'
        >>> LineDelay(2e-5).sentence
        'a row is read every 20.00 µs, as given'
        """
        known = ", as given" if self.sigma is None else ""
        spread = "" if self.sigma is None else f" ± {1e6 * self.sigma:.2f}"
        upwards = ", the bottom one first" if self.seconds < 0 else ""
        return f"a row is read every {1e6 * abs(self.seconds):.2f}{spread} µs{upwards}{known}"
