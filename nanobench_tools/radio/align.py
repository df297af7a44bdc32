"""The vehicle's ticks in the host's time, with an interval.

A packet is never early, so the line below all (tick, time of arrival) is the vehicle's clock seen over the fastest way
down. Source: Moon, Skelly, Towsley, "Estimation and removal of clock skew from network delay measurements", INFOCOM
1999. The linear program is that of ``moving.sender_timestamps``. If both ways take equally long, the delay of the
fastest way is half the shortest round trip of the link's echo. For any link it lies between zero and the whole round
trip. The error of an offset is at most half the round trip (Mills, RFC 5905, section 8).
"""

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..time_offsets.moving.sender_timestamps import link_delay, unwrapped

TICK_S = 1e-3
"""Packets carry whole milliseconds."""
PIECES = 8
"""The line is fitted again to pieces of the recording: how far those lines scatter about it is how well it is known."""
FEWEST = 20


@dataclass(frozen=True)
class Alignment:
    """host = start_s + tick_s * rate, for ``tick_s`` unwrapped seconds since ``first_tick_s``.

    ``down_s``: time of the fastest packet on its way; ``ci95_s``: +- of host times if both ways take equally long;
    ``bound_s``: +- for any link; ``round_trip_s``: the shortest, nan without echoes; ``late_s``: median of what
    packets waited beyond the fastest.
    """

    start_s: float
    rate: float
    first_tick_s: float
    down_s: float
    ci95_s: float
    bound_s: float
    round_trip_s: float
    late_s: float

    def host(self, tick_s: np.ndarray) -> np.ndarray:
        """Host times (n,) at which the samples with these unwrapped ticks were taken."""
        return self.start_s + self.rate * (np.asarray(tick_s, float) - self.first_tick_s)

    def to_json(self) -> dict[str, float]:
        return {name: float(getattr(self, name)) for name in
                ("rate", "down_s", "ci95_s", "bound_s", "round_trip_s", "late_s")}


def align(arrival_s: np.ndarray, tick_s: np.ndarray, round_trips_s: np.ndarray) -> Alignment:
    """arrival_s (n,) on the host, tick_s (n,) of the vehicle, unwrapped, in any order; round_trips_s (m,) of echoes.

    Raises InputError with fewer than FEWEST packets.
    """
    if len(arrival_s) < FEWEST:
        raise InputError("recording", f"{len(arrival_s)} log packets", f"clocks need {FEWEST}; is the link up?")
    order = np.argsort(tick_s, kind="stable")
    arrival, tick = np.asarray(arrival_s, float)[order], np.asarray(tick_s, float)[order]
    low_a, low_t = _lowest(arrival, tick)
    start, rate = _line(low_a, low_t, tick[0])
    late = arrival - start - rate * (tick - tick[0])
    scatter = _scatter(arrival, tick, start, rate)
    trips = np.asarray(round_trips_s, float)
    trip = float(trips.min()) if len(trips) else float("nan")
    down = 0.5 * trip if np.isfinite(trip) else 0.0
    tick_sd = TICK_S / np.sqrt(12.0)
    return Alignment(start - down, rate, float(tick[0]), down, 1.96 * float(np.hypot(scatter, tick_sd)),
                     down + TICK_S if np.isfinite(trip) else float("nan"), trip, float(np.median(late)))


def ticks_of(block_ticks_ms: list[np.ndarray], arrivals_s: list[np.ndarray]) -> list[np.ndarray]:
    """24-bit ticks of several blocks (each (n_i,) in order of arrival) -> seconds that go on after they wrap."""
    if not block_ticks_ms:
        return []
    sizes = [len(ticks) for ticks in block_ticks_ms]
    together, when = np.concatenate(block_ticks_ms), np.concatenate(arrivals_s)
    order = np.argsort(when, kind="stable")
    out = np.empty(len(together))
    out[order] = unwrapped(together[order] * TICK_S)
    return list(np.split(out, np.cumsum(sizes)[:-1]))


def _lowest(arrival: np.ndarray, tick: np.ndarray, most: int = 2000) -> tuple[np.ndarray, np.ndarray]:
    """The earliest packet of each of ``most`` stretches: the line below these lies below all."""
    if len(tick) <= most:
        return arrival, tick
    pieces = np.array_split(np.arange(len(tick)), most)
    best = np.array([piece[np.argmin((arrival - tick)[piece])] for piece in pieces])
    return arrival[best], tick[best]


def _line(arrival: np.ndarray, tick: np.ndarray, first: float) -> tuple[float, float]:
    """(arrival at tick ``first``, rate) of the highest line below all points."""
    late, skew = link_delay(arrival, tick)
    rate = 1.0 + skew
    return float(arrival[0] - late[0] - rate * (tick[0] - first)), float(rate)


def _scatter(arrival: np.ndarray, tick: np.ndarray, start: float, rate: float) -> float:
    """Standard deviation of the line at the middle of the recording, from the least delays of PIECES of it."""
    late = arrival - start - rate * (tick - tick[0])
    least = [float(piece.min()) for piece in np.array_split(late, PIECES) if len(piece)]
    return float(np.std(least, ddof=1) / np.sqrt(len(least))) if len(least) > 1 else float("nan")
