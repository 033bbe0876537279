"""Where the panels of the depth-of-field visualizer stand: the photograph, and what a reader has opened beside it."""

from __future__ import annotations

from collections.abc import Collection

from camviz.draw.flow import Cell, rows, shortened

PANELS = ("rays", "photograph", "blur", "sensor", "numbers")
TILES = {"sensor": "at the sensor"}  # of panels that are not called as they are
NARROW = 400  # below it, what is at the sensor stands one below the other

_ALONE = (328.0, {"photograph": 398.0})  # at its largest, with its controls, 600 pixels high
# Of the first row, by the panel beside the photograph: its height and the widths of the two.
_BESIDE: dict[str, tuple[float, dict[str, float]]] = {
    "rays": (308, {"rays": 580, "photograph": 380}),
    "blur": (334, {"photograph": 420, "blur": 540}),
    "sensor": (308, {"photograph": 380, "sensor": 580}),
    "numbers": (330, {"photograph": 420, "numbers": 340}),
}
_THREE = (346.0, {"photograph": 320.0, "blur": 400.0, "numbers": 240.0})  # of one row
# Of the second row, by the panels in it.
_BELOW: dict[str, tuple[float, dict[str, float]]] = {
    "": (0, {}),
    "blur": (330, {"blur": 620}),
    "sensor": (190, {"sensor": 620}),
    "numbers": (372, {"numbers": 340}),
    "blur sensor": (380, {"blur": 600, "sensor": 360}),
    "blur numbers": (372, {"blur": 600, "numbers": 360}),
    "sensor numbers": (372, {"sensor": 620, "numbers": 340}),
    "blur sensor numbers": (380, {"blur": 420, "sensor": 280, "numbers": 260}),
}
_SIDE_BY_SIDE = 190  # of what is at the sensor, where it has the width


def lens_tiles(wanted: Collection[str]) -> dict[str, Cell]:
    """The cells of the panels wanted: the photograph and one beside it in the first row, the others below them."""
    if set(wanted) == set(_THREE[1]):
        return rows(_THREE)
    beside = next((name for name in ("rays", "blur", "sensor", "numbers") if name in wanted), "")
    below = [name for name in ("blur", "sensor", "numbers") if name in wanted and name != beside]
    found = rows(_BESIDE[beside] if beside else _ALONE, _BELOW[" ".join(below)])
    wide = "sensor" in found and found["sensor"][2] >= NARROW
    return shortened(found, **({"sensor": _SIDE_BY_SIDE} if wide else {}))
