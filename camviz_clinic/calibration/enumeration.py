"""Names in a sentence."""

from __future__ import annotations

from collections.abc import Sequence


def enumerated(names: Sequence[str], most: int | None = None) -> str:
    """Names as a sentence lists them.

    Args:
        names: At least one.
        most: How many are said by name; of the others only how many there are. None for all.

    Returns: One string.

    >>> enumerated(["left"]), enumerated(["k1", "k2", "k3"]), enumerated(["a", "b", "c", "d"], most=2)
    ('left', 'k1, k2 and k3', 'a, b and 2 more')
    """
    if most and len(names) > most:
        return f"{', '.join(names[:most])} and {len(names) - most} more"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
