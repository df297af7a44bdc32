"""Vibration and clipping of the inertial sensor in one flight.

Spectra are means over windows of one second in the air (Welch 1967, Hann window), summed over the axes. Motions of the
vehicle lie below ``LOW_HZ``. A rotor that turns faster than half the sampling rate shows at a lower frequency, which
is stated.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from ..flight import Flight, Span, Stream, mask_of, motors_of
from ..results.result import Result
from ..sources.cells import GIGANTIC
from .faults import saturated_sensor
from .recording_audit import Audit

WINDOW_S = 1.0
LOW_HZ = 20.0
"""Quadrotors turn and accelerate below it."""
FEWEST_ROWS = 64
"""Of a window: a spectrum with fewer has no lines."""
EVEN = 0.5
"""Of a step: rows further apart or closer end a window."""
STANDS_OUT = 10.0
"""Power of a line over the median of the band."""
NEAR_BINS = 2
"""Bins on either side that belong to a line of a Hann window."""
ORDERS = (1, 2)
"""Imbalance turns with the rotor, the blades of a two-bladed propeller pass twice."""
LOAD_BINS, POINTS = 5, 100
MOST_WINDOWS = 600
"""Evenly chosen ones of a longer recording."""
SHOCK = 5.0
"""Times the median RMS: a window that vibrates more has a touch-down or a collision, and is left out."""
INTERPOLATED = 0.9
"""Samples per row below which rows were drawn between samples."""


@dataclass(frozen=True, repr=False)
class RotorLine(Result):
    """Vibration at a multiple of the rotor speed: ``rotor_hz`` the median, ``seen_at_hz`` where sampling shows it."""

    order: int
    rotor_hz: float
    seen_at_hz: float
    rms: float
    share: float


@dataclass(frozen=True, repr=False)
class Vibration(Result):
    """One sensor from ``LOW_HZ`` to ``up_to_hz``.

    - rms, highest: of the sum of axes, and the largest reading of one axis, in ``unit``.
    - peak_hz, peak_rms: the strongest line, None without a clear one.
    - spectrum: [frequency Hz, amplitude density unit/sqrt(Hz)].
    - against: what ``load`` is, and [load, rms] of equal numbers of windows.
    - interpolated: rows were drawn between samples, so that amplitudes are too small.
    """

    unit: str
    windows: int
    up_to_hz: float
    rms: float
    highest: float
    clipped_rows: int
    peak_hz: float | None
    peak_rms: float | None
    rotors: tuple[RotorLine, ...]
    load: str
    against: tuple[tuple[float, float], ...]
    spectrum: tuple[tuple[float, float], ...]
    interpolated: bool


def vibration_of(flight: Flight, audit: Audit, columns: Sequence[str], spans: Sequence[Span]) -> Vibration | str:
    """Of the rows of one sensor in ``spans``; a sentence where there are too few."""
    stream = flight["imu"]
    values = stream[list(columns)]
    inside = mask_of(spans, stream.time_s) & (np.abs(values) < GIGANTIC).all(axis=1)
    step = float(np.median(np.diff(stream.time_s))) if len(stream) > 1 else 0.0
    rate_hz = 1.0 / step if step > 0.0 else 0.0
    rows = max(round(WINDOW_S * rate_hz), 1)
    if rows < FEWEST_ROWS:
        return f"{rate_hz:.3g} Hz are too few"
    windows = _windows(stream.time_s, inside, step, rows)
    if not len(windows):
        return "no whole second in the air without a gap"
    reading = audit.rates.get("imu")
    true_hz = reading.rate_hz if reading is not None and np.isfinite(reading.rate_hz) else rate_hz
    interpolated = true_hz < INTERPOLATED * rate_hz
    up_to = 0.5 * min(true_hz, rate_hz) if interpolated else 0.5 * rate_hz
    if up_to < 1.5 * LOW_HZ:
        return f"{2.0 * up_to:.3g} Hz are too few"
    starts = windows[:, None] + np.arange(rows)
    rate_hz = (rows - 1) / float(np.mean(stream.time_s[starts[:, -1]] - stream.time_s[starts[:, 0]]))
    frequency, power = welch(values[starts], rate_hz, "hann", nperseg=rows, detrend="constant", axis=1)
    power = power.sum(axis=2)
    band = (frequency >= LOW_HZ) & (frequency <= up_to)
    width = float(frequency[1])
    each = np.sqrt(power[:, band].sum(axis=1) * width)
    steady = each <= SHOCK * float(np.median(each))
    starts, power, each = starts[steady], power[steady], each[steady]
    mean = power.mean(axis=0)
    line = _line(frequency, mean, band, width)
    load, loads = _load(flight, stream.time_s[starts])
    unit = stream.unit[stream.index(columns[0])]
    clipped = sum(round(f.size) for f in audit.faults if f.kind == saturated_sensor.KIND
                  and set(f.columns) & {stream.columns[stream.index(c)] for c in columns})
    rotors = _rotors(flight, stream.time_s[starts], frequency, power, band, rate_hz)
    return Vibration(unit, len(starts), up_to, float(np.sqrt(mean[band].sum() * width)),
                     float(np.abs(values[inside]).max()), clipped, *line, rotors, load, _against(loads, each),
                     _thinned(frequency[band], np.sqrt(mean[band])), interpolated)


def _windows(time_s: np.ndarray, inside: np.ndarray, step: float, rows: int) -> np.ndarray:
    """First rows of windows that overlap by half, in runs of even rows that are inside."""
    joined = inside[1:] & inside[:-1] & (np.abs(np.diff(time_s) - step) < EVEN * step)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], joined.view(np.int8), [0]])))
    found = [np.arange(a, b + 2 - rows, max(rows // 2, 1)) for a, b in edges.reshape(-1, 2) if b + 1 - a >= rows]
    starts = np.concatenate(found) if found else np.zeros(0, dtype=int)
    return np.asarray(starts[np.linspace(0, len(starts) - 1, min(len(starts), MOST_WINDOWS)).astype(int)])


def _line(frequency: np.ndarray, power: np.ndarray, band: np.ndarray,
          width: float) -> tuple[float | None, float | None]:
    at = int(np.argmax(np.where(band, power, -1.0)))
    if not power[at] > 0.0 or power[at] < STANDS_OUT * float(np.median(power[band])):
        return None, None
    near = slice(max(at - NEAR_BINS, 0), at + NEAR_BINS + 1)
    return (float((frequency[near] * power[near]).sum() / power[near].sum()),
            float(np.sqrt(power[near].sum() * width)))


def _at(stream: Stream, names: Sequence[str], time_s: np.ndarray) -> np.ndarray:
    """(windows, k): means over each window."""
    values = stream[list(names)]
    good = np.isfinite(values).all(axis=1)
    rising = np.flatnonzero(good)[np.argsort(stream.time_s[good], kind="stable")]
    held = [np.interp(time_s, stream.time_s[rising], values[rising, k]).mean(axis=1) for k in range(len(names))]
    return np.stack(held, axis=1) if len(rising) else np.full((len(time_s), len(names)), np.nan)


def _load(flight: Flight, time_s: np.ndarray) -> tuple[str, np.ndarray]:
    """What loads the vehicle, and its mean in each window."""
    for name, what in (("rpm", "rotor speed, Hz"), ("motor", "motor command, share")):
        if name in flight and (motors := motors_of(flight[name])):
            return what, _at(flight[name], motors, time_s).mean(axis=1) / (2.0 * np.pi if name == "rpm" else 1.0)
    return "", np.zeros(0)


def _against(loads: np.ndarray, rms: np.ndarray) -> tuple[tuple[float, float], ...]:
    if len(loads) != len(rms) or not np.isfinite(loads).all() or len(rms) < LOAD_BINS:
        return ()
    return tuple((float(loads[part].mean()), float(np.sqrt((rms[part]**2).mean())))
                 for part in np.array_split(np.argsort(loads, kind="stable"), LOAD_BINS))


def _rotors(flight: Flight, time_s: np.ndarray, frequency: np.ndarray, power: np.ndarray, band: np.ndarray,
            rate_hz: float) -> tuple[RotorLine, ...]:
    """Power around the multiples of the speeds of the rotors, above the median of the band."""
    if "rpm" not in flight or not (motors := motors_of(flight["rpm"])):
        return ()
    speed_hz = _at(flight["rpm"], motors, time_s) / (2.0 * np.pi)
    if not np.isfinite(speed_hz).all():
        return ()
    width = float(frequency[1])
    whole = float(power[:, band].sum()) * width
    found = []
    for order in ORDERS:
        seen = np.abs((order * speed_hz + 0.5 * rate_hz) % rate_hz - 0.5 * rate_hz)
        near = (np.abs(frequency - seen[:, :, None]) < (NEAR_BINS + 0.5) * width).any(axis=1) & band
        usable = near.any(axis=1)
        if not usable.any():
            continue
        excess = np.maximum(np.where(near, power, 0.0).sum(axis=1)
                            - near.sum(axis=1) * np.median(power[:, band], axis=1), 0.0)[usable] * width
        found.append(RotorLine(order, float(np.median(speed_hz)), float(np.median(seen)),
                               float(np.sqrt(excess.mean())), float(min(excess.sum() / whole, 1.0)) if whole else 0.0))
    return tuple(found)


def _thinned(frequency: np.ndarray, density: np.ndarray) -> tuple[tuple[float, float], ...]:
    """At most POINTS, each the largest of its stretch."""
    parts = np.array_split(np.arange(len(frequency)), min(POINTS, len(frequency)))
    best = [part[np.argmax(density[part])] for part in parts]
    return tuple((float(f"{frequency[k]:.5g}"), float(f"{density[k]:.4g}")) for k in best)
