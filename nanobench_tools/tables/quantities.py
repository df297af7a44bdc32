"""How a number is shown: its title, its unit in print, and how many digits it deserves."""

import math
from dataclasses import dataclass

DASH = "\u2013"
MINUS = "\u2212"


@dataclass(frozen=True)
class Shown:
    """A metric in print: SI value times ``factor`` is in ``unit``, shown with ``decimals``."""

    title: str
    unit: str
    factor: float = 1.0
    decimals: int = 3


QUANTITIES: dict[str, Shown] = {
    "ate_rmse_m": Shown("ATE RMSE", "mm", 1e3, 1),
    "ate_mean_m": Shown("ATE mean", "mm", 1e3, 1),
    "rte_1m_m": Shown("RTE 1 m", "mm", 1e3, 1),
    "velocity_rmse_m_s": Shown("Velocity RMSE", "m/s", 1.0, 3),
    **{f"velocity_{a}_rmse_m_s": Shown(f"Velocity {a}, RMSE", "m/s", 1.0, 3) for a in "xyz"},
    **{f"velocity_{a}_mean_m_s": Shown(f"Velocity {a}, mean error", "m/s", 1.0, 3) for a in "xyz"},
    **{f"error_until_{k}_percent_m": Shown(f"Error until {k} %", "mm", 1e3, 1) for k in range(10, 101, 10)},
    "attitude_rmse_deg": Shown("Attitude RMSE", "deg", 1.0, 2),
    "attitude_geodesic_rmse_deg": Shown("Attitude RMSE, geodesic", "deg", 1.0, 2),
    "attitude_frame_removed_rmse_deg": Shown("Attitude, frame removed", "deg", 1.0, 2),
    "ate_unaligned_rmse_m": Shown("RMSE, not aligned", "mm", 1e3, 1),
    "ate_yaw_rmse_m": Shown("RMSE, yaw aligned", "mm", 1e3, 1),
    "ate_delay_removed_rmse_m": Shown("RMSE, delay removed", "mm", 1e3, 1),
    "rte_1m_start_frame_m": Shown("RTE 1 m, start frame", "mm", 1e3, 1),
    "along_track_rmse_m": Shown("Along track", "mm", 1e3, 1),
    "across_track_rmse_m": Shown("Across track", "mm", 1e3, 1),
    "along_track_delay_removed_rmse_m": Shown("Along track, delay removed", "mm", 1e3, 1),
    "across_track_delay_removed_rmse_m": Shown("Across track, delay removed", "mm", 1e3, 2),
    "delay_s": Shown("Delay", "ms", 1e3, 1),
    "end_error_1s_m": Shown("End error 1 s", "m", 1.0, 3),
    "end_error_5s_m": Shown("End error 5 s", "m", 1.0, 3),
    "end_error_10s_m": Shown("End error 10 s", "m", 1.0, 2),
    "end_error_20s_m": Shown("End error 20 s", "m", 1.0, 2),
    "drift_percent": Shown("Drift", "%", 1.0, 2),
    "covered_percent": Shown("Covered", "%", 1.0, 1),
    "nees": Shown("NEES", "", 1.0, 2),
    "nis": Shown("NIS", "", 1.0, 2),
    "rmse_m": Shown("RMSE position", "m", 1.0, 4),
    "ade_m": Shown("ADE", "m", 1.0, 4),
    "heading_deg": Shown("Heading error", "deg", 1.0, 3),
    "divergence_percent": Shown("Divergence", "%", 1.0, 3),
    "rmse_lag_removed_m": Shown("RMSE, lag removed", "m", 1.0, 3),
    "lag_s": Shown("Lag", "s", 1.0, 3),
    "contour_rmse_m": Shown("Contour RMSE", "m", 1.0, 3),
    "z_bias_m": Shown("Mean z error", "m", 1.0, 3),
    "worst_decile_m": Shown("Worst decile", "m", 1.0, 3),
    "solve_p99_ms": Shown("Solve time p99", "ms", 1.0, 2),
    "saturated_percent": Shown("Saturated", "%", 1.0, 1),
    "position_mae_m": Shown("Position MAE", "m", 1.0, 4),
    "velocity_mae_m_s": Shown("Velocity MAE", "m/s", 1.0, 4),
    "attitude_mae_rad": Shown("Attitude MAE", "rad", 1.0, 4),
    "rate_mae_rad_s": Shown("Rate MAE", "rad/s", 1.0, 4),
    "rmse_real_m": Shown("RMSE recorded", "m", 1.0, 3),
    "rmse_sim_m": Shown("RMSE simulated", "m", 1.0, 3),
    "ratio": Shown("Simulated / recorded", "", 1.0, 3),
    "lag_diff_s": Shown("Lag difference", "ms", 1e3, 1),
    "path_gap_m": Shown("Path gap", "m", 1.0, 3),
    "rms_N": Shown("RMS per motor", "mN", 1e3, 2),
    "rms_m_s2": Shown("RMS specific force", "m/s²", 1.0, 3),
}
"""The metrics of the result files; units are those of the published tables where there is one."""

_SUFFIXES = (("_m_s2", "m/s²"), ("_rad_s", "rad/s"), ("_m_s", "m/s"), ("_percent", "%"), ("_deg", "deg"),
             ("_rad", "rad"), ("_ms", "ms"), ("_hz", "Hz"), ("_N", "N"), ("_V", "V"), ("_s", "s"), ("_m", "m"))


def shown(name: str) -> Shown:
    """How metric ``name`` is printed; a name not in the list says its unit by its suffix."""
    if name in QUANTITIES:
        return QUANTITIES[name]
    for suffix, unit in _SUFFIXES:
        if name.endswith(suffix):
            return Shown(name[: -len(suffix)].replace("_", " "), unit)
    return Shown(name.replace("_", " "), "")


def number(value: float | None) -> float | None:
    """A finite float, or None for anything that is not one (None, nan, inf, text)."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return None
    return float(value) if math.isfinite(value) else None


def format_number(value: float | None, decimals: int, exact: bool = False, like: float | None = None) -> str:
    """``value`` with ``decimals``; unless ``exact``, more of them where fewer than two significant digits would stay.

    ``like``: the number whose size decides how many (the mean, for its deviation and its interval), default ``value``.
    A value that is not a finite number is a dash.

    >>> format_number(0.00012, 3), format_number(3142.7175, 1), format_number(float("nan"), 1)
    ('0.00012', '3142.7', '–')
    """
    value = number(value)
    if value is None:
        return DASH
    size = abs(value if like is None else like)
    if not exact and size and (abs(value) >= 1e6 or size < 1e-6):
        text = f"{value:.1e}"
    else:
        needed = 0 if exact or not size else 1 - math.floor(math.log10(size))
        text = f"{value:.{max(decimals, needed)}f}"
    return text.replace("-", MINUS) if value < 0 else text


def format_duration(seconds: float | None) -> str:
    """Seconds as a person says them: 42.3 s, 3 min 20 s, 1 h 05 min."""
    seconds = number(seconds)
    if seconds is None:
        return DASH
    if seconds < 120:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
