"""Where the panels of the depth-of-field visualizer stand: the photograph, and what a reader has opened beside it."""

from __future__ import annotations

from collections.abc import Collection

from camviz.draw.flow import WIDTH, Cell, rows, shortened

PANELS = ("rays", "photograph", "blur", "sensor", "numbers")
TILES = {"sensor": "at the sensor"}  # of panels that are not called as they are
NARROW = 400  # below it, what is at the sensor stands one below the other; else side by side, and 190 high

_FIRST: dict[str, tuple[float, dict[str, float]]] = {  # row, by the panel beside the photograph: height and widths
    "": (328, {"photograph": 398}),  # at its largest, with its controls, 600 pixels high
    "rays": (308, {"rays": 580, "photograph": 380}),
    "blur": (334, {"photograph": 440, "blur": 420}),
    "sensor": (308, {"photograph": 380, "sensor": 580}),
    "numbers": (330, {"photograph": 420, "numbers": 340}),
}
_ONLY: tuple[float, dict[str, float]] = (346, {"photograph": 320, "blur": 400, "numbers": 240})
_SECOND, _WIDEST = {"blur": 420, "sensor": 280, "numbers": 260}, 440  # shares of the second row


def lens_tiles(wanted: Collection[str]) -> dict[str, Cell]:
    """The cells of the panels wanted: the photograph and one beside it in the first row, the others below them."""
    if set(wanted) == set(_ONLY[1]):
        return rows(_ONLY)
    beside = next((name for name in ("rays", *_SECOND) if name in wanted), "")
    shares = {name: share for name, share in _SECOND.items() if name in wanted and name != beside}
    below = {name: min(_WIDEST, WIDTH * share / sum(shares.values())) for name, share in shares.items()}
    found = rows(_FIRST[beside], (380, below))
    return shortened(found, **({"sensor": 190} if "sensor" in found and found["sensor"][2] >= NARROW else {}))
