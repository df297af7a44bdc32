"""Commands under way: those that have not reached the motors yet."""

import numpy as np


class UnderWay:
    """Commands (n, 4), one a period, each of which acts ``delay_s`` after it was given, for a period.

    ``before_s`` (k,) and ``acting_s`` (j,): for how long each command of ``before`` and of ``acting`` acts.
    """

    def __init__(self, n: int, period_s: float, delay_s: float, first: np.ndarray) -> None:
        if delay_s < 0.0:
            raise ValueError(f"a delay of {delay_s} s")
        self.period_s, self.delay_s = period_s, delay_s
        self.whole = int(delay_s / period_s + 1e-9)
        self.rest_s = max(delay_s - self.whole * period_s, 0.0)
        rest = [self.rest_s] if self.rest_s > 1e-9 else []
        self.before_s = np.array(rest + [period_s] * self.whole)
        self.acting_s = np.array([*rest, period_s - self.rest_s])
        self._given = np.repeat(np.broadcast_to(first, (n, 4))[None].astype(float), self.whole + 2, axis=0)

    def give(self, command: np.ndarray) -> None:
        """A new command (n, 4), at the start of a period."""
        self._given[:-1] = self._given[1:]
        self._given[-1] = command

    @property
    def last(self) -> np.ndarray:
        """The last command (n, 4)."""
        return np.asarray(self._given[-1])

    @property
    def before(self) -> np.ndarray:
        """Commands (k, n, 4) from now until the one that is given next begins to act; valid until then."""
        return self._given[len(self._given) - len(self.before_s):]

    @property
    def acting(self) -> np.ndarray:
        """Commands (j, n, 4) over the period that the last command given begins; valid until the next is given."""
        return self._given[2 - len(self.acting_s):2]
