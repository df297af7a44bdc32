"""Flights of a vehicle of any number of rotors, flown closed loop by a model itself and logged like a real one."""

from dataclasses import replace

import numpy as np

from nanobench_tools import so3
from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.physics import Model, Vehicle
from nanobench_tools.physics.inputs import settled
from nanobench_tools.physics.rollout import compiled_step

ROW_S = 0.01
UP = np.array([0.0, 0.0, 1.0])
WARM = 200
"""Rows flown before the log begins."""


def ring(rotors: int, arm_m: float) -> tuple[tuple[float, float], ...]:
    """Motors on a circle, the first half a step right of the front."""
    angles = -np.pi * (2.0 * np.arange(rotors) + 1.0) / rotors
    return tuple((round(arm_m * float(np.cos(a)), 6), round(arm_m * float(np.sin(a)), 6)) for a in angles)


def vehicle_of(rotors: int, mass_kg: float, arm_m: float) -> Vehicle:
    """Inertia of so much mass at half the arms; spins alternate (of three, one is alone)."""
    inertia = mass_kg * (0.5 * arm_m) ** 2
    return Vehicle(mass_kg, (inertia, inertia, 1.8 * inertia), ring(rotors, arm_m),
                   tuple(-1.0 if k % 2 == 0 else 1.0 for k in range(rotors)))


def model_of(rotors: int = 6, mass_kg: float = 1.6, arm_m: float = 0.25, **terms) -> Model:
    """Hovers at half its command; drag takes 0.4 of the speed a second. Of an odd number of rotors none turns it."""
    vehicle = vehicle_of(rotors, mass_kg, arm_m)
    lift = mass_kg * 9.81 / rotors
    k_m = 0.13 * arm_m if rotors % 2 == 0 else 0.0
    return Model(vehicle, {"thrust_pwm": {"c": (0.0, 0.4 * lift, 3.2 * lift)}, "yaw_torque": {"k_m": k_m},
                           "motor_lag": {"tau_up_s": 0.04, "tau_down_s": 0.04},
                           "drag_linear": {"d": (0.4 * mass_kg, 0.4 * mass_kg, 0.15 * mass_kg)}, **terms})


def _memory(rng: np.random.Generator, shape: tuple[int, ...], size: float, last_s: float) -> np.ndarray:
    """Noise (rows, ...) that lasts."""
    keep, found = np.exp(-ROW_S / last_s), rng.standard_normal(shape)
    for k in range(1, len(found)):
        found[k] = keep * found[k - 1] + np.sqrt(1.0 - keep**2) * found[k]
    return size * found


def flown(model: Model, flights: int = 3, seconds: float = 15.0, seed: int = 1) -> dict[str, np.ndarray]:
    """State and inputs at every row (rows, ..., flights): a cascade of P and PD loops follows wavy paths through gusts,
    with the gains of a vehicle that is as ``model`` without what is wrong with it."""
    rng = np.random.default_rng(seed)
    rows, n, vehicle = round(seconds / ROW_S) + WARM, flights, model.vehicle
    t = ROW_S * np.arange(rows)
    size, hertz, phase = (rng.uniform(low, high, (3, 3, n)) for low, high in ((0.25, 0.6), (0.08, 0.35), (0.0, 6.28)))
    wave = size * np.sin(2 * np.pi * hertz * t[:, None, None, None] + phase)
    goal = np.stack([wave[:, 0].sum(1), wave[:, 1].sum(1), 1.6 + 0.4 * wave[:, 2].sum(1)], axis=1)
    gust, kick = _memory(rng, (rows, 3, n), 0.04, 0.4), _memory(rng, (rows, 3, n), 1.0, 0.05)
    battery = np.linspace(4.1, 3.6, rows)[:, None] + _memory(rng, (rows, n), 0.01, 2.0)
    shake = 0.006 * rng.standard_normal((rows, vehicle.rotors, n))
    step = compiled_step(model, 1.0 / ROW_S)
    x, y = np.array(vehicle.motor_positions_m).T
    k_m = model.parameters["yaw_torque.k_m"]
    mix = np.linalg.pinv(np.stack([np.ones(vehicle.rotors), y, -x, k_m * np.array(vehicle.spin)]))
    inertia, c = np.array(vehicle.inertia_kg_m2)[:, None], model.values_of("thrust_pwm")["c"]
    state = np.zeros((13, n))
    state[0:3], state[9] = goal[0], 1.0
    hover = np.array([*[0.5] * vehicle.rotors, 3.8])[:, None] * np.ones(n)
    hover = np.concatenate([hover, np.zeros((len(model.inputs) - len(hover), n))])
    thrust = settled(model, hover, row_hz=1.0 / ROW_S)
    log: dict[str, list] = {"state": [], "motor": []}
    for k in range(rows):
        turn = so3.matrix(state[6:10].T)
        ahead = goal[min(k + 1, rows - 1)] - goal[k]
        asked = 4.0 * (goal[k] - state[0:3]) + 3.0 * (ahead / ROW_S - state[3:6]) + 9.81 * UP[:, None]
        asked[:2] = np.clip(asked[:2], -5.0, 5.0)
        body = np.einsum("nji,jn->in", turn, asked)
        tilt = np.stack([-body[1], body[0], -2.0 * np.arctan2(state[8], state[9])]) / 9.81
        rate = np.array([6.0, 6.0, 9.81 * 1.0])[:, None] * tilt
        moment = inertia * np.array([18.0, 18.0, 6.0])[:, None] * (rate - state[10:13])
        wanted = np.clip(mix @ np.concatenate([vehicle.mass_kg * body[2:3], moment]), 0.0, None)
        u = (-c[1] + np.sqrt(c[1] ** 2 + 4.0 * c[2] * wanted)) / (2.0 * c[2]) + shake[k]
        u = np.clip(u, 0.02, 0.98)
        log["state"].append(state)
        log["motor"].append(u)
        row = [*u, battery[k]]
        row += [*(log["motor"][-2] if k else u), np.zeros(n)] if "command_delay" in model else []
        after = step(np.concatenate([state, thrust]), np.array([row]), model.values, keep="last")[0]
        state, thrust = after[:13].copy(), after[13:]
        state[3:6] += ROW_S * gust[k]
        state[10:13] += ROW_S * kick[k]
    return {**{name: np.stack(values)[WARM:] for name, values in log.items()}, "battery": battery[WARM:]}


def flights_of(model: Model, flights: int = 3, command: str | None = None, seed: int = 1, **options) -> list[Flight]:
    """Recordings of 100 Hz. ``command``: a collective one, "1" or "N", in place of motors and gyro, and then nothing
    but pose, command and battery."""
    log, c = flown(model, flights, seed=seed, **options), model.values_of("thrust_pwm")["c"]
    rng = np.random.default_rng(seed + 1000)
    time_s = ROW_S * np.arange(len(log["battery"]))
    found = []
    for k in range(flights):
        state, motor = log["state"][:, :, k], log["motor"][:, :, k]
        pose = np.concatenate([state[:, 0:3] + 3e-5 * rng.standard_normal((len(time_s), 3)),
                               so3.multiply(state[:, 6:10], so3.exp(3e-4 * rng.standard_normal((len(time_s), 3))))], 1)
        streams = {"mocap": make_stream("mocap", time_s, pose, ("px", "py", "pz", "qx", "qy", "qz", "qw")),
                   "battery": make_stream("battery", time_s, log["battery"][:, k:k + 1], ("vbat",))}
        if command is None:
            names = tuple(f"m{i + 1}" for i in range(motor.shape[1]))
            gyro = state[:, 10:13] + 3e-3 * rng.standard_normal((len(time_s), 3))
            streams["motor"] = make_stream("motor", time_s, motor, names)
            streams["imu"] = make_stream("imu", time_s, gyro, ("gyro_x", "gyro_y", "gyro_z"))
        else:
            whole = motor.mean(axis=1) if command == "1" else (c[1] * motor + c[2] * motor**2).sum(axis=1)
            made = make_stream("command", time_s, whole[:, None], ("thrust",))
            streams["command"] = replace(made, unit=(command,))
        found.append(Flight(f"flight_{k + 1}", streams, {}, Provenance(f"flight_{k + 1}", f"{seed}{k}", "made", True)))
    return found
