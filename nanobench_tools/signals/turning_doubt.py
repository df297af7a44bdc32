"""Gyro and attitude that contradict each other: which of them is wrong, and by what evidence.

A column of the gyro that is negated, or two that changed places, look like elements of the attitude that are. Other
streams decide. A vehicle accelerates towards the side to which it tilts. Its specific force is that of its path, and
its yaw follows the set-point. Its motors turn it about x and y. Evidence counts where it fits one of the two readings,
and the other clearly less. Otherwise it is open, as it is if two pieces of evidence contradict each other.
"""

from dataclasses import dataclass, replace
from itertools import combinations, permutations, product

import numpy as np

from ..flight import Flight
from ..time_offsets.mathematics.lags import lag_sums
from .axis_unit_matching import CLEAR, correlations
from .context import Context
from .estimated_turning import EULER, GYRO, follows_estimate
from .flown_axes import UP, tilts
from .held_poses import ROTATION
from .mocap_derivatives import STEP_S, derivatives_of
from .motor_turning import motor_turning
from .own_reference import own_reference
from .own_turning import FOLLOWS
from .pairs import force_pair, gyro_pair
from .pose_frame import pose_frame
from .quaternion_reading import CLEARLY, FITS
from .tracked_tilt import completed_poses

READINGS = tuple(np.eye(3)[list(order)] * np.array(signs) for order in permutations(range(3))
                 for signs in product((1.0, -1.0), repeat=3))
"""The 48 signed orders (3, 3) of three columns."""
TURNS_RAD = 0.35
"""A yaw that turns by less, some 20 deg, shows no sign."""
ATTITUDES = {"mocap": ROTATION, "attitude_qw": ROTATION, "attitude": EULER}


@dataclass(frozen=True)
class TurningDoubt:
    """A gyro in signs or axes that one change of the attitude explains as well.

    - stream: of the attitude;
    - changes: its columns, each entry a way to explain the gyro: one is negated, or two changed places;
    - gyro (3, 3): signs and axes of the attitude that each axis of the gyro has, if the attitude is right;
    - wrong: ``imu``, or ``stream``; "" where it is open;
    - why: the evidence in words, empty without any."""

    stream: str
    changes: tuple[tuple[str, ...], ...]
    gyro: np.ndarray
    wrong: str
    why: str

    def mended(self, flight: Flight) -> Flight:
        """The flight without the contradiction. The gyro is changed where it is open which is wrong."""
        if self.wrong == self.stream:
            return changed(flight, self.stream, self.changes[0])
        imu = flight["imu"]
        values, columns = imu.values.copy(), [imu.index(q) for q in GYRO]
        values[:, columns] = values[:, columns] @ self.gyro
        return flight.with_streams(imu=replace(imu, values=values))


def turning_doubt(context: Context) -> TurningDoubt | None:
    """None where gyro and attitude agree, without both, and where no change of one or two columns of the attitude
    explains the gyro."""
    stream = next((name for name, columns in ATTITUDES.items() if name in context.flight and all(
        q in context.flight[name] for q in columns)), "")
    turning = _turning(context)
    if not stream or turning is None:
        return None
    gyro, follows = _best(turning)
    clear = (gyro * turning).sum(axis=1)[np.diag(gyro) < 1.0]
    if follows < np.trace(turning) + CLEAR or clear.min() < FOLLOWS or np.linalg.det(gyro) > 0.0:
        return None  # the last one: whole frames, which are turned
    stored = _judges(context)
    shown = {by: why for by, why in (_pushed(context.flight, stream, gyro), _estimated(context.flight, stream, gyro))
             if by}
    blamed: dict[tuple[str, ...], set[str]] = {}
    why = list(shown.values())
    for change in (*((q,) for q in ATTITUDES[stream]), *combinations(ATTITUDES[stream], 2)):
        turned = Context(changed(context.flight, stream, change))
        found = _turning(turned)
        if found is None or np.trace(found) < follows - CLEAR:
            continue
        blamed[change] = set(shown)
        if abs(np.trace(found) - follows) > CLEARLY:
            blamed[change].add(stream if np.trace(found) > follows else "imu")
            why.append(f"gyro and attitude correlate {np.trace(found) / 3.0:+.2f} with {', '.join(change)} changed, "
                       f"{follows / 3.0:+.2f} with the gyro changed")
        for what, fits in _judges(turned).items():
            before = stored.get(what, -1.0)
            if max(fits, before) > FITS and abs(fits - before) > CLEARLY:
                blamed[change].add(stream if fits > before else "imu")
                why.append(f"{what} correlate {before:+.2f} as stored, {fits:+.2f} with {', '.join(change)} changed")
    left = {change: by for change, by in blamed.items() if by != {"imu"}}
    sure = tuple(change for change, by in left.items() if by == {stream})
    if not blamed:
        return None
    return TurningDoubt(stream, sure or tuple(left) or tuple(blamed), gyro,
                        stream if len(sure) == 1 else "" if left else "imu", "; ".join(why))


def changed(flight: Flight, name: str, change: tuple[str, ...]) -> Flight:
    """The flight with one column of a stream negated, or two exchanged."""
    stream = flight[name]
    values, columns = stream.values.copy(), [stream.index(q) for q in change]
    values[:, columns] = -values[:, columns] if len(columns) == 1 else values[:, columns[::-1]]
    return flight.with_streams(**{name: replace(stream, values=values)})


def turns_otherwise(context: Context) -> bool:
    """Whether the gyro clearly turns about other axes than the attitude."""
    turning = _turning(context)
    return turning is not None and _best(turning)[1] > np.trace(turning) + CLEAR


def _best(turning: np.ndarray) -> tuple[np.ndarray, float]:
    """The one of ``READINGS`` that explains most of the correlations (3, 3), and their sum."""
    best = max(READINGS, key=lambda reading: float((reading * turning).sum()))
    return best, float((best * turning).sum())


def _turning(context: Context) -> np.ndarray | None:
    """(3, 3) correlation of each axis of the gyro with each of the attitude, at the delay of the best match."""
    pair = context.once(gyro_pair)
    if pair is None:
        found = context.once(follows_estimate)
        return None if found is None else found[0]
    sums = lag_sums(pair.measured, pair.reference, pair.use, STEP_S, pair.reach_s)
    k = None if sums is None else correlations(sums)
    return None if k is None else np.asarray(k[int(np.argmax(np.abs(k).max(axis=2).sum(axis=1)))])


def _judges(context: Context) -> dict[str, float]:
    """Correlations that show an attitude to be right, by what is compared."""
    tracked = "mocap" in context.flight and all(q in context.flight["mocap"] for q in ROTATION)
    poses = context if tracked else context.once(completed_poses) or context.once(own_reference)
    if poses is None:
        return {}
    found, frame = {}, poses.once(pose_frame)
    tilt = poses.once(tilts)["x, y, z, w"].get((frame.world or UP, frame.body or UP))
    if tilt is not None:
        found["tilt and acceleration"] = tilt.follows
    if (pair := poses.once(force_pair)) is not None:
        use = pair.use
        product = np.sqrt((pair.measured[use] ** 2).sum() * (pair.reference[use] ** 2).sum())
        found["specific force and path"] = float((pair.measured[use] * pair.reference[use]).sum() / max(product, 1e-12))
    truth = poses.once(derivatives_of)
    for name in ("setpoint", "pid") if truth is not None else ():
        asked = poses.flight.streams.get(name)
        if truth is None or asked is None or "yaw" not in asked or len(asked) < 2:
            continue
        yaw = np.unwrap(np.interp(truth.time_s, asked.time_s, np.unwrap(asked["yaw"])))
        if np.ptp(yaw) > TURNS_RAD and np.ptp(truth.euler_rad[:, 2]) > TURNS_RAD:
            found["yaw and its set-point"] = float(np.corrcoef(yaw, truth.euler_rad[:, 2])[0, 1])
    return found


def _pushed(flight: Flight, stream: str, gyro: np.ndarray) -> tuple[str, str]:
    """Which of ``stream`` and ``imu`` the motors contradict about x and y, and words; "" where they do not show it.

    gyro (3, 3): axes of the attitude that the gyro has."""
    found = motor_turning(Context(flight.without_streams(*(set(flight.streams) - {"imu", "motor"}))))
    if found is None or np.array_equal(gyro[:2, :2], np.eye(2)):
        return "", ""
    if found.as_usual:
        return stream, "the motors push as the gyro turns"
    axes = np.zeros((2, 2))
    if found.gyro is not None:
        axes[[0, 1], list(found.gyro[0])] = found.gyro[1]
    return ("imu", "the motors push as the attitude turns") if np.array_equal(axes, gyro[:2, :2]) else ("", "")


def _estimated(flight: Flight, stream: str, gyro: np.ndarray) -> tuple[str, str]:
    """The same by an estimated attitude, next to a tracked one."""
    turning = _turning(Context(flight.without_streams("mocap"))) if stream == "mocap" else None
    if turning is None:
        return "", ""
    best, follows = _best(turning)
    if follows < np.trace(turning) + CLEARLY:
        return stream, "the estimated attitude turns as the gyro"
    return ("imu", "the estimated attitude turns as the tracked one") if np.array_equal(best, gyro) else ("", "")
