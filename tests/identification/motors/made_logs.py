"""A vehicle that flies in plain arithmetic of its own, logged at 500 Hz with rotor speeds: the truth is known.

Thrust lags behind its command (up and down apart), a straight law of motor voltage, rotors speed measured late; a rate
loop keeps it in the air and a disturbance of the command moves it.
"""

import struct
import zlib

import numpy as np

from nanobench_tools.flight import Flight, Provenance, make_stream
from nanobench_tools.units import PWM_FULL_SCALE

ROW_S = 0.002
MASS, K_F, K_M, INERTIA, ARM = 0.035, 2.0e-8, 0.006, (1.7e-5, 1.9e-5, 3.1e-5), 0.0325
SLOPE = 0.06
X, Y, SPIN = np.array([1, -1, -1, 1]), np.array([-1, -1, 1, 1]), np.array([-1, 1, -1, 1])
DRAG = -4e-4
MOTORS = ("m1", "m2", "m3", "m4")


def _turn(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """World vectors (n, 3) of body vectors (n, 3)."""
    xyz, w = q[:, :3], q[:, 3:]
    t = 2.0 * np.cross(xyz, v)
    return v + w * t + np.cross(xyz, t)


def _rotation_rate(q: np.ndarray, w: np.ndarray) -> np.ndarray:
    x, y, z, s = q.T
    a, b, c = 0.5 * w.T
    return np.stack([s * a + y * c - z * b, s * b + z * a - x * c, s * c + x * b - y * a, -(x * a + y * b + z * c)], 1)


def fly(flights: int, seconds: float = 4.0, up_s: float = 0.05, down_s: float = 0.11, late_rows: int = 2,
        noise: float = 0.0, seed: int = 0, rough: float = 0.03) -> list[dict[str, np.ndarray]]:
    """Logs of ``flights``; steps of 1 ms. noise: SD of the speed [rad/s], a thousandth of it that of the gyro [rad/s];
    rough: SD of the PWM ratio that is added to what the rate loop asks for, new every 4 to 40 ms."""
    rng = np.random.default_rng(seed)
    rows, fine = round(seconds / ROW_S), 2
    hover = MASS * 9.81 / 4.0
    battery = 3.9 - 0.4 * np.arange(rows) / rows + 0.05 * rng.normal(size=(flights, 1))
    lift = 2.0 * hover / SLOPE  # motor voltage at which a rotor carries twice its share
    center = lift / 2.0 + 1.0
    thrust = np.full((flights, 4), hover)
    rate, velocity, position = (np.zeros((flights, 3)) for _ in range(3))
    q = np.tile([0.0, 0.0, 0.0, 1.0], (flights, 1))
    added, left = np.zeros((flights, 4)), np.zeros(flights)
    log = {name: np.zeros((rows, flights, k)) for name, k in (("u", 4), ("speed", 4), ("rate", 3), ("force", 3),
                                                               ("position", 3), ("velocity", 3), ("q", 4))}
    for i in range(rows):
        fresh = left <= 0
        added[fresh] = rough * rng.normal(size=(int(fresh.sum()), 4))
        left[fresh] = rng.integers(2, 21, int(fresh.sum()))
        left -= 1
        body_v = _turn(q * [-1, -1, -1, 1], velocity)
        tilt = _turn(q * [-1, -1, -1, 1], np.tile([0.0, 0.0, 1.0], (flights, 1)))  # world up seen from the body
        roll = 1.5e-4 * (-rate[:, 0] - 3.0 * (tilt[:, 1] - 0.05 * body_v[:, 1]))
        pitch = 1.5e-4 * (-rate[:, 1] + 3.0 * (tilt[:, 0] - 0.05 * body_v[:, 0]))
        yaw = -2e-4 * rate[:, 2]
        force = hover * (1.0 - 0.3 * velocity[:, 2] - 0.3 * position[:, 2])[:, None]
        wanted = force + (roll[:, None] * Y - pitch[:, None] * X) / (4 * ARM) + yaw[:, None] * SPIN / (4 * K_M)
        u = np.clip((center + (wanted - hover) / SLOPE) / battery[:, i:i + 1] + added, 0.0, 1.0)
        log["u"][i], log["speed"][i], log["rate"][i] = u, np.sqrt(np.maximum(thrust, 0.0) / K_F), rate
        log["force"][i, :, 2] = thrust.sum(1) / MASS
        log["position"][i], log["velocity"][i], log["q"][i] = position, velocity, q
        asked = hover + SLOPE * (u * battery[:, i:i + 1] - center)
        for _ in range(fine):
            h = ROW_S / fine
            thrust = asked + (thrust - asked) * np.exp(-h / np.where(asked > thrust, up_s, down_s))
            body_v = _turn(q * [-1, -1, -1, 1], velocity)
            moment = np.stack([ARM * thrust @ Y - DRAG * body_v[:, 1], -ARM * thrust @ X + DRAG * body_v[:, 0],
                               K_M * thrust @ SPIN], axis=1)
            turning = (moment - np.cross(rate, rate * INERTIA)) / INERTIA
            lift_b = np.zeros((flights, 3))
            lift_b[:, 2] = thrust.sum(1) / MASS
            velocity = velocity + h * (_turn(q, lift_b) - [0.0, 0.0, 9.81])
            position = position + h * velocity
            q = q + h * _rotation_rate(q, rate)
            q /= np.linalg.norm(q, axis=1, keepdims=True)
            rate = rate + h * turning
    found = []
    for f in range(flights):
        late = np.maximum(np.arange(rows) - late_rows, 0)
        found.append({"u": log["u"][:, f], "battery_V": battery[f],
                      "speed": log["speed"][late, f] + noise * rng.normal(size=(rows, 4)),
                      "rate": log["rate"][:, f] + 1e-3 * noise * rng.normal(size=(rows, 3)),
                      "force_z": log["force"][:, f, 2] + 0.01 * noise * rng.normal(size=rows),
                      "position": log["position"][:, f], "velocity": log["velocity"][:, f],
                      "quaternion": log["q"][:, f]})
    return found


def flight(log: dict[str, np.ndarray], name: str = "made", row_s: float = ROW_S) -> Flight:
    """As a source would give it."""
    time_s = np.arange(len(log["u"])) * row_s
    imu = np.column_stack([log["force_z"], log["rate"]])
    streams = {
        "motor": make_stream("motor", time_s, log["u"], MOTORS),
        "rpm": make_stream("rpm", time_s, log["speed"], MOTORS),
        "battery": make_stream("battery", time_s, log["battery_V"][:, None], ("vbat",)),
        "imu": make_stream("imu", time_s, imu, ("acc_z", "gyro_x", "gyro_y", "gyro_z")),
        "estimator": make_stream("estimator", time_s, np.column_stack([log["position"], log["velocity"]]),
                                 ("x", "y", "z", "vx", "vy", "vz")),
        "attitude_qw": make_stream("attitude_qw", time_s, log["quaternion"], ("qx", "qy", "qz", "qw"))}
    return Flight(name, streams, {}, Provenance(f"{name}.log", name, "made", synthetic=True))


def usd(log: dict[str, np.ndarray]) -> bytes:
    """The log as the card of the vehicle holds it, version 2."""
    names = [*(f"gyro.{a}" for a in "xyz"), "acc.z", *(f"rpm.m{i}" for i in range(1, 5)),
             *(f"pwm.m{i}_pwm" for i in range(1, 5)), "pm.vbat", *(f"stateEstimate.{a}" for a in "xyz"),
             *(f"stateEstimate.v{a}" for a in "xyz"), *(f"stateEstimate.q{a}" for a in "xyzw")]
    columns = np.column_stack([np.degrees(log["rate"]), log["force_z"] / 9.81, log["speed"] * 30.0 / np.pi,
                               log["u"] * PWM_FULL_SCALE, log["battery_V"], log["position"], log["velocity"],
                               log["quaternion"]])
    out = bytearray([0xBC]) + struct.pack("<HH", 2, 1) + struct.pack("<H", 0xFFFF) + b"fixedFrequency\0"
    out += struct.pack("<H", len(names)) + b"".join(f"{n}(f)".encode() + b"\0" for n in names)
    for i, row in enumerate(columns):
        out += struct.pack("<HQ", 0xFFFF, 1_000_000 + 2000 * i) + struct.pack(f"<{len(names)}f", *row)
    return bytes(out + struct.pack("<I", zlib.crc32(bytes(out))))
