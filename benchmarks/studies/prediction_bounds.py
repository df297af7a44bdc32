"""What bounds Task 1: how good a prediction could be if one thing were known, measured on the test flights.

    python benchmarks/studies/prediction_bounds.py [--clock as-recorded|retimed] [--data DIR] [--json FILE]

Rows:

- the fitted models of ``nanobench sysid``;
- the same with the gyro known over the horizon (attitude integrated from it, thrust and drag of the model): the
  remaining error with perfect rotation;
- the model with only every second motor packet: the cost of halving the radio rate;
- the gyro against itself smoothed over five rows: the noise floor of its truth at h = 1.

Without recordings, practice flights (SYNTHETIC).
"""

import json
from dataclasses import replace

import numpy as np
from prediction_table import COLUMNS, asked, line

from identification.greybox.ablation_study import fit_item, predictor_of, rungs
from identification.greybox.fitted_predictor import GreyBoxPredictor, past_inputs, start_of
from nanobench_tools import so3
from nanobench_tools.methods import Prediction, Windows
from nanobench_tools.metrics.prediction import QUANTITIES, multi_horizon, window_errors
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.model import ROTOR
from nanobench_tools.physics.rollout import rollout
from nanobench_tools.protocols.windows import cut_windows

NAMES = ("fit_balanced", "fit_observed")
SMOOTH = np.array([-3.0, 12.0, 17.0, 12.0, -3.0]) / 35.0
"""Savitzky-Golay, 5 rows, cubic: the residual is white noise times sqrt(1 - 17/35)."""
LEFT = np.sqrt(1.0 - 17.0 / 35.0)


def rates_known(predictor: GreyBoxPredictor, windows: Windows, came: Prediction) -> Prediction:
    """Thrust and drag of the model along the attitude that the gyro gives: trapezoids over each row."""
    model = predictor.model
    patterns = np.array([n.vector(model) for n in predictor.nuisances_])
    own = predictor.nuisances(windows) @ patterns
    values = model.values + own
    states = rollout(model, start_of(windows), windows.motor, windows.battery_V, past_inputs(windows),
                     parameters=values)
    thrust = states[..., ROTOR].sum(axis=2)
    d = values[:, [model.index(f"drag_linear.d[{i}]") for i in range(3)]]
    step = 1.0 / windows.rate_hz
    rate = np.concatenate([windows.rate_rad_s[:, None], came.rate_rad_s], axis=1)
    q, v, p = windows.quaternion, windows.velocity_m_s, windows.position_m
    mass, gravity = model.vehicle.mass_kg, np.array([0.0, 0.0, -model.vehicle.gravity_m_s2])
    tilt = np.zeros((len(windows), 4))
    tilt[:, 3] = 1.0
    if "frame_tilt" in model:
        roll, pitch = (values[:, model.index(f"frame_tilt.{a}_rad")] for a in ("roll", "pitch"))
        zero = np.zeros_like(roll)
        tilt = so3.multiply(so3.exp(np.stack([roll, zero, zero], 1)), so3.exp(np.stack([zero, pitch, zero], 1)))

    def acceleration(j: int, attitude: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        force = -d * so3.rotate_inverse(attitude, velocity)
        force[:, 2] += thrust[:, j]
        return so3.rotate(attitude, so3.rotate(tilt, force)) / mass + gravity

    found: list[list[np.ndarray]] = [[], [], []]
    for j in range(windows.horizon):
        after = so3.multiply(q, so3.exp(0.5 * step * (rate[:, j] + rate[:, j + 1])))
        first = acceleration(j, q, v)
        last = acceleration(j + 1, after, v + step * first)
        p = p + step * v + step**2 * (first / 3.0 + last / 6.0)
        v, q = v + 0.5 * step * (first + last), after
        for kept, value in zip(found, (p, v, q), strict=True):
            kept.append(value)
    position, velocity, quaternion = (np.stack(kept, axis=1) for kept in found)
    return Prediction(position, velocity, quaternion, came.rate_rad_s)


def half_the_packets(windows: Windows) -> Windows:
    """Every second row of the motors replaced by the mean of its neighbours, in the window and before it."""
    def thinned(rows: np.ndarray) -> np.ndarray:
        rows = rows.copy()
        rows[:, 1:-1:2] = 0.5 * (rows[:, :-2:2][:, :rows[:, 1:-1:2].shape[1]] + rows[:, 2::2])
        return rows

    return replace(windows, motor=thinned(windows.motor), motor_past=thinned(windows.motor_past))


def main() -> None:
    args, split, word = asked(__doc__)
    fitted = {rung.name: predictor_of(fit_item(split.train, rung, 0, Vehicle())) for rung in rungs(NAMES)}
    sums: dict[str, list] = {}
    noise = []
    for case in split.test:
        cut = cut_windows(case.flight, case.spans, "onboard", past=True)
        if cut is None:
            continue
        windows, came = cut
        for name, predictor in fitted.items():
            for label, prediction in ((name, predictor.predict(windows)),
                                      (f"{name}, gyro known", rates_known(predictor, windows, came)),
                                      (f"{name}, half the motor packets",
                                       predictor.predict(half_the_packets(windows)))):
                found = window_errors(prediction, came)
                sums.setdefault(label, []).append([len(windows), *(found[q].sum(axis=0) for q in QUANTITIES)])
        gyro = came.rate_rad_s
        smooth = sum(w * gyro[:, i:gyro.shape[1] - 4 + i] for i, w in enumerate(SMOOTH))
        noise.append(np.linalg.norm(gyro[:, 2:-2] - smooth, axis=-1).ravel() / LEFT)
    print(f"{len(split.test)} {word} test flights, clock {args.clock}: {COLUMNS}")
    rows = {}
    for label, parts in sums.items():
        count = sum(part[0] for part in parts)
        rows[label] = {q: multi_horizon(sum(part[1 + i] for part in parts) / count) for i, q in enumerate(QUANTITIES)}
        print(line(label, rows[label]))
    floor = float(np.mean(np.concatenate(noise)))
    print(f"gyro rows against five smoothed ones: {floor:.4f} rad/s, the part of rate at h = 1 that no model foresees")
    if args.json:
        args.json.write_text(json.dumps({"rows": rows, "gyro_noise_rad_s": floor}))


if __name__ == "__main__":
    main()
