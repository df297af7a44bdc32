"""Whether a stream's clock drifts or wanders, and the evidence.

Two independent ways. Windows (``mathematics.lag_windows``): lags of half seconds of gyro and attitude, with a placebo
for their noise. Track (``mathematics.track_error``): the estimated position ahead or behind along its path, with the
error across as placebo. It is ten times finer, but needs an estimated position. A wander seen on the track is also the
gyro's if the gyro's windows move with it (correlation beyond chance). It is then the link's clock and not the
estimator.
"""

from dataclasses import dataclass

import numpy as np
from scipy.stats import pearsonr

from ...settings import number, setting
from ...signals import paired_signals, pairs
from ...signals.context import Context
from ...signals.mocap_derivatives import derivatives_of
from ...signals.pose_jumps import mocap_jumps
from ..mathematics.lag_windows import Movement
from ..mathematics.track_error import TrackError, track_error
from .measured_lags import Measured, measured_lags

OWN_LAG_S = setting("audit.drift_and_wander.own_lag_s")
JUDGED = ("imu", "attitude", "attitude_qw", "estimator")
CONFIRMED = number("audit.drift_and_wander.confirmed")


@dataclass(frozen=True)
class Moving:
    """``slope`` (s/s) and ``wander_sd_s`` of one stream's time error; whether they are significant.

    Also the detection limits (change over the flight, standard deviation; s) and evidence in words. ``like_track``: it
    moves with the track."""

    slope: float
    span_s: float
    wander_sd_s: float
    drifts: bool
    wanders: bool
    detectable_drift_s: float
    detectable_wander_s: float
    drift_evidence: str
    wander_evidence: str
    like_track: bool = False


def track_of(context: Context) -> TrackError | None:
    """Error of the estimated position along its path; None without one that fits."""
    own = context.once(measured_lags).get("estimator")
    pair = context.once(pairs.position_pair)
    if own is None or pair is None or not own.by.startswith("x"):
        return None
    if any(not jump.rotation for jump in context.once(mocap_jumps)):
        return None  # the path is not where it was before
    placed = paired_signals.on_grid(context, "estimator", ("x", "y", "z"))
    truth = context.once(derivatives_of)
    if placed is None or truth is None:
        return None
    return track_error(own.upright(placed[0]), truth.position_m, truth.velocity_m_s, pair.use, truth.time_s,
                       own.lag.offset_s)


def moving_clocks(context: Context) -> dict[str, Moving]:
    """A verdict for every stream of JUDGED that can be."""
    measured = context.once(measured_lags)
    track = context.once(track_of)
    found = {}
    for name in JUDGED:
        if name == "estimator":
            if track is not None:
                found[name] = _by_track(track)
            continue
        own = measured.get(name)
        if own is not None and own.movement is not None:
            shared = track if name == "imu" and _shares_clock(measured) else None
            found[name] = _by_windows(own.by, own.movement, shared)
    return found


def _shares_clock(measured: dict[str, Measured]) -> bool:
    behind = measured["estimator"].lag.offset_s - measured["imu"].lag.offset_s if "estimator" in measured else np.inf
    doubt = measured["imu"].lag.half_width_s
    return bool(OWN_LAG_S[0] - doubt <= behind <= OWN_LAG_S[1] + doubt)


def _by_track(track: TrackError) -> Moving:
    return Moving(
        track.slope,
        track.span_s,
        track.wander_sd_s,
        track.drifts,
        track.wanders,
        track.detectable_drift_s,
        track.detectable_wander_s,
        f"the estimated position falls behind by {1e3 * track.slope * track.span_s:.1f} ms in "
        f"{track.span_s:.0f} s (chance {track.p_drift:.0e})",
        f"along its path the estimated position is early and late by {1e3 * track.wander_sd_s:.1f} ms RMS more "
        f"than its error "
        f"across explains ({1e3 * track.noise_sd_s:.1f} ms; chance {track.p_wander:.0e})",
    )


def _by_windows(by: str, m: Movement, track: TrackError | None) -> Moving:
    wanders, sd, least, like_track = m.wanders, m.wander_sd_s, m.detectable_wander_s, False
    evidence = (
        f"lags of {by} in half seconds scatter by {1e3 * m.wander_sd_s:.1f} ms more than noise explains "
        f"({1e3 * m.noise_sd_s:.1f} ms; chance {m.p_wander:.0e})"
    )
    if track is not None and track.wanders:
        means = _window_means(track, m.time_s)
        both = np.isfinite(means)
        if both.sum() >= 10:
            r, p = pearsonr(means[both], m.lag_s[both], alternative="greater")
            if p < CONFIRMED:
                wanders, sd, like_track = True, track.wander_sd_s, True
                least = min(least, track.detectable_wander_s)
                evidence = (
                    f"half-second lags of {by} move with the time error of the estimated position "
                    f"(correlation {r:.2f}, "
                    f"chance {p:.0e}), which wanders by {1e3 * sd:.1f} ms RMS"
                )
    return Moving(
        m.slope,
        m.span_s,
        sd,
        m.drifts,
        wanders,
        m.detectable_drift_s,
        least,
        f"lags of {by} change by {1e3 * m.slope * m.span_s:.1f} ms in {m.span_s:.0f} s (chance {m.p_drift:.0e})",
        evidence,
        like_track,
    )


def _window_means(track: TrackError, at_s: np.ndarray) -> np.ndarray:
    """Mean of the track's error in the half seconds around ``at_s``; nan where the vehicle was too slow."""
    total = np.concatenate(([0.0], np.cumsum(track.late_s)))
    first = np.searchsorted(track.time_s, at_s - 0.25)
    last = np.searchsorted(track.time_s, at_s + 0.25)
    count = last - first
    return np.where(count > 10, (total[last] - total[first]) / np.maximum(count, 1), np.nan)
