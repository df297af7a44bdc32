"""Scores of one estimate on one flight: the published formulas as they were, and the full clean set."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np
from scipy.stats import chi2

from .. import so3
from ..flight import Span
from ..methods import Estimate
from ..metrics import alignment, attitude, consistency, timing, trajectory

NAN = float("nan")
PROBABILITY = 0.95
TENTHS = 10
PROGRESS = "error_until_{}_percent_m"
"""Mean position error in the tenth of the scored time that ends at this share of it."""


def published_metrics(estimate_m: np.ndarray, truth_m: np.ndarray, estimate_m_s: np.ndarray | None,
                      truth_m_s: np.ndarray) -> dict[str, float]:
    """The published position and velocity metrics of one file, all (n, 3) m and m/s: SE(3) ATE, RTE over 1 m, velocity.

    nan where one is not defined: a path shorter than 1 m, no velocity given.
    """
    absolute = trajectory.ate(estimate_m, truth_m, unique=False)
    return {"ate_rmse_m": absolute.rmse_m, "ate_mean_m": absolute.mean_m,
            "rte_1m_m": trajectory.rte_published(estimate_m, truth_m),
            "velocity_rmse_m_s": NAN if estimate_m_s is None else trajectory.velocity_rmse(estimate_m_s, truth_m_s)}


def attitude_metrics(estimate_q: np.ndarray, truth_q: np.ndarray) -> dict[str, float]:
    """Attitude errors of (n, 4) quaternions [deg]: Euler over three axes and per axis, and geodesic. Also geodesic
    without the one constant rotation between the two body frames."""
    errors = np.degrees(attitude.euler_errors(so3.euler_zyx(estimate_q), so3.euler_zyx(truth_q)))
    per_axis = {f"{axis}_rmse_deg": trajectory.rms(errors[:, i]) for i, axis in enumerate(("roll", "pitch", "yaw"))}
    turned = attitude.without_constant_rotation(estimate_q, truth_q)
    return {"attitude_rmse_deg": trajectory.rms(errors), **per_axis,
            "attitude_geodesic_rmse_deg": float(np.degrees(attitude.geodesic_rmse(estimate_q, truth_q))),
            "attitude_frame_removed_rmse_deg": float(np.degrees(attitude.geodesic_rmse(turned, truth_q)))}


def further_metrics(time_s: np.ndarray, estimate_m: np.ndarray, estimate_q: np.ndarray, truth_m: np.ndarray,
                    truth_q: np.ndarray, truth_m_s: np.ndarray, spans: Sequence[Span]) -> dict[str, float]:
    """What the published table leaves out: other alignments, RTE in the start's frame, drift, and time errors.

    ``delay_s`` is the one delay that fits best (positive: estimate late); ``*_delay_removed`` and ``across_track`` are
    what it leaves. ``spans``: stretches without a break; relative errors and drift keep to one, the others take all
    rows.
    """
    raw = trajectory.ate(estimate_m, truth_m, "none").rmse_m
    turned = trajectory.ate(estimate_m, truth_m, "yaw", unique=False).rmse_m
    off = estimate_m - truth_m
    found = {"ate_unaligned_rmse_m": raw, "ate_yaw_rmse_m": turned, "alignment_deg": NAN,
             "horizontal_rmse_m": trajectory.rms(np.hypot(off[:, 0], off[:, 1])),
             "vertical_rmse_m": trajectory.rms(off[:, 2])}
    with suppress(alignment.AlignmentError):
        found["alignment_deg"] = float(np.degrees(alignment.align(estimate_m, truth_m).angle_rad))
    longest = max(spans, key=lambda s: s.duration_s).mask(time_s)
    e, q, p, pq = estimate_m[longest], estimate_q[longest], truth_m[longest], truth_q[longest]
    found["rte_1m_start_frame_m"] = trajectory.rte(e, q, p, pq)
    found["drift_percent"] = trajectory.drift_percent(e, p)
    found["drift_horizontal_percent"], found["drift_vertical_percent"] = trajectory.drift_apart_percent(e, p)
    split = timing.along_across(estimate_m, truth_m, truth_m_s)
    found |= {"along_track_rmse_m": split.along_rmse_m, "across_track_rmse_m": split.across_rmse_m}
    names = ("delay_s", "ate_delay_removed_rmse_m", "along_track_delay_removed_rmse_m",
             "across_track_delay_removed_rmse_m")
    try:
        delay = timing.constant_delay(time_s[longest], e, time_s[longest], p)
    except ValueError:
        return found | dict.fromkeys(names, NAN)
    split = timing.along_across(e[delay.rows], delay.truth_m, delay.velocity_m_s)
    values = (delay.delay_s, delay.rmse_after_m, split.along_rmse_m, split.across_rmse_m)
    return found | dict(zip(names, values, strict=True))


def velocity_residuals(estimate_m_s: np.ndarray | None, truth_m_s: np.ndarray) -> dict[str, float]:
    """Error of the velocity along each axis of the world, (n, 3) m/s: its RMS and its mean, estimate less truth."""
    error = np.full_like(truth_m_s, NAN) if estimate_m_s is None else estimate_m_s - truth_m_s
    return {**{f"velocity_{a}_rmse_m_s": trajectory.rms(error[:, i]) for i, a in enumerate("xyz")},
            **{f"velocity_{a}_mean_m_s": float(error[:, i].mean()) for i, a in enumerate("xyz")}}


def progress_metrics(time_s: np.ndarray, estimate_m: np.ndarray, truth_m: np.ndarray) -> dict[str, float]:
    """Mean position error, not aligned [m], in each tenth of the scored time; nan for one without a row."""
    share = (time_s - time_s[0]) / max(time_s[-1] - time_s[0], 1e-9)
    part = np.minimum((share * TENTHS).astype(int), TENTHS - 1)
    error = np.linalg.norm(estimate_m - truth_m, axis=1)
    return {PROGRESS.format(100 * (k + 1) // TENTHS): float(error[part == k].mean()) if (part == k).any() else NAN
            for k in range(TENTHS)}


def consistency_metrics(estimate: Estimate, rows: np.ndarray, truth_m: np.ndarray) -> dict[str, float]:
    """Whether the estimate is as sure as it is right: of positions at ``rows`` (k,) against truth_m (k, 3).

    ``nees``: mean normalised squared error, 3 if consistent. Errors of one run hang together in time, so that k rows
    count as ``nees_samples``, from the autocorrelation of the whitened error; ``nees_in_band`` is 1 if the mean lies
    in the 95 % band of chi-square for so many, else 0 (over flights: the share). The band contains 95 % of the runs of
    a consistent estimator. ``nis``: mean over the measurements' dimensions, 1 if consistent. Its band assumes white
    innovations, which they are if the filter is right.
    Empty if the estimate does not say how sure it is; nan where a covariance is not positive definite.
    """
    found: dict[str, float] = {}
    if estimate.covariance is not None:
        error, covariance = estimate.position_m[rows] - truth_m, np.asarray(estimate.covariance, float)[rows, :3, :3]
        try:
            white = np.linalg.solve(np.linalg.cholesky(covariance), error[..., None])[..., 0]
        except np.linalg.LinAlgError:
            return dict.fromkeys(("nees", "nees_samples", "nees_in_band"), NAN)
        mean, samples = float(np.mean(np.sum(white * white, axis=1))), consistency.independent_samples(white)
        found |= {"nees": mean, "nees_samples": samples, "nees_in_band": in_band(mean, 3.0, samples)}
    if estimate.nis is not None and estimate.nis_dof is not None and len(estimate.nis):
        dof = float(np.sum(estimate.nis_dof))
        mean = float(np.sum(estimate.nis)) / dof
        found |= {"nis": mean, "nis_in_band": in_band(mean, 1.0, dof)}
    return found


def in_band(mean: float, dimension: float, samples: float) -> float:
    """1 if the mean of ``samples`` values of ``dimension`` each lies in its band, else 0."""
    low, high = chi2.ppf([0.5 * (1.0 - PROBABILITY), 0.5 * (1.0 + PROBABILITY)], samples * dimension) / samples
    return float(low <= mean <= high)
