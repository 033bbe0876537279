"""What goes wrong in a class, done on purpose: each says what that student sees, what is lost, and how the others are."""

from __future__ import annotations

FAULTS = {}
