"""What the logging alone can feign of a parameter: changes up to this are no finding, however significant they look."""

from __future__ import annotations

from dataclasses import dataclass

from ..settings import number

KINDS = ("unit", "value", "gain", "damping")


@dataclass(frozen=True)
class Feigned:
    """``size`` in the parameter's unit (``of`` = ``unit``), as a share of the value before (``value``), as such a share
    times the turning that commands do not explain (``gain``), or in 1/s of damping over inertia times the same
    (``damping``). 0 says that nothing is feigned."""

    size: float
    of: str = "unit"

    def __post_init__(self) -> None:
        if self.of not in KINDS or not self.size >= 0.0:
            raise ValueError(f"feigned {self.size!r} of {self.of!r}; give a size from 0 of {', '.join(KINDS)}")


NOTHING = Feigned(0.0)
AIR = Feigned(number("physics.feigned.air"), "value")
"""Of what is believed of drag and flapping: their laws are simple, and rotor speed and thrust change what is true by a
tenth."""
LEVEL = Feigned(number("physics.feigned.level"), "value")
"""Of thrust as a whole, and of mass."""
DAMPING = Feigned(number("physics.feigned.damping_1_s"), "damping")
"""Of angular damping over inertia."""
UNDECLARED = AIR.size
"""Of a parameter's usual size, where its term declares nothing: no law is better known than those of drag."""
