"""Two clocks that were never compared: an onboard log and a separate motion-capture file, or any two streams.

The coarse offset aligns the magnitudes of the rotation rates, which depend neither on the frames nor on the start of
time. The fine and the moving part are then those of every other recording (``infer``).
"""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d
from scipy.signal import butter, correlate, correlation_lags, sosfiltfilt
from scipy.spatial.transform import Rotation

from ... import so3
from ...errors import InputError
from ...flight import Flight, Stream
from ...settings import count, number
from ...signals.context import Context
from ...signals.mocap_derivatives import STEP_S, MocapDerivatives, derivatives_of
from ..mathematics.packet_delay import CELL_S
from .confirm import evidence_gain
from .evidence import Evidence, Kind
from .infer import LATEST_S, ROW_S, smooth_delay
from .pairing_by_speed import with_positions
from .time_offset import TimeOffset, wander_of

GYRO = ("gyro_x", "gyro_y", "gyro_z")
BAND_HZ = number("retiming.pairing.band_hz")
SLOW_S = number("retiming.pairing.slow_s")

LEAST_CORRELATION = number("retiming.pairing.least_correlation")

RIVAL_S = number("retiming.pairing.rival_s")
RIVAL_SHARE = number("retiming.pairing.rival_share")

SQUARE_RAD = number("retiming.pairing.square_rad")

NOWHERE = number("retiming.pairing.nowhere")
FEWEST_KNOWN, FEWEST = count("retiming.pairing.fewest_known"), count("retiming.pairing.fewest")
START_NOISE, LEAST_NOISE = number("retiming.pairing.start_noise"), number("retiming.pairing.least_noise")
START_WEIGHT = number("retiming.pairing.start_weight")


def with_mocap(flight: Flight, tracked: Flight) -> Flight:
    """``flight`` with the motion capture of ``tracked``, which was recorded on another clock, on its own.

    Positions alone are compared with the estimate's (``pairing_by_speed``). The offset between the clocks may be
    anything. The tracker's body frame is turned onto the axes of the gyro where
    it lies more than SQUARE_RAD away. ``provenance.notes`` say what was done. InputError, naming the file, when the
    recordings are not of one flight or the offset is not unique.
    """
    place = f"{flight.provenance.path} with {tracked.provenance.path}"
    if not all(q in tracked["mocap"] for q in ("qx", "qy", "qz", "qw")):
        return with_positions(flight, tracked, partial(coarse_offset, what="speeds"))
    truth = derivatives_of(Context(tracked))
    if truth is None:
        raise InputError(tracked.provenance.path, "no motion capture of a second or more")
    if "imu" not in flight or not set(GYRO) <= set(flight["imu"].quantities):
        raise InputError(flight.provenance.path, "no gyro to find the time by", "columns gyro_x, gyro_y, gyro_z")
    imu = flight["imu"]
    good = np.isfinite(imu[GYRO]).all(axis=1) & np.isfinite(imu.time_s)
    t, gyro = imu.time_s[good], imu[GYRO][good]
    if len(t) < 100 or np.any(np.diff(t) <= 0.0):
        raise InputError(flight.provenance.path, "the gyro has no two seconds of timestamps in order")
    offset_s = coarse_offset(t, gyro, truth.time_s, truth.rate_rad_s, place)
    turn, correlation = _turn(truth, t - offset_s, gyro)
    if correlation < LEAST_CORRELATION:
        raise InputError(place, f"the turning rates are alike nowhere (correlation {correlation:.2f} at best)",
                         "give recordings of one flight that turns and overlaps by half")
    mocap = tracked["mocap"]
    stamps = mocap.time_s + offset_s
    note = (f"motion capture of {tracked.provenance.path}, its timestamps later by {offset_s:.3f} s "
            f"(correlation {correlation:.2f})")
    values = mocap.values
    if turn.magnitude() > SQUARE_RAD:
        where = [mocap.index(q) for q in ("qx", "qy", "qz", "qw")]
        values = values.copy()
        values[:, where] = so3.multiply(values[:, where], turn.as_quat())
        note += f"; its body frame turned by {np.rad2deg(turn.magnitude()):.1f} deg onto the gyro's axes"
    moved = replace(mocap, time_s=stamps, values=values)
    provenance = replace(flight.provenance, notes=(*flight.provenance.notes, note))
    return replace(flight.with_streams(mocap=moved), provenance=provenance)


def coarse_offset(time_a: np.ndarray, a: np.ndarray, time_b: np.ndarray, b: np.ndarray,
                  place: str, what: str = "turning rates") -> float:
    """Offset to add to ``time_b`` (m,): then the lengths of ``b`` (m, k) match those of ``a``.

    Shapes: ``a`` (n, k) at ``time_a`` (n,) [s]. The result is accurate to a step of 10 ms. Raises InputError with
    ``place`` if no offset, or more than one, fits."""
    grids = [np.arange(t[0], t[-1], STEP_S) for t in (time_a, time_b)]
    x, y = (np.linalg.norm(CubicSpline(t, v)(g), axis=1) for g, t, v in
            zip(grids, (time_a, time_b), (a, b), strict=True))
    x, y = _band(x), _band(y)
    common = correlate(np.ones_like(x), np.ones_like(y), "full", "fft")
    energy = correlate(x**2, np.ones_like(y), "full", "fft") * correlate(np.ones_like(x), y**2, "full", "fft")
    enough = common > min(len(x), len(y)) / 2
    alike = np.where(enough, correlate(x, y, "full", "fft") / np.sqrt(np.maximum(energy, 1e-12)), -1.0)
    lags = correlation_lags(len(x), len(y), "full")
    best = int(np.argmax(alike))
    if alike[best] < NOWHERE * LEAST_CORRELATION:
        raise InputError(place, f"the {what} are alike nowhere (their magnitudes to {alike[best]:.2f} at best)",
                         "give recordings of one flight that turns and overlaps by half")
    rivals = np.where(np.abs(lags - lags[best]) * STEP_S > RIVAL_S, alike, -1.0)
    if rivals.max() > RIVAL_SHARE * alike[best]:
        raise InputError(place, f"two offsets fit alike: correlation {alike[best]:.2f} and {rivals.max():.2f}",
                         "a repeated path is ambiguous; add take-off and landing")
    return float(grids[0][0] - grids[1][0] + lags[best] * STEP_S)


def _band(values: np.ndarray) -> np.ndarray:
    """(n, k) every STEP_S, between 1 / SLOW_S and BAND_HZ."""
    smooth = sosfiltfilt(butter(2, BAND_HZ, fs=1.0 / STEP_S, output="sos"), values, axis=0)
    return np.asarray(smooth - uniform_filter1d(smooth, round(SLOW_S / STEP_S), axis=0))


def _turn(truth: MocapDerivatives, time_s: np.ndarray, gyro: np.ndarray) -> tuple[Rotation, float]:
    """The rotation that takes the gyro's axes to the tracker's body axes (Wahba's problem), and how alike the rates
    then are."""
    grid = np.arange(max(time_s[0], truth.time_s[0]), min(time_s[-1], truth.time_s[-1]), STEP_S)
    seen, true = (_band(CubicSpline(t, v)(grid)) for t, v in ((time_s, gyro), (truth.time_s, truth.rate_rad_s)))
    turn = Rotation.align_vectors(true, seen)[0]
    turned = turn.apply(seen)
    return turn, float(np.sum(turned * true) / np.sqrt(np.sum(turned**2) * np.sum(true**2)))


def between(measured: Stream, reference: Stream, quantities: tuple[str, ...]) -> TimeOffset | None:
    """Delay of the timestamps of ``measured`` against those of ``reference``. The two streams have the same
    ``quantities`` (two or more) on two clocks. A moving error is accepted only if each quantity confirms the others.

    None if the streams share less than two seconds. Offsets are sought within -250..+300 ms.
    """
    def all_of(names: tuple[str, ...]) -> list[Evidence]:
        found = [_evidence(measured, reference, (q,)) for q in names]
        return [part for part in found if part is not None]

    parts = all_of(quantities)
    if len(parts) < len(quantities):
        return None
    rows_s = np.arange(parts[0].time_s[0], parts[0].time_s[-1], ROW_S)
    delay, sd, _ = smooth_delay(all_of(quantities), rows_s, lambda steps_s: None)
    constant = float(np.median(delay))
    gains = []
    for judge in range(len(quantities) if len(quantities) > 1 else 0):
        others = tuple(q for i, q in enumerate(quantities) if i != judge)
        found = smooth_delay(all_of(others), rows_s, lambda steps_s: None)[0]
        gains.append(evidence_gain(parts[judge], float(np.median(found)),
                                   np.interp(parts[judge].time_s, rows_s, found)))
    wander = wander_of(rows_s, delay)
    reported = ", ".join(f"{q} {-100 * g:.0f} %" for q, (g, _) in zip(quantities, gains, strict=False))
    if gains and all(g > 2.0 * e for g, e in gains):
        return TimeOffset(rows_s, delay, sd, constant, wander, True, {}, f"moves by {1e3 * wander:.1f} ms (SD); the "
                         f"clock of the other quantities changes the residual of each: {reported}")
    return TimeOffset(rows_s, np.full(len(rows_s), constant), np.full(len(rows_s), float(np.median(sd))), constant, 0.0,
                     False, {}, f"no moving error confirmed ({reported or 'one quantity cannot confirm itself'}); "
                     "the constant is used")


def _evidence(measured: Stream, reference: Stream, quantities: tuple[str, ...]) -> Evidence | None:
    values, known = measured[quantities], reference[quantities]
    seen = np.isfinite(known).all(axis=1)
    t, known = reference.time_s[seen], known[seen]
    rising = np.concatenate(([True], np.diff(t) > 0.0))
    t, known = t[rising], known[rising]
    if len(t) < FEWEST_KNOWN:
        return None
    good = np.isfinite(values).all(axis=1) & (measured.time_s > t[0] + LATEST_S) & (measured.time_s < t[-1] - LATEST_S)
    stamps = measured.time_s[good]
    if good.sum() < FEWEST or np.ptp(stamps) < 2.0 or np.any(np.diff(stamps) < 0.0):
        return None
    fine = np.arange(t[0], t[-1], CELL_S)
    scale = float(np.std(known)) or 1.0
    noise = START_NOISE * scale
    kind = Kind(",".join(quantities), "", quantities, noise, LEAST_NOISE * scale, False, "inertial", 0.0, noise,
                START_WEIGHT)
    return Evidence(kind, stamps, np.ascontiguousarray(values[good]), np.ascontiguousarray(CubicSpline(t, known)(fine)),
                    float(t[0]), 0.0, np.full(len(quantities), kind.start_sigma), START_WEIGHT)
