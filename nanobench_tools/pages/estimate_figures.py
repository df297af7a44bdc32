"""Pictures of Task 3: estimates with three standard deviations, logs that had ended, what an error comes from."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..tables.result_table import Score
from .figure import Axis, Choice, Drawing, Figure, Mark, Panel
from .packed import rounded
from .row_cells import AS_RECORDED, clock_of

ELLIPSES = 12
LEAST_MM = 1.0
"""Least error that a logarithmic axis shows."""
SMALL_M = 0.5
"""Errors below this are drawn in mm."""


def pictures(estimate: Mapping[str, Any] | None) -> dict[str, Drawing | None]:
    """By name of the figure."""
    body = estimate or {}
    return {"bands": bands(body), "attribution": attribution(body)}


def bands(body: Mapping[str, Any]) -> Drawing | None:
    """Of one flight, or of one window without poses, every method that says how sure it is."""
    found = [band for band in body.get("bands") or [] if band.get("t_s")]
    sets: dict[tuple[str, ...], Figure] = {}
    for band in found:
        clock = clock_of(band)
        given = str(band.get("name")) + ("" if clock == AS_RECORDED else f", clock {clock}")
        sets[given, str(band["method"])] = band_figure(band)
    return Choice(("Given", "Estimator"), sets) if sets else None


def band_figure(band: Mapping[str, Any]) -> Figure:
    """An estimate from above with ellipses, and its error by axis within three standard deviations."""
    t, truth, error, sd = (np.array(band[key], float) for key in ("t_s", "truth_m", "error_m", "sd_m"))
    cov_xy = np.array(band["cov_xy_m2"], float)
    at = truth + error
    outline = np.vstack([np.vstack([_ellipse(at[i, :2], sd[i], cov_xy[i]), [[np.nan, np.nan]]])
                         for i in np.linspace(0, len(t) - 1, ELLIPSES + 1).round().astype(int)[1:]])
    time_s = rounded(t, 0.01)
    panels = [Panel(Axis("x", "m"), Axis("y", "m"), [
        Mark("three standard deviations", outline[:, 0], outline[:, 1], colour="sky", width=1.5),
        Mark("motion capture", rounded(truth[:, 0], 1e-3), rounded(truth[:, 1], 1e-3), colour="mocap", width=3.0,
             t=time_s),
        Mark(str(band["method"]), rounded(at[:, 0], 1e-3), rounded(at[:, 1], 1e-3), colour="orange", t=time_s)],
        "from above", 420, equal=True, wide=True)]
    most = float(np.nanmax([3.0 * sd, np.abs(error)]))
    unit, factor = ("mm", 1e3) if most < SMALL_M else ("m", 1.0)
    step = factor * most / 2000.0
    for k, axis in enumerate("xyz"):
        zero = np.zeros(len(t))
        panels.append(Panel(Axis("time", "s"), Axis(f"{axis} error", unit, zero=True), [
            Mark("three standard deviations", time_s, zero, "area", "sky", width=0.5,
                 low=rounded(-3.0 * factor * sd[:, k], step), high=rounded(3.0 * factor * sd[:, k], step)),
            Mark("error", time_s, rounded(factor * error[:, k], step), colour="red", width=1.4)],
            "", 165, wide=True, timed=True))
    inside = 100.0 * float(np.mean((np.abs(error) <= 3.0 * sd).all(axis=1)))
    return Figure("Error and three standard deviations",
                  f"The path from above, with the ellipse of three standard deviations at {ELLIPSES} moments, and the "
                  "error by axis. Bands are ± 3 standard deviations, as the estimator reports them. All three axes are "
                  f"inside for {inside:.0f} % of this flight. It is the flight with the median error of its protocol; "
                  "nanobench estimate --data FILE draws any other.", panels,
                  cursor=(float(t[0]), float(t[-1])))


def _ellipse(centre: np.ndarray, sd: np.ndarray, cov_xy: float) -> np.ndarray:
    """Points (33, 2) of the ellipse of three standard deviations."""
    values, vectors = np.linalg.eigh([[sd[0] ** 2, cov_xy], [cov_xy, sd[1] ** 2]])
    angle = np.linspace(0.0, 2.0 * np.pi, 33)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.asarray(centre + 3.0 * (circle * np.sqrt(np.maximum(values, 0.0))) @ vectors.T)


def dead_logs(body: Mapping[str, Any]) -> Figure | None:
    """Distance of the logged estimate [mm] over time, while its log lived and after it had ended."""
    found = body.get("dead_logs") or []
    panels = []
    for one in found:
        t, mm = np.array(one["t_s"], float), np.maximum(1e3 * np.array(one["error_m"], float), LEAST_MM)
        dead = np.zeros(len(t), bool)
        for start, end in one["dead"]:
            dead |= (t >= start) & (t <= end)
        said = f"{one['flight']}: {1e3 * one['all_rmse_m']:.0f} mm RMS"
        if one["live_rmse_m"] is not None:
            said += f", {1e3 * one['live_rmse_m']:.0f} while the log lived"
        panels.append(Panel(Axis("time", "s"), Axis("error", "mm", log=True), [
            Mark(name, rounded(t, 0.01), rounded(np.where(keep, mm, np.nan), 0.1), colour=colour)
            for name, keep, colour in (("while the log lived", ~dead, "blue"),
                                       ("rows after its last packet", dead, "red"))], said, 220))
    return Figure("The \u201cdivergence\u201d of the published table is a log that had ended",
                  "Distance between logged estimate and motion capture over the rows that the published table scores, "
                  "as recorded. Red: interpolated rows after the estimator's last packet. The flights that "
                  "they make worst.", panels) if panels else None


def attribution(body: Mapping[str, Any]) -> Figure | None:
    """ATE of the logged estimate by clock, and by how much one change moves the ATE of the replayed filter."""
    found = body.get("attribution")
    if not found:
        return None
    rows: tuple[list[tuple[str, Score]], ...] = ([], [])
    for part, name, metric in [
            *((0, f"logged, clock {row['what']}", row["metrics"].get("ate_m")) for row in found["logged"]),
            *((0, str(row["what"]), row["metrics"].get("ate_m")) for row in found["replayed"][:1]),
            *((1, str(row["what"]), row["metrics"].get("change_m")) for row in found["replayed"][1:])]:
        score = Score.of(metric)
        if score.mean is not None:
            rows[part].append((name, score))
    panels = []
    for title, mine in zip(("ATE", "change of the replayed filter's ATE"), rows, strict=True):
        if mine:
            at = [float(i) for i in range(len(mine))]
            value, low, high = ([1e3 * v for v in values] for values in zip(*(
                (s.mean or 0.0, *(s.mean if v is None else v for v in (s.low, s.high))) for _, s in mine), strict=True))
            panels.append(Panel(Axis(title, "mm", zero=True), Axis(rows=[name for name, _ in mine]), [
                Mark(title, value, at, "points", low=low, high=high, across=True,
                     text=[f"{name}: {v:.2f} mm" for (name, _), v in zip(mine, value, strict=True)])],
                "", 70 + 30 * len(mine), wide=True))
    return Figure("What the onboard filter's error comes from",
                  f"Mean over flights (n = {found['n']}, replayed {found['n_replayed']}) with 95 % interval. Above: "
                  "ATE of the logged estimate by clock, which uses gyro and accelerometer alone. Also ATE of the "
                  "same filter run again on the re-timed IMU with a pose every 10 ms. Below: that replay with one "
                  "thing changed; an interval that contains 0 shows no effect.", panels)
