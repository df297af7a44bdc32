"""Effects of a radio on packets: delay, jitter, loss, a limit of packets a second.

The link itself resends lost packets. Set-up traffic (tables, parameters, answered commands) thus always arrives, in
order, only later: every loss costs ``RESEND_S``. Unrepeated packets are really lost: set-points, poses and log data
with probability ``loss``, and log data when the vehicle's queue is full. That makes the holes in recordings. Nine
blocks of 100 Hz over 700 packets/s arrive as 77 Hz each. A burst of the queue's content follows a hang of the link.
(cflib over UDP never asks twice; a lost answer would leave it hanging where a real link would not.)
"""

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from ...errors import InputError
from ..crtp import Packet, Port
from .log import DATA

RESEND_S = 0.003
"""Until a packet that was not acknowledged is on the air again: a few attempts of 0.5 ms and the turn of others."""
QUEUE = 12
"""Packets that wait in the vehicle at most before log data are dropped."""
T = TypeVar("T")


@dataclass(frozen=True)
class RadioOptions:
    """Properties of the radio link.

    - latency_s: one way; jitter_s: mean of an exponential delay on top; loss 0..1: of packets.
    - packets_per_s: that the way down carries (None: no limit).
    - hangs_per_s and hang_s: rate and mean duration of hangs that block both directions. With 2 and 0.06, their share
      of time is the one that ``mathematics.packet_delay`` assumes; seed.

    Raises InputError for what cannot be."""

    latency_s: float = 0.0
    jitter_s: float = 0.0
    loss: float = 0.0
    packets_per_s: float | None = None
    hangs_per_s: float = 0.0
    hang_s: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        for name, highest in (("latency_s", 10.0), ("jitter_s", 10.0), ("loss", 0.9), ("hangs_per_s", 20.0),
                              ("hang_s", 5.0)):
            if not 0.0 <= getattr(self, name) <= highest:
                raise InputError("radio", f"{name} {getattr(self, name):g}", f"give 0 to {highest:g}")
        if self.packets_per_s is not None and not 10.0 <= self.packets_per_s <= 1e6:
            raise InputError("radio", f"{self.packets_per_s:g} packets/s", "give 10 or more")


def repeated(packet: Packet) -> bool:
    """Whether the link repeats it until it has arrived."""
    if packet.port == Port.LOG:
        return packet.channel != DATA
    if packet.port == Port.LOCALIZATION:
        return packet.data[:1] in (b"\x03", b"\x04")  # an emergency stop
    return packet.port not in (Port.RPYT, Port.GENERIC) or packet.channel == 1


class _Hangs:
    """Spans in which nothing passes, the same for both directions: both draw them from the same seed and start."""

    def __init__(self, options: RadioOptions, start_s: float) -> None:
        self._options, self._rng = options, np.random.default_rng([options.seed, 9])
        self._begin_s = self._end_s = start_s

    def after(self, time_s: float) -> float:
        """The first moment from ``time_s`` on when something passes; times must not go back."""
        o = self._options
        if not (o.hangs_per_s and o.hang_s):
            return time_s
        while self._end_s <= time_s:
            self._begin_s = self._end_s + self._rng.exponential(1.0 / o.hangs_per_s)
            self._end_s = self._begin_s + self._rng.exponential(o.hang_s)
        return self._end_s if self._begin_s <= time_s else time_s


class Channel(Generic[T]):
    """One direction: ``send`` puts something in at a time, ``due`` gives what has arrived, in order.

    lost: droppable things that vanished on the air; full: those that found the queue full.
    """

    def __init__(self, options: RadioOptions, direction: int, limited: bool, start_s: float = 0.0) -> None:
        self._options, self._rng = options, np.random.default_rng([options.seed, direction])
        self._slot_s = 1.0 / options.packets_per_s if limited and options.packets_per_s else 0.0
        self._hangs, self._limited = _Hangs(options, start_s), limited
        self._plain = options.loss == options.jitter_s == options.hangs_per_s == self._slot_s == 0.0
        self._way: deque[tuple[float, T]] = deque()
        self._leaving: deque[float] = deque()
        self._free_s = self._last_s = -np.inf
        self.lost = self.full = 0

    def send(self, time_s: float, thing: T, again: bool) -> None:
        """``again``: the link repeats it until it arrives."""
        o = self._options
        if self._plain:
            self._way.append((time_s + o.latency_s, thing))
            return
        while self._leaving and self._leaving[0] <= time_s:
            self._leaving.popleft()
        if self._limited and not again and len(self._leaving) >= QUEUE:
            self.full += 1
            return
        start = self._hangs.after(max(time_s, self._free_s))
        tries = 1
        while self._rng.random() < o.loss:
            tries += 1
            if not again:
                self.lost += 1
                self._free_s = start + self._slot_s
                return
        self._free_s = start + tries * self._slot_s + (tries - 1) * RESEND_S
        self._leaving.append(self._free_s)
        arrival = self._free_s + o.latency_s + (self._rng.exponential(o.jitter_s) if o.jitter_s else 0.0)
        self._last_s = max(arrival, self._last_s)
        self._way.append((self._last_s, thing))

    def clear(self) -> None:
        """Nothing is on its way any more."""
        self._way.clear()
        self._leaving.clear()

    def next_s(self) -> float:
        """When the next thing arrives; inf without any."""
        return self._way[0][0] if self._way else np.inf

    def due(self, time_s: float) -> list[T]:
        """What has arrived by a time."""
        found = []
        while self._way and self._way[0][0] <= time_s:
            found.append(self._way.popleft()[1])
        return found
