"""Which streams may set the clock that something is judged by: those that the judged quantity has no part in."""

from collections.abc import Iterable

from ...errors import UsageError
from ...flight import Flight

AS_RECORDED = "as-recorded"
CLOCKS = (AS_RECORDED, "offset", "retimed", "joint")
"""Clocks, from the smallest to the largest correction: none, the gyro's constant delay, and two moving errors. The
first is shown by independent streams, the second by the estimated position too."""

INERTIAL = ("gyro", "acceleration")
ESTIMATES = ("position", "velocity", "attitude")
"""What the vehicle's own filter estimates and logs."""


def voters(clock: str, judged: Iterable[str] = ()) -> tuple[str, ...]:
    """The kinds of evidence (``evidence.KINDS``) that may set ``clock`` where ``judged`` (of ESTIMATES) are judged.

    ``retimed``: gyro and accelerometer, and the logged attitude unless it is judged. Position and velocity are never
    used: they come from one filter, so an error in both would be taken for time. ``joint``: all of them. A single name
    may be given alone. Raises UsageError for ``joint`` where a logged estimate is judged, and for unknown clocks or
    estimates.
    """
    if judged is None:
        raise UsageError(f"judged is None: name what is judged ({', '.join(ESTIMATES)}), or () for nothing")
    judged = {judged} if isinstance(judged, str) else set(judged)
    if clock not in CLOCKS:
        raise UsageError(f"no clock {clock!r}; there are {', '.join(CLOCKS)}")
    if unknown := sorted(map(str, judged - set(ESTIMATES))):
        raise UsageError(f"no logged estimate {', '.join(map(repr, unknown))} to judge; there are "
                         f"{', '.join(ESTIMATES)}")
    if clock == "offset":
        return ("gyro",)
    if clock == "retimed":
        return INERTIAL if "attitude" in judged else (*INERTIAL, "attitude")
    if clock == "joint":
        if judged:
            raise UsageError(f"--clock joint cannot judge the logged {', '.join(sorted(judged))}: the logged position "
                             "helped to set it; use --clock retimed")
        return (*INERTIAL, "attitude", "velocity", "position")
    return ()


def evidence_of(flights: Iterable[Flight]) -> list[str]:
    """The kinds of streams used to estimate the clock of any of ``flights``, each once."""
    return list(dict.fromkeys(kind for flight in flights for kind in flight.provenance.clock_evidence))


def votes(clock: str, evidence: Iterable[str], moving: bool = True) -> str:
    """Description of ``clock`` in a row. ``evidence``: the kinds of streams used to estimate it. ``moving``: a moving
    error was removed from any of its flights."""
    heard = list(evidence)
    if clock == AS_RECORDED:
        return ""
    if not heard:
        return "; timestamps as recorded, as no stream identified their time error"
    names = ", ".join(heard)
    if clock == "offset" or not moving:
        return f"; timestamps less the flight's constant offset, found off-line from {names}"
    note = f"; timestamps less the moving error, found off-line from {names} against motion capture"
    return note + (": the logged position helped to set this clock" if "position" in heard else "")
