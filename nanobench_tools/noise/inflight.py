"""The sensor as it flies: vibration by PWM, spectra, and how fast its integrals leave the motion capture.

Over a time T, the gyro's integral and the rotation of the poses differ by two parts. The poses' own noise does not
grow; the other part is N sqrt(T). N is the density that an estimator has to assume; it includes vibration, lost packets
and late timestamps. The same for world-vertical velocity, where half a degree of tilt counts little. Mean differences
are biases.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .. import so3
from ..flight import Flight, Span, mask_of
from ..settings import count, number, setting
from ..units import GRAVITY_M_S2
from .rest import ACC, GYRO

OVER_S = setting("noise.inflight.over_s")
EVERY_S = number("noise.inflight.every_s")

PWM_STEP = number("noise.inflight.pwm_step")
WINDOW_S = number("noise.inflight.window_s")
BANDS_HZ = setting("noise.inflight.bands_hz")
LEAST_PER_BIN = count("noise.inflight.least_per_bin")
ROUNDS = count("noise.inflight.rounds")


@dataclass
class InFlight:
    """Statistics of the noise in flight.

    - differences {T: [(gyro (3,), vertical)]}: of windows, bias per flight removed.
    - gyro_bias, acc_bias: of flights, z [m/s^2] and body axes [rad/s].
    - vibration [(pwm, acc SD (3,), gyro SD (3,))]: of windows.
    - power {band: [acc, gyro]}: densities [(m/s^2)^2/Hz, (rad/s)^2/Hz], mean of axes."""

    flights: int = 0
    turns: dict[float, list[np.ndarray]] = field(default_factory=lambda: {t: [] for t in OVER_S})
    gains: dict[float, list[float]] = field(default_factory=lambda: {t: [] for t in OVER_S})
    gyro_bias: list[np.ndarray] = field(default_factory=list)
    acc_bias: list[float] = field(default_factory=list)
    vibration: list[tuple[float, np.ndarray, np.ndarray]] = field(default_factory=list)
    power: dict[tuple[float, float], list[tuple[float, float]]] = field(default_factory=dict)

    def add(self, flight: Flight, spans: Sequence[Span]) -> None:
        """One flight in the air and free of faults during ``spans``; without poses it gives vibration and spectra."""
        if "imu" not in flight or not all(name in flight["imu"] for name in ACC + GYRO):
            return
        imu = flight["imu"]
        self.flights += 1
        for span in spans:
            keep = mask_of([span], imu.time_s) & np.isfinite(imu[ACC + GYRO]).all(axis=1)
            time_s, values = imu.time_s[keep], imu[ACC + GYRO][keep]
            if len(time_s) > 20 and span.duration_s > 2.0 * WINDOW_S:
                self._shaken(flight, time_s, values)
                if "mocap" in flight:
                    self._against_poses(flight, time_s, values)

    def _shaken(self, flight: Flight, time_s: np.ndarray, values: np.ndarray) -> None:
        step = float(np.median(np.diff(time_s)))
        n = max(round(WINDOW_S / step), 8)
        pwm = None
        if "motor" in flight and len(flight["motor"]):
            motor = flight["motor"]
            pwm = np.interp(time_s, motor.time_s, motor["m1", "m2", "m3", "m4"].mean(axis=1))
        window = np.hanning(n)[:, None]
        frequency = np.fft.rfftfreq(n, step)
        for a in range(0, len(time_s) - n + 1, n):
            part = values[a : a + n]
            fast = np.diff(part, 2, axis=0) / np.sqrt(6.0)  # of white noise this keeps the SD and drops the motion
            if pwm is not None:
                self.vibration.append((float(pwm[a : a + n].mean()), fast[:, :3].std(axis=0), fast[:, 3:].std(axis=0)))
            shaped = np.fft.rfft((part - part.mean(axis=0)) * window, axis=0)
            power = np.abs(shaped) ** 2 * 2.0 * step / np.sum(window**2)
            for band in BANDS_HZ:
                inside = (frequency >= band[0]) & (frequency < band[1])
                if inside.any():
                    found = power[inside].mean(axis=0)
                    self.power.setdefault(band, []).append((float(found[:3].mean()), float(found[3:].mean())))

    def _against_poses(self, flight: Flight, time_s: np.ndarray, values: np.ndarray) -> None:
        mocap = flight["mocap"]
        good = np.isfinite(mocap.values).all(axis=1)
        if good.sum() < 20 or not all(name in mocap for name in ("qx", "vz")):
            return
        pose_s, q = mocap.time_s[good], so3.make_continuous(mocap["qx", "qy", "qz", "qw"][good])
        inside = (time_s >= pose_s[0]) & (time_s <= pose_s[-1])
        time_s, values = time_s[inside], values[inside]
        if len(time_s) < 20:
            return
        attitude = so3.interpolate(pose_s, q, time_s)
        speed = np.interp(time_s, pose_s, mocap["vz"][good])
        step = np.diff(time_s)
        force = so3.rotate(attitude, values[:, :3])[:, 2] - GRAVITY_M_S2
        fallen = np.concatenate(([0.0], np.cumsum(0.5 * (force[1:] + force[:-1]) * step)))
        rate = 0.5 * (values[1:, 3:] + values[:-1, 3:]) * step[:, None]
        turn = _products(np.vstack([[0.0, 0.0, 0.0, 1.0], so3.exp(rate)]))
        span = time_s[-1] - time_s[0]
        for over in OVER_S:
            starts = np.searchsorted(time_s, np.arange(time_s[0], time_s[-1] - over, EVERY_S))
            ends = np.searchsorted(time_s, time_s[starts] + over)
            starts, ends = starts[ends < len(time_s)], ends[ends < len(time_s)]
            if len(starts) < 3:
                continue
            seen = so3.multiply(so3.conjugate(attitude[starts]), attitude[ends])
            felt = so3.multiply(so3.conjugate(turn[starts]), turn[ends])
            off = so3.log(so3.multiply(so3.conjugate(seen), felt))
            gain = fallen[ends] - fallen[starts] - (speed[ends] - speed[starts])
            if over == 1.0 and span > 5.0:
                self.gyro_bias.append(off.mean(axis=0) / over)
                self.acc_bias.append(float(gain.mean() / over))
            self.turns[over].append(off - off.mean(axis=0))
            self.gains[over].append(gain - gain.mean())

    def scatter(self) -> dict[float, tuple[float, float, int]]:
        """{T: (SD of the turn's difference per axis [rad], of the vertical velocity's [m/s], windows)}."""
        found = {}
        for over in OVER_S:
            if self.turns[over]:
                turns, gains = np.concatenate(self.turns[over]), np.concatenate(self.gains[over])
                # the median square is that of a normal distribution less the few windows that went wrong
                found[over] = (float(np.sqrt(np.median(turns**2) / 0.455)), float(np.sqrt(np.median(gains**2) / 0.455)),
                               len(gains))
        return found

    def densities(self) -> tuple[float, float, float, float]:
        """(gyro, acc densities, gyro, acc bias walks) from the growth of the scatter: s^2 = c^2 + N^2 T + W^2 T^3 / 3.
        All are at least zero; nan without poses."""
        from scipy.optimize import nnls

        scatter = self.scatter()
        if len(scatter) < 3:
            return (float("nan"),) * 4
        over = np.array(list(scatter))
        design = np.stack([np.ones_like(over), over, over**3 / 3.0], axis=1)
        independent = np.array([values[2] for values in scatter.values()]) * np.minimum(EVERY_S / over, 1.0)
        found = []
        for column in (0, 1):
            square = np.array([values[column] for values in scatter.values()]) ** 2
            model = over * np.median(square / over)
            for _ in range(ROUNDS):  # a variance is known to a share of what it is, not of what was seen
                weight = np.sqrt(independent) / model
                parts = nnls(design * weight[:, None], square * weight)[0]
                model = np.maximum(design @ parts, 1e-3 * square)
            found.append(np.sqrt(parts))
        return float(found[0][1]), float(found[1][1]), float(found[0][2]), float(found[1][2])

    def by_pwm(self) -> list[dict[str, float | int | list[float]]]:
        """Median vibration of windows by mean PWM ratio, in steps of PWM_STEP."""
        if not self.vibration:
            return []
        pwm = np.array([v[0] for v in self.vibration])
        acc, gyro = np.array([v[1] for v in self.vibration]), np.array([v[2] for v in self.vibration])
        rows: list[dict[str, float | int | list[float]]] = []
        for k in np.unique(np.floor(pwm / PWM_STEP)):
            inside = np.floor(pwm / PWM_STEP) == k
            if inside.sum() >= LEAST_PER_BIN:
                rows.append({"pwm": float((k + 0.5) * PWM_STEP), "windows": int(inside.sum()),
                             "acc_sd_m_s2": np.median(acc[inside], axis=0).tolist(),
                             "gyro_sd_rad_s": np.median(gyro[inside], axis=0).tolist()})
        return rows


def _products(each: np.ndarray) -> np.ndarray:
    """(n, 4) products of all quaternions up to each, in as many steps as n has binary digits."""
    product, shift = each.copy(), 1
    while shift < len(each):
        product[shift:] = so3.multiply(product[:-shift], product[shift:])
        shift *= 2
    return product
