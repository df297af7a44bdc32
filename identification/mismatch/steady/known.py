"""What the user knows about flights that are compared with normal ones. The flights alone cannot show it."""

from dataclasses import dataclass, fields

LOADS = frozenset({"weight", "slung", "mass"})
"""Causes that are excluded if nothing was added to the vehicle."""


@dataclass(frozen=True)
class Known:
    """Each is False where the user does not know it.

    - same_day: all flights are of one day, with the same motors and propellers.
    - nothing_added: nothing was put onto the vehicle or hung from it.
    - same_vehicle: all flights are of one vehicle, although files may be mixed up.
    """

    same_day: bool = False
    nothing_added: bool = False
    same_vehicle: bool = False

    @property
    def absent(self) -> frozenset[str]:
        """Causes that this excludes."""
        return (LOADS if self.nothing_added else frozenset()) | ({"vehicle"} if self.same_vehicle else frozenset())

    @property
    def options(self) -> list[str]:
        """As given on the command line.

        >>> Known(same_day=True).options
        ['--same-day']
        """
        return [f"--{f.name.replace('_', '-')}" for f in fields(self) if getattr(self, f.name)]


NOTHING = Known()
"""The user knows nothing of this."""
