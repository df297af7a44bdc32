"""Signals derived from one flight that several checks need; each is computed once, when first asked for."""

from __future__ import annotations

from ..flight import Flight


class Context:
    """One flight and what was derived from it."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
