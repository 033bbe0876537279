"""The word that lets a class into its room, and the secrets that let a teacher and a projector do so."""

from __future__ import annotations

import secrets

NOUNS = (
    *("anchor", "apple", "arrow", "basket", "beach", "bridge", "button", "candle", "castle", "cherry", "circle"),
    *("cloud", "copper", "cotton", "desert", "dragon", "eagle", "engine", "falcon", "feather", "forest", "garden"),
    *("ginger", "guitar", "hammer", "harbour", "island", "jacket", "ladder", "lantern", "lemon", "magnet", "marble"),
    *("meadow", "mirror", "needle", "orange", "orchid", "paper", "pencil", "pepper", "piano", "planet", "pocket"),
    *("prism", "rabbit", "ribbon", "river", "rocket", "saddle", "salmon", "silver", "spider", "spring", "square"),
    *("summer", "tiger", "timber", "tunnel", "velvet", "violin", "walnut", "window", "winter", "yellow"),
)
"""Words that can be read aloud and typed on a telephone."""

DIGITS = 4


def new_word() -> str:
    """A word such as "prism-4817", one of half a million."""
    return f"{secrets.choice(NOUNS)}-{secrets.randbelow(10**DIGITS):0{DIGITS}}"


def tidied(word: str) -> str:
    """A word as telephones type it, " Prism 4817", as it is kept."""
    return "-".join(word.lower().replace("-", " ").split())


def new_secret() -> str:
    """128 random bits for an address or a header."""
    return secrets.token_urlsafe(16)
