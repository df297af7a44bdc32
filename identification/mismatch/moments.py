"""Correlation of the residual with covariates that should not predict it.

A right simulator leaves a residual that no covariate predicts. Residual and covariates are whitened, since disturbances
last a while. The covariates are made orthonormal, and the residual is projected onto them. This gives K numbers a
channel, of unit variance under a right simulator. A hypothesis is judged by how much of this projection it explains.

Closed loop: controllers answer a disturbance within a few rows, so commands and rates correlate with the residual
without causing it. Torques are therefore compared over short stretches, with covariates fixed before the stretch began
(predetermined instruments: Soederstroem and Stoica 1989, System Identification, ch. 8). The disturbance itself is
whitened first. Set-points are also used, since no disturbance moves them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from nanobench_tools import so3
from nanobench_tools.physics import Model
from nanobench_tools.settings import count, number, setting

from .memory import Memory, fit_memory, runs_of
from .wrench import CHANNELS, FORCE_ROWS, TORQUE_ROWS, Wrench

LAST_ASKED = count("mismatch.moments.last_asked")
ASKED_LAGS = range(0, LAST_ASKED, 4)
"""Lags [rows] at which the acceleration required by set-points is an instrument: up to 0.44 s, as late as vehicles
follow."""
RATE_LAGS = range(3, 10)
"""Stretches before the one judged whose changes of rate are instruments: 20 to 160 ms."""
MEMORY = ("rate", "turning")
"""Groups of covariates that carry the disturbances of the past themselves."""
ORDERS = setting("mismatch.moments.orders")
RANK = 1e-6
"""Covariates that others explain to this share are left out."""
LOWEST_M = number("mismatch.moments.lowest_m")


@dataclass(frozen=True)
class Covariate:
    """A signal with which the residual is compared; ``group`` describes it in the report."""

    name: str
    group: str
    values: np.ndarray


def _slopes(wrench: Wrench, at: np.ndarray) -> list[Covariate]:
    """Covariates of both kinds that are slow, or exogenous."""
    q = wrench.quaternion[at]
    turn = so3.matrix(q)
    v = so3.rotate_inverse(q, wrench.of("velocity_m_s", at))
    p, volt = wrench.of("position_m", at), wrench.of("battery_V", at)
    speed = np.linalg.norm(v, axis=1)
    found = [Covariate("constant", "constant", np.ones(len(at)))]
    for i, axis in enumerate("xyz"):
        found += [Covariate(f"velocity {axis}", "air speed", v[:, i]),
                  Covariate(f"speed x velocity {axis}", "air speed", speed * v[:, i]),
                  Covariate(f"world {axis} seen by body x", "attitude", turn[:, i, 0]),
                  Covariate(f"world {axis} seen by body y", "attitude", turn[:, i, 1]),
                  Covariate(f"world {axis} seen by body z", "attitude", turn[:, i, 2])]
    found += [Covariate("lateral speed^2", "air speed", v[:, 0] ** 2 + v[:, 1] ** 2),
              Covariate("1 / height^2", "height", 1.0 / np.maximum(p[:, 2], LOWEST_M) ** 2),
              Covariate("height", "height", p[:, 2]),
              Covariate("position x", "position", p[:, 0]), Covariate("position y", "position", p[:, 1]),
              Covariate("battery", "battery", volt),
              Covariate("time", "time", wrench.of("since_s", at))]
    flight = wrench.flight[at]
    found += [Covariate(f"flight {f}", "flight", np.where(flight == f, 1.0, 0.0)) for f in np.unique(flight)[1:]]
    return found


def force_covariates(wrench: Wrench, jacobian: np.ndarray, names: Sequence[str]) -> list[list[Covariate]]:
    """For each of the three channels: slopes, and the effect of each parameter of the vocabulary."""
    slow = _slopes(wrench, wrench.force_at)
    return [[*slow, *(Covariate(name, "hypothesis", jacobian[:, c, k]) for k, name in enumerate(names))]
            for c in range(3)]


def torque_covariates(wrench: Wrench) -> list[list[Covariate]]:
    """Known before each stretch begins."""
    at = wrench.torque_at
    rate = wrench.of("rate_rad_s", np.arange(len(wrench.track)))
    begin = (wrench.ends - [len(t) for t in wrench.tracks])[wrench.track][at]
    found = _slopes(wrench, at)

    def before(rows: int) -> np.ndarray:
        return np.asarray(np.maximum(at - rows, begin))

    w = rate[before(2 * 2)]
    for i, axis in enumerate("xyz"):
        found.append(Covariate(f"rate {axis}", "rate", w[:, i]))
        found.append(Covariate(f"rates {axis} crossed", "rate", w[:, i] * w[:, (i + 1) % 3]))
        found += [Covariate(f"turning {axis} {20 * lag} ms before", "turning",
                            rate[before(2 * lag)][:, i] - rate[before(2 * lag + 2)][:, i]) for lag in RATE_LAGS]
    asked = wrench.of("asked_rad_s2", np.arange(len(wrench.track)))
    heading = so3.matrix(wrench.quaternion[at])[:, :2, 0]
    heading /= np.linalg.norm(heading, axis=1, keepdims=True)
    for lag in ASKED_LAGS:
        ahead = asked[before(lag)]
        about = {"y": np.sum(heading * ahead, axis=1), "x": heading[:, 1] * ahead[:, 0] - heading[:, 0] * ahead[:, 1]}
        found += [Covariate(f"asked {axis} {10 * lag} ms before", "asked", value) for axis, value in about.items()]
    return [found] * 3


@dataclass(frozen=True)
class Channel:
    """One axis: its autoregression and its covariates as an orthonormal basis (samples, K).

    ``sd``: standard deviation of the innovations that they leave, widened where a moment has to exceed more.
    ``spread``: the square of this factor.
    """

    name: str
    memory: Memory
    basis: np.ndarray
    names: tuple[str, ...]
    groups: tuple[str, ...]
    sd: float
    spread: float = 1.0

    def project(self, values: np.ndarray) -> np.ndarray:
        """values (samples, ...) -> (K, ...) in standard deviations."""
        return np.tensordot(self.basis, self.memory.whiten(values), axes=(0, 0)) / self.sd


def _independent(columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Orthonormal basis of the columns, in their order, and which of them added something."""
    size = np.linalg.norm(columns, axis=0)
    keep, basis = [], np.zeros((len(columns), 0))
    for k in np.flatnonzero(size > 0.0):
        column = columns[:, k] / size[k]
        for _ in range(2):
            column = column - basis @ (basis.T @ column)
        left = np.linalg.norm(column)
        if left > RANK**0.5:
            keep.append(k)
            basis = np.concatenate([basis, column[:, None] / left], axis=1)
    return basis, np.array(keep, int)


def channel(name: str, at: np.ndarray, step: int, track: np.ndarray, covariates: Sequence[Covariate],
            residual: np.ndarray, order: int) -> Channel:
    """Memory and size of the part that the covariates do not explain, and their basis."""
    runs = runs_of(at, step, track)
    columns = np.stack([c.values for c in covariates], axis=1)
    slow = np.stack([c.values for c in covariates if c.group not in MEMORY], axis=1)
    memory = fit_memory(residual, slow, runs, order)
    basis, keep = _independent(memory.whiten(columns))
    white = memory.whiten(residual)
    left = white - basis @ (basis.T @ white)
    sd = float(np.sqrt(left @ left / max(memory.judged.sum() - basis.shape[1], 1)))
    return Channel(name, memory, basis, tuple(covariates[k].name for k in keep),
                   tuple(covariates[k].group for k in keep), sd)


@dataclass(frozen=True)
class Levels:
    """Per-flight parameters: names, index of each in ``model``, and the standard deviation between flights, per scale
    of the parameter. Their effects are those at ``model``."""

    model: Model
    names: tuple[str, ...]
    which: tuple[int, ...]
    sd_scales: tuple[float, ...]


@dataclass(frozen=True)
class Moments:
    """All six channels. ``levels``: scatter between flights, which every fit includes as a nuisance."""

    wrench: Wrench
    channels: tuple[Channel, ...]
    levels: Levels | None = None

    def project(self, force: np.ndarray, torque: np.ndarray) -> np.ndarray:
        """(N, 3, ...), (M, 3, ...) -> all channels end to end, (K, ...), of unit variance where nothing is wrong."""
        return np.concatenate([c.project((force if i < 3 else torque)[:, i % 3])
                               for i, c in enumerate(self.channels)])

    @property
    def owner(self) -> np.ndarray:
        """(K,) number of the channel."""
        return np.repeat(np.arange(6), [c.basis.shape[1] for c in self.channels])


def moments_of(wrench: Wrench, residual: tuple[np.ndarray, np.ndarray], force_jacobian: np.ndarray,
               names: Sequence[str]) -> Moments:
    """Channels of a residual; force_jacobian (N, 3, P) is the effect of the vocabulary on the force. Torques that are
    not compared have no moments."""
    if wrench.unasked:
        forces = force_covariates(wrench, force_jacobian, names)
        silent = Channel("", Memory(np.zeros(ORDERS[1]), np.zeros(0, int)), np.zeros((0, 0)), (), (), 1.0)
        return Moments(wrench, tuple(
            channel(name, wrench.force_at, FORCE_ROWS, wrench.track, forces[i], residual[0][:, i], ORDERS[0])
            if i < 3 else replace(silent, name=name) for i, name in enumerate(CHANNELS)))
    covariates = [*force_covariates(wrench, force_jacobian, names), *torque_covariates(wrench)]
    return Moments(wrench, tuple(
        channel(name, wrench.force_at if i < 3 else wrench.torque_at, FORCE_ROWS if i < 3 else TORQUE_ROWS,
                wrench.track, covariates[i], residual[i // 3][:, i % 3], ORDERS[i // 3])
        for i, name in enumerate(CHANNELS)))
