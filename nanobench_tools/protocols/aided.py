"""Task 3, aided: motion capture poses all along, but few, late, noisy and some lost; all other streams whole.

A pose that was measured at t arrives at t + delay. The timestamps an estimator gets in ``flight.streams["mocap"]`` are
those of arrival, on the same clock as all other streams. An estimator that uses only samples stamped up to t is
causal. The delay given to the estimator is in ``flight.metadata["pose_delay_s"]``; subtracted from a timestamp it
gives the time of measurement.
"""

import hashlib
import itertools
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np

from ..auditing.usable import POSE
from ..flight import Flight, Span, make_stream
from ..methods import Estimator
from .result_rows import Scored
from .task3 import AIDED, Case, is_logged, score_given


@dataclass(frozen=True)
class Aiding:
    """Delivery of poses.

    - rate_hz: per second.
    - delay_s: after they were measured.
    - noise_m: SD of each axis of the position (white; the attitude stays as captured).
    - loss 0..1: the share that never arrives, independently."""

    rate_hz: float = 10.0
    delay_s: float = 0.03
    noise_m: float = 0.01
    loss: float = 0.0

    @property
    def given(self) -> str:
        """What a row was given, in words."""
        lost = f", {100.0 * self.loss:g} % lost" if self.loss else ""
        return (f"motion capture poses at {self.rate_hz:g} Hz throughout{lost}; position noise {1e3 * self.noise_m:g} "
                f"mm; timestamps at arrival, {1e3 * self.delay_s:g} ms after measurement (the delay is given); all "
                "other streams")

    @property
    def inputs(self) -> str:
        """The same in short."""
        lost = f", {100.0 * self.loss:g} % lost" if self.loss else ""
        return f"poses at {self.rate_hz:g} Hz, {1e3 * self.delay_s:g} ms late, {1e3 * self.noise_m:g} mm noise{lost}"

    def to_json(self) -> dict[str, float]:
        return {f"pose_{name}": value for name, value in asdict(self).items()}


def grid(rates_hz: Sequence[float] = (), delays_s: Sequence[float] = (), noises_m: Sequence[float] = (),
         losses: Sequence[float] = ()) -> list[Aiding]:
    """Every combination; empty ones keep their default."""
    requested = {"rate_hz": rates_hz, "delay_s": delays_s, "noise_m": noises_m, "loss": losses}
    requested = {name: tuple(dict.fromkeys(values)) for name, values in requested.items() if values}
    return [Aiding(**dict(zip(requested, values, strict=True))) for values in itertools.product(*requested.values())]


def given_to(case: Case, aiding: Aiding, seed: int = 0) -> Flight:
    """The flight with the poses as they arrive (columns px py pz qx qy qz qw), nothing after the last scored row.

    The noise depends on ``seed`` and on the content of the recording alone.
    """
    end = case.spans[-1].end_s
    flight = case.flight.without_streams("mocap").during(Span(-np.inf, end))
    mocap = case.flight["mocap"]
    good = np.flatnonzero(np.isfinite(mocap[POSE]).all(axis=1) & np.isfinite(mocap.time_s))
    time_s = mocap.time_s[good]
    wanted = np.arange(time_s[0], time_s[-1], 1.0 / aiding.rate_hz) if len(good) else np.zeros(0)
    picked = np.unique(np.searchsorted(time_s, wanted - 1e-6))
    digest = hashlib.sha256(f"{case.flight.provenance.sha256} {seed}".encode()).digest()
    rng = np.random.default_rng(int.from_bytes(digest[:8], "little"))
    noise, chance = rng.normal(size=(len(picked), 3)), rng.random(len(picked))
    poses = mocap[POSE][good[picked]]
    poses[:, :3] += aiding.noise_m * noise
    arrival_s = time_s[picked] + aiding.delay_s
    kept = (chance >= aiding.loss) & (arrival_s <= end)
    arrived = make_stream("mocap", arrival_s[kept], poses[kept], POSE, rate_hz=aiding.rate_hz)
    declared = {"pose_rate_hz": aiding.rate_hz, "pose_delay_s": aiding.delay_s, "pose_noise_m": aiding.noise_m}
    return replace(flight, streams={"mocap": arrived, **flight.streams}, metadata={**flight.metadata, **declared})


def score(case: Case, method: Estimator, aiding: Aiding, seed: int = 0) -> Scored:
    """As ``task3.score``, over all airborne and clean rows; estimates logged in flight had their own poses."""
    flight = case.flight if is_logged(method) else given_to(case, aiding, seed)
    return score_given(case, method, AIDED, flight, -np.inf)
