"""Systematic error that logging alone leaves in a parameter: smaller changes are no finding, however significant."""

from dataclasses import dataclass

from ..settings import number

KINDS = ("unit", "value", "gain", "damping")


@dataclass(frozen=True)
class Systematic:
    """``size`` in the parameter's unit (``of`` = ``unit``). Or as a share of the value before (``value``). Also as
    such a share times the turning that commands do not explain (``gain``). Or in 1/s of damping over inertia times the
    same (``damping``). A size of 0 means no such error."""

    size: float
    of: str = "unit"

    def __post_init__(self) -> None:
        if self.of not in KINDS or not self.size >= 0.0:
            raise ValueError(f"systematic error {self.size!r} of {self.of!r}; give a size from 0 of {', '.join(KINDS)}")


NOTHING = Systematic(0.0)
AIR = Systematic(number("physics.systematic.air"), "value")
LEVEL = Systematic(number("physics.systematic.level"), "value")
DAMPING = Systematic(number("physics.systematic.damping_1_s"), "damping")
UNDECLARED = AIR.size
"""Of a parameter's usual size, where its term declares nothing: no law is better known than those of drag."""
