"""Choice of the next flight of a campaign by the battery voltage at rest."""

from collections.abc import Mapping
from dataclasses import dataclass

from .campaign_plan import CampaignPlan, FlightId


@dataclass(frozen=True)
class Window:
    """A flight, and the voltages at rest [V] with which it may begin."""

    flight: FlightId
    low_V: float = 0.0
    high_V: float = float("inf")

    def contains(self, battery_V: float) -> bool:
        """Whether a flight may begin with this voltage. A hundredth of a millivolt is rounding."""
        return self.low_V - 1e-5 <= battery_V <= self.high_V + 1e-5


def windows(plan: CampaignPlan, flown_V: Mapping[FlightId, float]) -> list[Window]:
    """The next flight of every pair that is not complete, in the order of the plan.

    ``flown_V``: voltage at rest [V] of each flight that is done. A pair with flights admits only voltages within
    ``plan.within_V`` of all of them.
    """
    found = []
    for pair in plan.pairs:
        volts = [flown_V[flight] for flight in pair if flight in flown_V]
        following = next((flight for flight in pair if flight not in flown_V), None)
        if following is None:
            continue
        if volts:
            found.append(Window(following, max(volts) - plan.within_V, min(volts) + plan.within_V))
        else:
            found.append(Window(following))
    return found


def next_flight(plan: CampaignPlan, flown_V: Mapping[FlightId, float], battery_V: float) -> Window | None:
    """The flight for this voltage; None if the battery has to be charged or exchanged first.

    A pair that was begun comes before a new one. So a battery that empties opens pairs at falling voltages, and the
    next battery completes them.
    """
    open_ = [window for window in windows(plan, flown_V) if window.contains(battery_V)]
    return next((w for w in open_ if w.low_V > 0.0), next(iter(open_), None))


def needed(plan: CampaignPlan, flown_V: Mapping[FlightId, float], battery_V: float) -> str:
    """Which voltage the vehicle needs, if no flight may begin with ``battery_V``."""
    wanted = min(windows(plan, flown_V), key=lambda w: max(w.low_V - battery_V, battery_V - w.high_V))
    advice = "charge it" if battery_V < wanted.low_V else "use a battery that is less full"
    return (f"battery at {battery_V:.2f} V at rest; the nearest flight ({wanted.flight}) needs {wanted.low_V:.2f} to "
            f"{wanted.high_V:.2f} V: {advice}")


def matches(plan: CampaignPlan, flown_V: Mapping[FlightId, float]) -> list[tuple[tuple[FlightId, ...], float, bool]]:
    """Complete pairs: flights, largest difference of their voltages [V], and whether it is small enough."""
    found = []
    for pair in plan.pairs:
        if all(flight in flown_V for flight in pair):
            volts = [flown_V[flight] for flight in pair]
            apart = max(volts) - min(volts)
            found.append((pair, apart, apart <= plan.within_V + 1e-5))
    return found
