"""One wrong belief of a simulator, for every term of the vocabulary that a diagnosis asks for, with a size that grows.

A belief is a function of the nominal simulator and a size ``x`` above 0. The truth is the change back, read off the two
simulators (``truth_of``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from identification.mismatch.space import with_other_map
from identification.mismatch.track import Track
from identification.prove.truth import TrueEffect, TrueParameter
from nanobench_tools.physics import Model
from nanobench_tools.physics.model import find_term

K_F = 2.3e-8
"""N s^2: rotor speeds of simulators whose input is a command."""
LEVELS = ("mass", "thrust_scale")
"""Free flight shows their ratio only."""
MAPS = ("thrust_voltage", "thrust_pwm")
NOT_COMPARED = ("saturation", *MAPS)
"""Right beliefs of these have no one value: a limit that is never reached, a curve that is only known where it flew."""


@dataclass(frozen=True)
class Flown:
    """Quantities that a corruption may depend on.

    - voltage: median V; height: median m.
    - hover and most: thrust of a rotor, N, in hover and 99.9 % of all.
    - angle (rad) of a direction and number of a motor, drawn for the group."""

    voltage: float
    height_m: float
    hover_N: float
    most_N: float
    angle: float
    motor: int

    @property
    def direction(self) -> tuple[float, float]:
        """Horizontal."""
        return float(np.cos(self.angle)), float(np.sin(self.angle))


@dataclass(frozen=True)
class Belief:
    """name in the table; term that is wrong; start of the search for a size, most that makes sense; ``believe``
    (nominal, x, flown) -> simulator; inputs of the vehicles it can be given to; ``turns``: only seen where turning
    is; ``once``: the belief has one size; ``has``: term that the nominal simulator has to have."""

    name: str
    term: str
    start: float
    most: float
    believe: Callable[[Model, float, Flown], Model]
    inputs: tuple[str, ...] = ("pwm", "rpm", "thrust")
    turns: bool = False
    once: bool = False
    has: str = ""

    def suits(self, nominal: Model) -> bool:
        """Whether the vehicle's flights can show it at all."""
        kind = nominal.vehicle.input
        there = not self.has or self.has in nominal
        return there and kind in self.inputs and not (self.turns and kind == "thrust")


def _scaled(model: Model, term: str, key: str, factor: float) -> Model:
    values = model.values_of(term)
    value = values[key]
    values[key] = tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value
    return model.with_term(term, **values)


def _speeds(model: Model) -> Model:
    """With speeds of the rotors."""
    return model if "thrust_rpm" in model else model.with_term("thrust_rpm", k_f=K_F)


def lighter(model: Model, x: float, flown: Flown) -> Model:
    return model.on(mass_kg=model.vehicle.mass_kg / (1.0 + x))


def stronger(model: Model, x: float, flown: Flown) -> Model:
    s = model.values_of("thrust_scale").get("s", 1.0)
    return model.with_term("thrust_scale", s=s * (1.0 + x))


def less_of(term: str) -> Callable[[Model, float, Flown], Model]:
    """Parameters nearer to where the term does nothing; at 1 the simulator lacks it."""
    def believe(model: Model, x: float, flown: Flown) -> Model:
        if x >= 1.0:
            return model.without(term)
        rests = {p.name: float(p.neutral) for p in find_term(term).parameters if isinstance(p.neutral, (int, float))}
        values = {name: tuple(v + x * (rests[name] - v) for v in value) if isinstance(value, tuple)
                  else value + x * (rests[name] - value) for name, value in model.values_of(term).items()}
        return model.with_term(term, **values)

    return believe


def more_drag(model: Model, x: float, flown: Flown) -> Model:
    return _scaled(model, "drag_linear", "d", 1.0 + x)


def quadratic_drag(model: Model, x: float, flown: Flown) -> Model:
    q = x * model.vehicle.mass_kg
    return model.with_term("drag_quadratic", q=(q, q, q))


def rotor_drag(model: Model, x: float, flown: Flown) -> Model:
    made = _speeds(model)
    speed = np.sqrt(flown.hover_N / made.values_of("thrust_rpm")["k_f"]) * model.rotors
    d = x * model.vehicle.mass_kg / float(speed)
    return made.with_term("drag_rotor", d=(d, d, 0.3 * d))


def drag_moment(model: Model, x: float, flown: Flown) -> Model:
    """The nose goes up more against the wind."""
    c = model.values_of("drag_torque").get("c", 0.0)
    return model.with_term("drag_torque", c=c - x * _arm(model) * model.vehicle.mass_kg)


def _arm(model: Model) -> float:
    return float(np.mean(np.linalg.norm(model.vehicle.motor_positions_m, axis=1)))


def windy(model: Model, x: float, flown: Flown) -> Model:
    a, b = flown.direction
    return model.with_term("wind", w_m_s=(x * a, x * b, 0.0))


def pushed(model: Model, x: float, flown: Flown) -> Model:
    a, b = flown.direction
    f = x * model.vehicle.mass_kg
    return model.with_term("force_world", f_N=(f * a, f * b, 0.0))


def tilted(model: Model, x: float, flown: Flown) -> Model:
    old = model.values_of("frame_tilt")
    a, b = flown.direction
    return model.with_term("frame_tilt", roll_rad=old.get("roll_rad", 0.0) + x * a,
                           pitch_rad=old.get("pitch_rad", 0.0) + x * b)


def shifted(model: Model, x: float, flown: Flown) -> Model:
    r = model.values_of("com_offset").get("r_m", (0.0, 0.0, 0.0))
    a, b = flown.direction
    return model.with_term("com_offset", r_m=(r[0] + x * a * _arm(model), r[1] + x * b * _arm(model), r[2]))


def weak_motor(model: Model, x: float, flown: Flown) -> Model:
    g = np.array(model.values_of("motor_imbalance").get("g", (1.0,) * model.rotors))
    g[flown.motor] *= 1.0 - x
    return model.with_term("motor_imbalance", g=tuple(g / g.mean()))


def heavy_to_turn(model: Model, x: float, flown: Flown) -> Model:
    return _inertia(model, 1.0 + x)


def light_to_turn(model: Model, x: float, flown: Flown) -> Model:
    return _inertia(model, 1.0 / (1.0 + x))


def _inertia(model: Model, factor: float) -> Model:
    """About x and y: about z only the ratio to the yaw moment is seen."""
    if "inertia" in model:
        jx, jy, jz = model.values_of("inertia")["inertia_kg_m2"]
        return model.with_term("inertia", inertia_kg_m2=(factor * jx, factor * jy, jz))
    jx, jy, jz = model.vehicle.inertia_kg_m2
    return model.on(inertia_kg_m2=(factor * jx, factor * jy, jz))


def more_yaw(model: Model, x: float, flown: Flown) -> Model:
    return _scaled(model, "yaw_torque", "k_m", 1.0 + x)


def damped(model: Model, x: float, flown: Flown) -> Model:
    d = np.array(model.values_of("angular_damping").get("d_r", (0.0,) * 3))
    j = np.array(model.vehicle.inertia_kg_m2)
    return model.with_term("angular_damping", d_r=tuple(d + x * j * (1.0, 1.0, 0.0)))


def gyroscopic(model: Model, x: float, flown: Flown) -> Model:
    made = _speeds(model)
    j = made.values_of("rotor_gyro").get("J_r", 0.0)
    return made.with_term("rotor_gyro", J_r=j - x * 1e-3 * model.vehicle.inertia_kg_m2[0])


def near_ground(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term("ground_effect", rho=1.0, R=x * _arm(model) / 2.0)


def climbing(model: Model, x: float, flown: Flown) -> Model:
    old = model.values_of("inflow")
    return model.with_term("inflow", k_z=old.get("k_z", 0.0) + x, k_h=old.get("k_h", 0.0))


def sideways_lift(model: Model, x: float, flown: Flown) -> Model:
    old = model.values_of("inflow")
    return model.with_term("inflow", k_z=old.get("k_z", 0.0), k_h=old.get("k_h", 0.0) + x)


def slower_motors(model: Model, x: float, flown: Flown) -> Model:
    old = model.values_of("motor_lag")
    return model.with_term("motor_lag", tau_up_s=old.get("tau_up_s", 0.0) + x,
                           tau_down_s=old.get("tau_down_s", 0.0) + x)


def later(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term("command_delay", delay_s=model.values_of("command_delay").get("delay_s", 0.0) + x)


def limited(model: Model, x: float, flown: Flown) -> Model:
    return model.with_term("saturation", T_max_N=flown.most_N * (1.0 - x))


def steeper(model: Model, x: float, flown: Flown) -> Model:
    """A thrust curve that is right in hover and too steep."""
    name = next(m for m in MAPS if m in model)
    s = model.values_of("thrust_scale").get("s", 1.0)
    c = [(1.0 + x) * k for k in model.values_of(name)["c"]]
    c[0] -= x * flown.hover_N / s
    return model.with_term(name, c=tuple(c))


def no_battery(model: Model, x: float, flown: Flown) -> Model:
    made = with_other_map(model, flown.voltage)
    assert made is not None  # it has a thrust_voltage
    return made


def _less(name: str, term: str) -> Belief:
    return Belief(name, term, 0.05, 1.0, less_of(term), has=term)


PWM = ("pwm",)
BELIEFS = (
    Belief("mass", "mass", 0.01, 1.0, lighter),
    Belief("thrust_scale", "thrust_scale", 0.01, 1.0, stronger),
    _less("less drag", "drag_linear"),
    Belief("more drag", "drag_linear", 0.05, 20.0, more_drag),
    Belief("drag_quadratic", "drag_quadratic", 0.02, 10.0, quadratic_drag),
    Belief("drag_rotor", "drag_rotor", 0.02, 10.0, rotor_drag),
    Belief("drag_torque", "drag_torque", 0.02, 2.0, drag_moment, turns=True),
    Belief("wind", "wind", 0.02, 15.0, windy),
    Belief("force_world", "force_world", 0.01, 8.0, pushed),
    Belief("frame_tilt", "frame_tilt", 0.002, 0.45, tilted),
    Belief("com_offset", "com_offset", 0.002, 0.9, shifted, turns=True),
    Belief("motor_imbalance", "motor_imbalance", 0.005, 0.7, weak_motor, turns=True),
    Belief("more inertia", "inertia", 0.05, 2.0, heavy_to_turn, turns=True),
    Belief("less inertia", "inertia", 0.05, 4.0, light_to_turn, turns=True),
    Belief("more yaw_torque", "yaw_torque", 0.05, 5.0, more_yaw, turns=True),
    _less("less yaw_torque", "yaw_torque"),
    Belief("angular_damping", "angular_damping", 0.2, 40.0, damped, turns=True),
    Belief("rotor_gyro", "rotor_gyro", 0.2, 100.0, gyroscopic, turns=True),
    Belief("ground_effect", "ground_effect", 0.2, 8.0, near_ground),
    Belief("inflow k_z", "inflow", 0.005, 0.9, climbing),
    Belief("inflow k_h", "inflow", 0.002, 0.19, sideways_lift),
    Belief("more lag", "motor_lag", 0.005, 0.4, slower_motors),
    _less("less lag", "motor_lag"),
    _less("less delay", "command_delay"),
    _less("less drag_torque", "drag_torque"),
    _less("less damping", "angular_damping"),
    _less("less com_offset", "com_offset"),
    _less("less imbalance", "motor_imbalance"),
    Belief("command_delay", "command_delay", 0.005, 0.19, later),
    Belief("saturation", "saturation", 0.02, 0.6, limited),
    Belief("thrust curve", "", 0.05, 4.0, steeper, PWM),
    Belief("no battery", "thrust_voltage", 1.0, 1.0, no_battery, PWM, once=True),
)
"""``slung_load`` and ``rotor_reaction`` are missing: no diagnosis asks for them. A belief without a term has that of
the vehicle's thrust curve."""


def flown_by(nominal: Model, tracks: Sequence[Track], rng: np.random.Generator) -> Flown:
    """Of a group."""
    volts = float(np.median(np.concatenate([t.battery_V[t.counts] for t in tracks])))
    hover = nominal.vehicle.mass_kg * nominal.vehicle.gravity_m_s2 / nominal.rotors
    commands = np.concatenate([_commands(nominal, t) for t in tracks])
    height = float(np.median(np.concatenate([t.position_m[t.counts, 2] for t in tracks])))
    return Flown(volts, height, hover, float(np.quantile(commands, 0.999)), float(rng.uniform(0.0, 2.0 * np.pi)),
                 int(rng.integers(nominal.rotors)))


def _commands(model: Model, track: Track) -> np.ndarray:
    """(n * rotors,) commanded thrusts [N]."""
    scale = model.values_of("thrust_scale").get("s", 1.0)
    motor = track.motor[track.counts]
    if model.vehicle.input == "rpm":
        return np.asarray(model.values_of("thrust_rpm")["k_f"] * motor.ravel() ** 2 * scale)
    if model.vehicle.input == "thrust":
        return np.asarray(motor.ravel() * scale)
    name = next(m for m in MAPS if m in model)
    u = motor * track.battery_V[track.counts][:, None] if name == "thrust_voltage" else motor
    return np.asarray(np.polynomial.polynomial.polyval(u, model.values_of(name)["c"]).ravel() * scale)


def truth_of(nominal: Model, simulator: Model, size: str, flights: Sequence[str]) -> tuple[TrueEffect, ...]:
    """The effects that lead from ``simulator`` back to ``nominal``, with the values of the nominal simulator."""
    right, wrong = _values(nominal), _values(simulator)
    terms: dict[str, dict[str, TrueParameter]] = {}
    for name, (value, unit) in right.items():
        if name not in wrong or abs(wrong[name][0] - value) > 1e-12 * max(abs(value), 1e-12):
            terms.setdefault(name.partition(".")[0], {})[name] = TrueParameter(
                value, unit, wrong[name][0] if name in wrong else None)
    for name, (value, unit) in wrong.items():
        if name not in right:
            rest = _rest(name, nominal)
            if rest is not None and rest != value:
                terms.setdefault(name.partition(".")[0], {})[name] = TrueParameter(rest, unit, value)
    gone = [m for m in MAPS if m in simulator and m not in nominal]
    return tuple(TrueEffect(term, size, tuple(flights), twins=_twins(term), parameters={} if term in NOT_COMPARED
                            else parameters) for term, parameters in terms.items()
                 if term not in gone and not (term == "thrust_rpm" and "thrust_rpm" not in nominal))


def _twins(term: str) -> tuple[str, ...]:
    return tuple(t for t in LEVELS if t != term) if term in LEVELS else MAPS if term in MAPS else ()


def _values(model: Model) -> dict[str, tuple[float, str]]:
    """{flat name: (value, unit)} with mass and inertia under the names of their terms."""
    found = {n: (v, u) for n, v, u in zip(model.names, model.values.tolist(), model.units, strict=True)}
    found.setdefault("mass.m", (model.vehicle.mass_kg, "kg"))
    for k, j in enumerate(model.vehicle.inertia_kg_m2):
        found.setdefault(f"inertia.inertia_kg_m2[{k}]", (j, "kg m^2"))
    return found


def _rest(name: str, nominal: Model) -> float | None:
    """Where a parameter does nothing."""
    term, _, flat = name.partition(".")
    neutral = find_term(term).parameter(flat.partition("[")[0]).neutral
    return float(neutral) if isinstance(neutral, (int, float)) else None
