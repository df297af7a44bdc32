"""Commands under way: what was asked and has not reached the motors yet."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np


class UnderWay:
    """Commands (n, 4), one a period, each of which acts ``delay_s`` after it was given, for a period."""

    def __init__(self, n: int, period_s: float, delay_s: float, first: np.ndarray) -> None:
        if delay_s < 0.0:
            raise ValueError(f"a delay of {delay_s} s")
        self.period_s, self.delay_s = period_s, delay_s
        self.whole = int(delay_s / period_s + 1e-9)
        self.rest_s = max(delay_s - self.whole * period_s, 0.0)
        self._given = np.repeat(np.broadcast_to(first, (n, 4))[None].astype(float), self.whole + 2, axis=0)

    def give(self, command: np.ndarray) -> None:
        """A new command (n, 4), at the start of a period."""
        self._given = np.concatenate([command[None], self._given[:-1]])

    @property
    def last(self) -> np.ndarray:
        """The last command (n, 4)."""
        return self._given[0]

    def before(self) -> Iterator[tuple[float, np.ndarray]]:
        """(seconds, command) from now until the one that is given next begins to act."""
        if self.rest_s > 1e-9:
            yield self.rest_s, self._given[self.whole]
        for i in range(self.whole - 1, -1, -1):
            yield self.period_s, self._given[i]

    def acting(self) -> Iterator[tuple[float, np.ndarray]]:
        """(seconds, command) over the period that the last command given begins."""
        if self.rest_s > 1e-9:
            yield self.rest_s, self._given[self.whole + 1]
        yield self.period_s - self.rest_s, self._given[self.whole]
