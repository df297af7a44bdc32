"""Neural-Fly (CSV with lists in its cells): a quadrotor with PX4 in the wind of a wall of fans, 50 Hz.

The world has z up, and the quaternion is x, y, z, w. The vehicle flew by this position, velocity and attitude. The
files do not show whether they are motion capture or the estimate that used it, so they become the estimate. ``T_sp`` is
the collective command. The unit of ``pwm`` is not documented, so it becomes ``extra_pwm``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from .. import so3
from ..errors import InputError
from ..flight import Flight, Stream
from ..units import GRAVITY_M_S2
from .column_map import ColumnMap, Entry
from .header import header_of
from .neurobem import unit_length
from .sheets import Sheet
from .table import cells_of, flight_of
from .timestamps import not_seconds

NEEDED = {"t", "p", "p_d", "v", "q", "w", "T_sp", "hover_throttle", "pwm"}
PWM = tuple(f"pwm{k}" for k in range(4))
STEP_S = 0.2
"""Over which the velocity is differentiated: gusts and noise average out, a figure of eight does not."""
FEWEST_ROWS = 50
MOVES_M_S2 = 0.3
"""Of the acceleration that the tilt gives: below it the vehicle hovers, and wind decides the comparison."""
SHOWN = 0.3
"""Correlation of tilt and acceleration from which on the axes are shown, or contradicted."""


class NeuralFly:
    """Source ``neural_fly``."""

    name = "neural_fly"
    version = 1

    def recognises(self, path: Path, head: bytes) -> bool:
        return b"hover_throttle" in head and b"\x00" not in head[:512] and set(header_of(head)[0]) >= NEEDED

    def read(self, path: Path, data: bytes, sheet: Sheet | None = None) -> Flight:
        place = str(path)
        columns = _map()
        pwm = tuple(Entry("extra_pwm", name, "pwm", k) for k, name in enumerate(PWM))
        grid = cells_of(data, place, replace(columns, entries=(*columns.entries, *pwm)))
        if (why := not_seconds(grid.columns.get("t", np.zeros(0)))) is not None:
            raise InputError(f"{place}: column t", why, "the format has seconds; read it with a column map")
        q = [f"q[{k}]" for k in range(4)]
        faults = unit_length(grid, q) if all(name in grid.columns for name in q) else []
        flight = flight_of(columns, grid, path, self.name)
        notes = ["position, velocity and attitude as the vehicle flew by them: taken for its estimate",
                 *_axes(flight, place)]
        streams = dict(flight.streams)
        motors = [f"pwm[{k}]" for k in range(4)]
        if all(m in grid.columns for m in motors):
            kept = np.isfinite(grid.columns["t"])
            time_s = grid.columns["t"][kept] - grid.columns["t"][kept][0]
            streams["extra_pwm"] = Stream(time_s, np.stack([grid.columns[m][kept] for m in motors], axis=1),
                                          tuple(motors), PWM, ("1",) * 4)
            notes.append("extra_pwm: as found, its unit and the order of the motors are not documented")
        provenance = replace(flight.provenance, notes=(*flight.provenance.notes, *notes),
                             findings=(*flight.provenance.findings, *faults))
        return replace(flight, streams=streams, provenance=provenance, metadata={**flight.metadata, "read_as": notes})


def _map() -> ColumnMap:
    entries = [Entry("estimator", a, "p", k, "m") for k, a in enumerate("xyz")]
    entries += [Entry("estimator", f"v{a}", "v", k, "m/s") for k, a in enumerate("xyz")]
    entries += [Entry("attitude_qw", f"q{a}", "q", k) for k, a in enumerate("xyzw")]
    entries += [Entry("imu", f"gyro_{a}", "w", k, "rad/s") for k, a in enumerate("xyz")]
    entries += [Entry("setpoint", a, "p_d", k, "m") for k, a in enumerate("xyz")]
    entries += [Entry("command", "thrust", "T_sp", 0)]
    return ColumnMap("the format", Entry("", "time", "t", unit="s"), tuple(entries), {}, "")


def _axes(flight: Flight, place: str) -> list[str]:
    """A note that tilt and acceleration belong to each other, as in a world with z up. InputError where they are
    opposite."""
    if "estimator" not in flight or "attitude_qw" not in flight:
        return []
    estimate, attitude = flight["estimator"], flight["attitude_qw"]
    if any(v not in estimate for v in ("vx", "vy")) or len(estimate) < FEWEST_ROWS or len(attitude) != len(estimate):
        return ["axes are those of the format: too little here to check them"]
    step = float(np.median(np.diff(estimate.time_s)))
    lag = max(round(STEP_S / step), 1) if step > 0.0 else 1
    change = estimate["vx", "vy"][lag:] - estimate["vx", "vy"][:-lag]
    with np.errstate(divide="ignore", invalid="ignore"):
        acc = change / (estimate.time_s[lag:] - estimate.time_s[:-lag])[:, None]
    up = so3.rotate(attitude["qx", "qy", "qz", "qw"], np.tile([0.0, 0.0, 1.0], (len(attitude), 1)))
    tilt = GRAVITY_M_S2 * up[lag // 2: lag // 2 + len(acc), :2]
    known = np.isfinite(acc).all(axis=1) & np.isfinite(tilt).all(axis=1)
    acc, tilt = acc[known] - acc[known].mean(axis=0), tilt[known] - tilt[known].mean(axis=0)
    if len(acc) < FEWEST_ROWS or float(np.sqrt((tilt**2).mean())) < MOVES_M_S2:
        return ["axes are those of the format: too little here to check them"]
    shared = float((acc * tilt).sum() / np.sqrt((acc**2).sum() * (tilt**2).sum()))
    if shared < -SHOWN:
        raise InputError(f"{place}: column q", f"tilts against its acceleration (correlation {shared:.2f}): its axes "
                         "are not those of the format, a world with z up", "read it with a column map that names them")
    return [f"world with z up: tilt and acceleration agree (correlation {shared:.2f})" if shared > SHOWN else
            f"axes are those of the format; tilt and acceleration do not show them (correlation {shared:.2f})"]
