"""Wrong units of a path, from the path and the attitude alone. Evidence: an axis that is too thin, an acceleration
that no vehicle has, a tilt that does not fit the acceleration.

A multirotor accelerates by its tilt times gravity (ratio 0.77 to 1.39 by axis on real flights). One axis of its
position in another unit thus contradicts its attitude. Smooth numbers without attitude show less: an axis within
millimetres of the origin, where others span metres, is in another unit.
"""

import numpy as np

from .. import so3
from ..settings import number
from ..units import GRAVITY_M_S2
from .axis_unit_matching import FACTOR_WITHIN
from .column_evidence import LARGEST_FLIGHT_M, MOST_M_S2, no_vehicle_flies, noise_by_axis, pull_of, spans
from .context import Context
from .flown_axes import tracker_scale
from .held_poses import POSITION, ROTATION
from .known_factors import named_factor
from .paired_signals import FEWEST_ROWS
from .plausible_ranges import WrongUnit
from .pose_frame import posed
from .tilt_heading import FOLLOWS, tilt_and_acceleration
from .usable_rows import typical_step_s, usable_streams

PATHS = {"mocap": POSITION, "estimator": ("x", "y", "z")}
FINEST_M = number("audit.path_sizes.finest_m")
THINNEST_M = number("audit.path_sizes.thinnest_m")
THINNER = number("audit.path_sizes.thinner")
LEAST_NOISE_M = 1e-5
"""Noise of a position below which it is no tracker's in metres: a tenth of a good one's."""
HARDLY = 1.0 / 3.0
"""Tilt along an axis below this share of that along the other is none of a path of the same size: a convention."""
MOVES_M = number("audit.path_sizes.moves_m")
LEAST_M_S2 = number("audit.path_sizes.least_m_s2")
TILT_APART = number("audit.path_sizes.tilt_apart")
"""Where tilt and acceleration along one axis correlate, a unit mistake makes them differ by this factor, at least."""
SHORTEST_STEP_S = number("audit.path_sizes.shortest_step_s")
LEAST_TURN = number("audit.path_sizes.least_turn")


def wrong_paths(context: Context) -> list[WrongUnit]:
    """Each finding once; tilt decides where it can."""
    found = [w for w in (tilted_path(context), _turned(context)) if w is not None]
    reported = {q for w in found for q in w.quantities}
    for name, quantities in PATHS.items():
        stream = context.once(usable_streams).get(name)
        if stream is None or not all(q in stream.quantities for q in quantities):
            continue
        position = stream[quantities]
        keep = np.isfinite(position).all(axis=1)
        if keep.sum() < FEWEST_ROWS / 10:
            continue
        alone = "mocap" not in context.once(usable_streams)  # with a tracker, the comparison finds the exact factor
        if alone and (wide := _wide(name, quantities, stream.time_s[keep], position[keep])) is not None:
            found.append(wide)
            continue
        thin = _thin(context, name, quantities, position[keep])
        if thin is not None and not reported & set(thin.quantities):
            found.append(thin)
        if (pace := _pace(name, stream.time_s[keep], position[keep])) is not None and "t" not in reported:
            found.append(pace)
            reported.add("t")
    return found


def tilted_path(context: Context) -> WrongUnit | None:
    """Axes of the tracked position whose acceleration is not what the tilt gives."""
    both = context.once(tilt_and_acceleration)
    if both is None:
        return None
    size = np.sqrt(np.mean(both[:2] ** 2, axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        follows, ratio = np.mean(both[0] * both[1], axis=0) / (size[0] * size[1]), size[0] / size[1]
    wrong = [k for k in range(2) if follows[k] > FOLLOWS and abs(np.log(ratio[k])) > np.log(TILT_APART)]
    if not wrong:
        return None
    factor = float(np.exp(np.mean(np.log(ratio[wrong]))))
    named = named_factor("m", factor, FACTOR_WITHIN / float(follows[wrong].max()))
    names = tuple(POSITION[k] for k in wrong)
    both_axes = f" (or times are {factor ** -0.5:.3g} times the true ones)" if len(wrong) > 1 else ""
    return WrongUnit("mocap", names, named.factor, f"{', '.join(names)} accelerates {factor:.3g} times as much as the "
                                                   f"tilt gives{both_axes}{named.reading}")


def _wide(name: str, quantities: tuple[str, ...], time_s: np.ndarray, position: np.ndarray) -> WrongUnit | None:
    """A path out of every room that is flown faster than any vehicle flies: its lengths are in another unit."""
    every = _rows_apart(time_s)
    if not no_vehicle_flies(position[::every], time_s[::every]):
        return None
    extent, fast = float(spans(position).max()), _pull(time_s, position, 0.1)
    fits = [f for f in (1000.0, 100.0) if extent < f * LARGEST_FLIGHT_M and fast < f * MOST_M_S2]
    return WrongUnit(name, quantities, fits[0] if fits else 1000.0,
                     f"the path of {name} spans {extent:.4g} m, and a tenth of its rows accelerates by {fast:.3g} "
                     "m/s^2: mm or cm")


def _turned(context: Context) -> WrongUnit | None:
    """A tracked attitude that varies, but by far less than the tilt that its path needs."""
    stream = context.once(posed)
    if stream is None or not all(q in stream.quantities for q in (*POSITION, *ROTATION)):
        return None
    if context.once(tracker_scale) != 1.0:
        return None  # the position is in another unit
    keep = np.isfinite(stream[(*POSITION, *ROTATION)]).all(axis=1)
    if keep.sum() < FEWEST_ROWS / 10 or spans(stream[POSITION][keep]).max() < MOVES_M:
        return None
    turn = so3.make_continuous(stream[ROTATION][keep])
    angle = 2.0 * float(np.linalg.norm(np.ptp(turn[:, :3], axis=0)))
    needed = _pull(stream.time_s[keep], stream[POSITION][keep], 0.1) / GRAVITY_M_S2
    if not 1e-6 < angle < LEAST_TURN * needed:
        return None
    return WrongUnit("mocap", ROTATION, angle / needed, f"the attitude turns by {angle:.2g} rad in all, and the "
                                                        f"accelerations of the path need {needed:.2g} rad")


def _thin(context: Context, name: str, quantities: tuple[str, ...], position: np.ndarray) -> WrongUnit | None:
    """An axis that moves within millimetres of the origin while another moves ``THINNER`` times as far.

    None where noise or tilt shows a path along a line or in a plane: a rail, a car, a flight straight ahead."""
    extent = spans(position)
    if not (extent > FINEST_M).any():
        return None
    thin = int(np.argmin(np.where(extent > FINEST_M, extent, np.inf)))
    ratio = float(extent[thin] / extent.max())
    if ratio * THINNER > 1.0 or np.nanmax(np.abs(position[:, thin])) > THINNEST_M:
        return None
    if _noisy_as_metres(thin, position) or (name == "mocap" and _never_tilts(context, thin)):
        return None
    farthest_mm = 1e3 * float(np.abs(position[:, thin]).max())
    return WrongUnit(name, (quantities[thin],), 1e-3, f"{quantities[thin]} of {name} stays within {farthest_mm:.2g} mm "
                                                      f"of 0, another axis spans {extent.max():.2g} m, and the path "
                                                      "need not be flat")


def _noisy_as_metres(axis: int, position: np.ndarray) -> bool:
    """Whether an axis has the noise of a tracker, and of the other axes as far as theirs is known."""
    sizes, most = noise_by_axis(position, True)
    known = sizes[np.isfinite(sizes)]
    return bool(sizes[axis] > LEAST_NOISE_M and known.max() < most * known.min())


def _never_tilts(context: Context, axis: int) -> bool:
    """Whether the vehicle hardly tilts along a horizontal axis while it does along the other."""
    both = context.once(tilt_and_acceleration) if axis < 2 else None
    if both is None:
        return False
    size = np.sqrt(np.mean(both[1] ** 2, axis=0))
    return bool(size[axis] < HARDLY * size[1 - axis])


def _pace(name: str, time_s: np.ndarray, position: np.ndarray) -> WrongUnit | None:
    """A path in the size of a flight whose accelerations are of no flight: the time is in another unit."""
    extent = float(spans(position).max())
    if not MOVES_M < extent < LARGEST_FLIGHT_M:
        return None
    fast, slow = _pull(time_s, position, 0.1), _pull(time_s, position, 0.01)
    path = f"the path of {name} spans {extent:.2g} m and accelerates by"
    if fast > MOST_M_S2:
        return WrongUnit("", ("t",), 1e-3, f"{path} {fast:.3g} m/s^2 or more in a tenth of its rows")
    if 0.0 < slow < LEAST_M_S2:
        return WrongUnit("", ("t",), 1e3, f"{path} more than {slow:.2g} m/s^2 in a hundredth of its rows only")
    return None


def _pull(time_s: np.ndarray, position: np.ndarray, exceeded_in: float) -> float:
    """Acceleration [m/s^2] that is exceeded in such a share of the rows."""
    every = _rows_apart(time_s)
    return pull_of(position[::every], time_s[::every], exceeded_in)


def _rows_apart(time_s: np.ndarray) -> int:
    """Every how many rows are far enough apart for a derivative."""
    return max(1, min(int(np.ceil(SHORTEST_STEP_S / max(typical_step_s(time_s), 1e-12))), len(time_s) // 20))
