"""Flying a campaign: voltage at rest, choice of a flight, flight, state; until all are done or somebody is needed."""

from collections.abc import Callable

from ...errors import InputError
from ..fly.prepare import Ready
from ..fly.safety import Stop
from ..fly.session import Result
from .campaign_state import CampaignState, Flown
from .next_flight import Window, needed, next_flight

MOST_MOVED = 3
"""So often in a row the voltage may leave the window between its measurement and take-off."""


class VoltageMovedError(InputError):
    """The voltage is no longer in the window for which the flight was chosen."""


def check_window(window: Window, ready: Ready) -> None:
    """Before arming: raises VoltageMovedError."""
    if not window.contains(ready.battery_V):
        raise VoltageMovedError(str(window.flight), f"battery at {ready.battery_V:.2f} V, the flight needs "
                                f"{window.low_V:.2f} to {window.high_V:.2f} V", "not armed")


def fly_campaign(state: CampaignState, measure: Callable[[], float], fly: Callable[[Window], Result],
                 charge: Callable[[str], None], say: Callable[[str], None]) -> Stop | None:
    """Flies what is left. Returns why a flight ended early, which ends the campaign for now, or None.

    ``measure`` returns the voltage at rest; ``fly`` flies and records one flight; ``charge`` asks for another battery
    and returns when it is there, or raises.
    """
    plan, moved = state.plan, 0
    while left := len(plan.flights) - len(state.done):
        volts = measure()
        window = next_flight(plan, state.flown_V, volts)
        if window is None:
            charge(needed(plan, state.flown_V, volts))
            continue
        say(f"{window.flight}: battery {volts:.2f} V at rest; {left} of {len(plan.flights)} flights are left")
        try:
            result = fly(window)
        except VoltageMovedError as error:
            moved += 1
            if moved >= MOST_MOVED:
                raise
            say(f"{error}; measured again")
            continue
        moved = 0
        if result.outcome.stop is not None:
            if result.recording is not None:
                state.add_ended(result.recording.csv.name)
            return result.outcome.stop
        if result.recording is None:
            raise InputError(str(window.flight), "the flight has no recording", "start the campaign again")
        state.add(Flown(window.flight, result.ready.battery_V, result.recording.csv.name))
    return None
