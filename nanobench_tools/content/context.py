"""One flight and what was derived from it, each thing computed once, when first asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ..flight import Flight

T = TypeVar("T")


class Context:
    """``context.once(f)`` is ``f(context)``, kept: checks that need the same derived signal share it."""

    def __init__(self, flight: Flight) -> None:
        self.flight = flight
        self._kept: dict[Callable[..., Any], Any] = {}

    def once(self, function: Callable[[Context], T]) -> T:
        """The value of ``function`` for this flight; ``function`` must be pure."""
        if function not in self._kept:
            self._kept[function] = function(self)
        return self._kept[function]
