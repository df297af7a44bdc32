"""Predictive control of n vehicles: the part that all variants share, from the measurement to the command.

Steps of a command; the variants differ in the plan alone:

- guard, then observer (present state and disturbance);
- prediction through the commands under way to the time at which a new one acts;
- targets from the reference's future, then a plan;
- PWM within the battery's limits.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numba as nb
import numpy as np
from scipy.linalg import solve_discrete_are

from nanobench_tools.firmware.guard import REST_BATTERY_V, Guard
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics.model import Model
from nanobench_tools.settings import number, setting
from nanobench_tools.slices import put

from ..gains import Gain, around, whole
from ..geometric import slowest_lag_s
from .casadi_code import Call, SolverFailure
from .delay import UnderWay
from .disturbance import Observer, Tuning
from .fallback import PLAN_S, Fallback
from .horizon import NEAR_M, Gains, Horizon, flyable
from .prediction_model import ERRORS, RIGID, STATES, Equations4, default_model, stages_function, targets_function
from .thrust_map import ThrustMap
from .thrust_plan import Plan, bounded
from .tilt_bounds import MARGIN_RAD, MOST_RAD

PERIOD_S = 0.01
OUTAGE_S = 0.6
"""So long the model flies on without a measurement; then the vehicle is lost (``guard``)."""
STALE_M, STALE_S = 0.01, 0.02
"""A pose that has not changed by one bit for so long, while the vehicle went so far, is an old one."""
FAR_M = 1.0
"""So far from where it should be, a vehicle starts from the measurement."""
LONGEST_STEPS = 10
"""Periods that may pass between two calls; after more the controller starts from the measurement."""


@dataclass(frozen=True)
class Weights:
    """Errors of equal cost (Bryson): position m and velocity m/s level and vertical, turn rad and rate rad/s about body
    x, y and about z. Thrust N and moments N m (x and y, z) of the same cost."""

    position_m: tuple[float, float] = setting("control.predictive_base.weights_position_m")
    velocity_m_s: tuple[float, float] = setting("control.predictive_base.weights_velocity_m_s")
    turn_rad: tuple[float, float] = setting("control.predictive_base.weights_turn_rad")
    rate_rad_s: tuple[float, float] = setting("control.predictive_base.weights_rate_rad_s")
    thrust_N: float = number("control.predictive_base.weights_thrust_n")
    moment_N_m: tuple[float, float] = setting("control.predictive_base.weights_moment_n_m")

    def of_errors(self, states: int) -> np.ndarray:
        """Diagonal of Q (S,); rotor states cost nothing."""
        pairs = (self.position_m, self.velocity_m_s, self.turn_rad, self.rate_rad_s)
        sizes = [size for level, other in pairs for size in (level, level, other)]
        return np.concatenate([1.0 / np.square(sizes), np.zeros(states - RIGID)])

    def of_inputs(self, model: Model) -> np.ndarray:
        """R (4, 4) over thrusts [N]."""
        mix = Equations4(model).mixing()
        mix[1:] *= np.array(model.vehicle.inertia_kg_m2)[:, None]
        cost = mix / np.array([self.thrust_N, self.moment_N_m[0], self.moment_N_m[0], self.moment_N_m[1]])[:, None]
        return np.asarray(cost.T @ cost)


TUNABLE = {
    "position_level_m": around(Weights.position_m[0], "m"), "position_up_m": around(Weights.position_m[1], "m"),
    "velocity_m_s": around(Weights.velocity_m_s[0], "m/s"), "turn_rad": around(Weights.turn_rad[0], "rad"),
    "rate_rad_s": around(Weights.rate_rad_s[0], "rad/s"), "thrust_N": around(Weights.thrust_N, "N"),
    "moment_N_m": around(Weights.moment_N_m[0], "N m", 4.0), "place_1_s": around(Tuning.place_1_s, "1/s", 1.5),
    "moment_1_s": around(Tuning.moment_1_s, "1/s"), "share_attitude": around(Tuning.share[2], "1", 2.5),
    "share_rate": around(Tuning.share[3], "1", 2.5)}


def tuned(gains: Mapping[str, float], weights: Weights, tuning: Tuning, who: str) -> tuple[Weights, Tuning]:
    """Both with ``gains`` by the names of TUNABLE; about z a turn, a rate and a moment cost as they did."""
    k = whole(TUNABLE, gains, who)
    return (replace(weights, position_m=(k["position_level_m"], k["position_up_m"]),
                    velocity_m_s=(k["velocity_m_s"],) * 2, turn_rad=(k["turn_rad"], weights.turn_rad[1]),
                    rate_rad_s=(k["rate_rad_s"], weights.rate_rad_s[1]), thrust_N=k["thrust_N"],
                    moment_N_m=(k["moment_N_m"], 0.5 * k["moment_N_m"])),
            replace(tuning, place_1_s=k["place_1_s"], moment_1_s=k["moment_1_s"],
                    share=(3.0 * k["place_1_s"] * PERIOD_S, tuning.share[1], k["share_attitude"], k["share_rate"])))


def about_hover(stages: Call, hover_N: float, states: int) -> tuple[np.ndarray, np.ndarray]:
    """A (S, S) and B (S, 4) of a step about hover, looking along x, from ``stages_function``; S ``states``."""
    x, u, ahead, d = stages.given
    hover = np.zeros(STATES)
    hover[9], hover[13:] = 1.0, hover_N
    x[:], u[:], ahead[:], d[:] = hover, hover_N, hover, 0.0
    _, a, b = stages()
    return a.reshape(-1, states, states)[0].copy(), b.reshape(-1, 4, states)[0].T.copy()


def _ahead_of(held: Reference) -> Callable[[np.ndarray], Reference]:
    """The future of a reference that stays as it is."""
    def ahead(seconds: np.ndarray) -> Reference:
        parts = (held.position_m, held.yaw_rad, held.velocity_m_s, held.acceleration_m_s2)
        return Reference(*[np.repeat(part[None], len(seconds), axis=0) for part in parts])  # type: ignore[arg-type]
    return ahead


@nb.njit(cache=True)
def _judged(place: np.ndarray, speed: np.ndarray, attitude: np.ndarray, rate: np.ndarray, good: np.ndarray,
            passed_s: float, late: bool, state: np.ndarray, known: np.ndarray, pose: np.ndarray, same_s: np.ndarray,
            way_m: np.ndarray, measured: np.ndarray, fresh: np.ndarray, begin: np.ndarray) -> tuple[int, int]:
    """Compare measurements of n vehicles, passed_s after the last, with states (n, 17).

    Fills ``measured`` (n, 13), ``fresh`` (n,): the pose is new, and ``begin`` (n,). The vehicles in ``begin`` restart
    from it, all of ``late`` if possible. ``pose`` (n, 7), ``same_s`` and ``way_m`` (n,) keep the last pose and the
    time and way since. Counts both.
    """
    stale = started = 0
    for n in range(place.shape[0]):
        put(measured[n], place[n])
        put(measured[n][3:], speed[n])
        put(measured[n][6:], attitude[n])
        put(measured[n][10:], rate[n])
        same = True
        for i in range(7):
            value = measured[n, i if i < 3 else i + 3]
            same &= value == pose[n, i]
            pose[n, i] = value
        fast = np.sqrt(np.sum(state[n, 3:6] ** 2))
        same_s[n] = same_s[n] + passed_s if same else 0.0
        way_m[n] = way_m[n] + passed_s * fast if same else 0.0
        fresh[n] = not (same_s[n] > STALE_S and way_m[n] > STALE_M)
        stale += not fresh[n]
        outdated = late or not np.isfinite(state[n]).all()
        far = np.sqrt(np.sum((state[n, :3] - place[n]) ** 2)) > FAR_M
        begin[n] = good[n] and fresh[n] and (outdated or far or not known[n])
        started += begin[n]
    return stale, started


class Mpc:
    """Full references in, with their future if available; motor PWM out, every PERIOD_S.

    Parameters
    ----------
    model : Model, optional
        Simulator of four motors with PWM input; default: the shipped vehicle.
    delay_s : float, optional
        Time from the return of ``command`` until its result acts, s; default: the model's ``command_delay``.
    horizon : int
        Number of stages.
    dt_s : float
        Length of a stage, s.
    weights : Weights, optional
        Errors of equal cost.
    tuning : Tuning, optional
        Of the observer of disturbances.
    states : int
        Number of states in the program.
    period_s : float
        Seconds between two commands.
    tilt_rad : float
        Limit of tilt in plans. Targets tilt less, and less still on a battery that could not carry the vehicle then.
    near_m : float
        Smaller errors are left to the program (``horizon.within_reach``). This does not apply if other loops are
        between a plan and the motors.
    gains : mapping, optional
        Values of the gains below, by name.

    Attributes
    ----------
    guard, fallback, counts
        Report replaced inputs and commands.
    plan
        The last plans.
    """

    name = "mpc"
    information = "preview"
    period_s = PERIOD_S
    tunable: Mapping[str, Gain] = TUNABLE

    def __init__(self, model: Model | None = None, *, delay_s: float | None = None, horizon: int = 20,
                 dt_s: float = 0.025, weights: Weights | None = None, tuning: Tuning | None = None,
                 states: int = ERRORS, period_s: float = PERIOD_S, tilt_rad: float = MOST_RAD,
                 near_m: float = NEAR_M, gains: Mapping[str, float] | None = None) -> None:
        model = model or default_model()
        if gains:
            weights, tuning = tuned(gains, weights or Weights(), tuning or Tuning(), self.name)
        known_s = float(model.values_of("command_delay")["delay_s"]) if "command_delay" in model else 0.0
        self.delay_s = known_s if delay_s is None else delay_s
        self.model = model.without("command_delay") if "command_delay" in model else model
        self.horizon, self.dt_s, self.states = horizon, dt_s, states
        self.period_s, self.weights, self.tilt_rad, self.near_m = period_s, weights or Weights(), tilt_rad, near_m
        self.thrust_map = ThrustMap(self.model)
        way = UnderWay(1, period_s, self.delay_s, np.zeros(4))
        self.observer = Observer(self.model, period_s, tuning, (len(way.before_s), len(way.acting_s)))
        self._targets = Call(targets_function(self.model, horizon + 1))
        self._stages = Call(stages_function(self.model, horizon, dt_s, states))
        self.hover_N = 0.25 * Equations4(self.model).mass_kg * self.model.vehicle.gravity_m_s2
        self.q, self.r = self.weights.of_errors(states), self.weights.of_inputs(self.model)
        self.p = self._terminal()
        near_hover = self._gains()
        self._near_hover = np.stack([near_hover.position_1_s2, near_hover.velocity_1_s])
        self._target_tilt = max(tilt_rad - MARGIN_RAD, 0.5 * tilt_rad)
        self._horizon = Horizon(self.delay_s + dt_s * np.arange(horizon + 1))
        self._rehearsed = False

    @property
    def compiled(self) -> bool:
        """Whether the equations run as C."""
        return self._stages.is_c

    def hover_stage(self) -> tuple[np.ndarray, np.ndarray]:
        """A (S, S) and B (S, 4) of a step of ``dt_s`` about hover, looking along x."""
        return about_hover(self._stages, self.hover_N, self.states)

    def _terminal(self) -> np.ndarray:
        """Cost of all that comes after the horizon, by the discrete Riccati equation about hover."""
        a, b = self.hover_stage()
        return np.asarray(solve_discrete_are(a, b, np.diag(self.q + 1e-9), self.r))

    def _gains(self) -> Gains:
        a, b = self.hover_stage()
        gain = np.linalg.solve(self.r + b.T @ self.p @ b, b.T @ self.p @ a)
        about_y, lift = Equations4(self.model).mixing()[2] @ gain, gain.sum(axis=0) / Equations4(self.model).mass_kg
        level = self.model.vehicle.gravity_m_s2 / about_y[7]
        return Gains(np.array([level * about_y[0], level * about_y[0], lift[2]]),
                     np.array([level * about_y[3], level * about_y[3], lift[5]]))

    def _rehearse(self) -> None:
        """Runs what is compiled at its first call, and would be in flight: commands, and what flies without a plan."""
        self.reset(1)
        still = np.zeros((1, 3))
        state = VehicleState(still, still, np.array([[0.0, 0.0, 0.0, 1.0]]), still, np.full(1, REST_BATTERY_V))
        there = Reference(still + 1.0, np.zeros(1), still, still, still, np.zeros(1))
        for k in range(3):
            command = self.command(k * self.period_s, state, replace(there, ahead=_ahead_of(there)))
        for _ in range(round(PLAN_S / self.period_s) + 2):
            self.fallback.note(np.zeros(1, bool))
        self.fallback.replaced(k * self.period_s, state, there, command)

    def reset(self, n: int) -> None:
        if not self._rehearsed:
            self._rehearsed = True
            self._rehearse()
        self.n = n
        self.guard = Guard(n, self.period_s, OUTAGE_S)
        self.fallback = Fallback(n, self.period_s, self.model.vehicle, slowest_lag_s(self.model))
        self.counts = {"solver": 0, "stale": 0, "time": 0, "started": 0, "future": 0}
        self.observer.reset(n, self.hover_N)
        self._way = UnderWay(n, self.period_s, self.delay_s, np.full(4, self.hover_N))
        self.plan = Plan(n, self.horizon, self.dt_s, self.hover_N)
        self._time_s = np.nan
        self._start = self.observer.state
        self._command = np.zeros((n, 4))
        self._pose = np.full((n, 7), np.nan)
        self._same_s, self._way_m = np.zeros((2, n))
        self._measured, self._fresh, self._begin = np.zeros((n, 13)), *np.zeros((2, n), bool)

    def command(self, time_s: float, state: VehicleState, reference: Reference) -> np.ndarray:
        """PWM ratios (n, 4), finite and within 0..1 for any input."""
        with np.errstate(all="ignore"):
            steps = self._steps(time_s)
            if steps == 0:
                return self._command
            ahead = reference.ahead
            state, reference = self.guard.admit(state, reference)
            self._observe(state, steps)
            reference, landing = self.fallback.commanded(state, reference)
            limits = self.thrust_map.limits(state.battery_V)
            self._start = self.observer.predicted(self._way.before_s, self._way.before)
            rows, bad = self._horizon.rows(reference, ahead, landing)
            self.counts["future"] += bad
            self._make_plans(self._start, rows, limits)
            commanded = self.plan.now(limits)
            ratios = self.thrust_map.ratios(commanded, state.battery_V)
            ratios = self.fallback.replaced(time_s, state, reference, ratios)
            self._command = self.guard.release(ratios)
            self._way.give(commanded)
            self.observer.advance(self._way.acting_s, self._way.acting)
            return self._command

    def foreseen(self, seconds: float) -> np.ndarray:
        """States (n, 17) that the plans lead to, ``seconds`` after the last command begins to act."""
        whole = min(int(seconds / self.dt_s), self.horizon)
        parts = [self.dt_s] * whole
        if whole < self.horizon and seconds - whole * self.dt_s > 1e-9:
            parts.append(seconds - whole * self.dt_s)
        return self.observer.predicted(np.array(parts), self.plan.thrust_N.swapaxes(0, 1)[:len(parts)], self._start)

    def _steps(self, time_s: float) -> int:
        """Periods since the last call; 0 if the clock stops or runs backwards, when the last command is held."""
        first = not math.isfinite(self._time_s)
        passed = 1.0 if first or not math.isfinite(time_s) else (time_s - self._time_s) / self.period_s
        if not math.isfinite(time_s):
            self.counts["time"] += 1
            self._time_s += self.period_s
            return 1
        if passed < 0.5:
            self.counts["time"] += 1
            if passed < -LONGEST_STEPS:  # another clock: go on from here
                self._time_s = time_s
            return 0
        self._time_s = time_s
        self.counts["time"] += passed > 1.5
        return round(min(passed, LONGEST_STEPS + 1.0))

    def _observe(self, state: VehicleState, steps: int) -> None:
        for _ in range(min(steps, LONGEST_STEPS) - 1):  # calls that were left out
            self._way.give(self._way.last)
            self.observer.advance(self._way.acting_s, self._way.acting)
        good = self.guard.measured
        stale, started = _judged(
            state.position_m, state.velocity_m_s, state.quaternion, state.rate_rad_s, good, steps * self.period_s,
            steps > LONGEST_STEPS, self.observer.state, self.observer.known, self._pose, self._same_s, self._way_m,
            self._measured, self._fresh, self._begin)
        self.counts["stale"] += stale
        self.counts["started"] += started
        if started:
            self.observer.begin(self._begin, self._measured)
            good = good & ~self._begin
        self.observer.correct(self._measured, good, self._fresh)

    def _make_plans(self, x: np.ndarray, rows: np.ndarray, limits: np.ndarray) -> None:
        """Plans for all vehicles from x (n, 17); those without a new one keep the old."""
        flyable(rows, self._horizon.seconds, x, self._near_hover, limits[1], self.hover_N,
                self.model.vehicle.gravity_m_s2, self.observer.disturbance, self._target_tilt, self.near_m)
        planned = np.zeros(self.n, bool)
        self.plan.age_s += self.period_s
        given, d = self._targets.given
        for i in range(self.n):
            given[:], d[:] = rows[i], self.observer.disturbance[i]
            try:
                states, inputs = self._targets()
                found = self.solve(i, x[i], rows[i, -1, 12], states, inputs, limits[0, i], limits[1, i])
            except (SolverFailure, np.linalg.LinAlgError):  # LinAlgError: a flight of the model that left all numbers
                found = None
            if found is not None and bounded(found, limits[0, i], limits[1, i], self.plan.thrust_N[i]):
                self.plan.age_s[i] = 0.0
                planned[i] = True
            else:
                self.counts["solver"] += 1
        self.fallback.note(planned)

    def solve(self, i: int, x: np.ndarray, yaw: float, targets: np.ndarray, inputs: np.ndarray, least: np.ndarray,
              most: np.ndarray) -> np.ndarray | None:
        """Plan for vehicle i: thrusts (N, 4), or None.

        x (17), targets (N + 1, 17) and inputs (N + 1, 4), motors between least and most (4,) N."""
        raise NotImplementedError
