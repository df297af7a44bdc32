"""What was flown, from the recording itself, for files without a sheet."""

from __future__ import annotations

from typing import Any

from ..flight import Flight


def describe(flight: Flight) -> dict[str, Any]:
    """``family``, ``speed``, ``reference_speed_m_s``; None where the content does not tell."""
    return {"family": None, "speed": None, "reference_speed_m_s": None}
