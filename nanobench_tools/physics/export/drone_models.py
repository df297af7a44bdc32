"""A model as parameters of crazyflow and drone-models: a section of their ``first_principles`` physics (TOML).

Layout of drone-models 0.1 (data/params.toml) and crazyflow 0.4 (dynamics/first_principles/params.toml); keys that one
of them does not know are ignored by it. Frames, quaternions, motor order and signs are as here, rotor speeds in RPM:

    T = rpm2thrust . (1, Omega, Omega^2)    torque = mixing_matrix (L T, L T, rpm2torque . (1, Omega, Omega^2))
    dOmega/dt = a (cmd - Omega) + b (cmd^2 - Omega^2), rotor_dyn_coef = [a, b] rising, [a, b] falling

    F_b += drag_matrix v_b    and the gyroscopic moment of prop_inertia, with that of changing rotor speeds

drone-models 0.1 has the first component of the gyroscopic moment with the other sign; crazyflow has mended it.
"""

from pathlib import Path
from typing import Any

from ...errors import InputError, MissingExtraError
from ...results.result_files import write_bytes
from ..model import Model
from .account import Account, Exported, account
from .rotors import RAD_S_PER_RPM, Assumed, command_lines, get, rotors

AT_ONCE_S = 1e-3
"""Both need a lag; rotors without one get this."""

EXACT = {"mass": "", "inertia": "", "thrust_rpm": "rpm2thrust", "yaw_torque": "rpm2torque",
         "drag_linear": "drag_matrix", "com_offset": "in mixing_matrix"}
APPROXIMATED = {
    "motor_lag": "their rotor speeds lag; with cmd^2 - Omega^2 equal where a change begins at the speed of hover",
    "com_offset": "in mixing_matrix: exact for thrust; their drag has no moment",
    "drag_rotor": "in drag_matrix, equal at the summed rotor speed of hover",
    "inflow": "k_z in drag_matrix, equal at the thrust of hover; k_h is left out",
    "rotor_gyro": "as prop_inertia, which turns and reacts alike",
    "rotor_reaction": "as prop_inertia, which turns and reacts alike",
}


def section(model: Model, assumed: Assumed | None = None) -> tuple[dict[str, Any], Account]:
    """(keys of one drone, what they express). Raises InputError for motors in the centre and models without hover."""
    about = rotors(model, assumed or Assumed())
    arm = max(abs(x) for motor in model.vehicle.motor_positions_m for x in motor)
    if arm == 0.0:
        raise InputError("model", "all motors are at the centre", "give motor_positions_m")
    used, minutes = dict(about.assumed), RAD_S_PER_RPM
    per_rpm = about.k_f * minutes**2, about.k_m * minutes**2
    hover_rpm = about.hover_rad_s / minutes
    if about.tau_s is None or min(about.tau_s) < AT_ONCE_S:
        used["rotor_dyn_coef"] = f"no lag is shorter than {AT_ONCE_S:g} s: their rotors need one"
    up, down = (max(tau, AT_ONCE_S) for tau in about.tau_s or (0.0, 0.0))
    linear, rotor = get(model, "drag_linear", "d", (0.0,) * 3), get(model, "drag_rotor", "d", (0.0,) * 3)
    climb = 4.0 * about.hover_N * get(model, "inflow", "k_z", 0.0)
    drag = [d + about.sum_rad_s * r + c for d, r, c in zip(linear, rotor, (0.0, 0.0, climb), strict=True)]
    made = {
        "gravity_vec": [0.0, 0.0, -about.gravity_m_s2], "mass": about.mass_kg, "L": arm,
        "J": _diagonal(about.inertia_kg_m2),
        "rpm2thrust": [0.0, 0.0, per_rpm[0]], "rpm2torque": [0.0, 0.0, per_rpm[1]],
        "thrust2torque": about.k_m / about.k_f,
        "rotor_dyn_coef": [0.0, 0.5 / (hover_rpm * up), 0.0, 0.5 / (hover_rpm * down)],
        "mixing_matrix": [[y / arm for _, y, _ in about.motors_m], [-x / arm for x, _, _ in about.motors_m],
                          list(about.spin)],
        "drag_matrix": _diagonal([-d for d in drag]),
        "prop_inertia": get(model, "rotor_reaction", "J_r", -get(model, "rotor_gyro", "J_r", 0.0)),
        "thrust_min": 0.0, "thrust_max": about.thrust_max_N,
    }
    if "thrust_voltage" in model:
        scale = get(model, "thrust_scale", "s", 1.0)
        made["vmotor2thrust"] = [c * scale for c in model.values_of("thrust_voltage")["c"]]
    dragged = any(term.name.startswith("drag_") for term in model.terms)
    exact = {name: text for name, text in EXACT.items() if not (dragged and name == "com_offset")}
    return made, account(model, "first_principles", exact, APPROXIMATED, used)


def _diagonal(values: Any) -> list[list[float]]:
    return [[float(value) if i == j else 0.0 for j in range(3)] for i, value in enumerate(values)]


def write_drone_models(model: Model, folder: Path, assumed: Assumed | None = None, name: str = "fitted") -> Exported:
    """crazyflow_params.toml with one section [name]. Raises MissingExtraError without tomlkit."""
    try:
        import tomlkit
    except ImportError:
        raise MissingExtraError("tomlkit", "identification") from None
    made, about = section(model, assumed)
    document = tomlkit.document()
    for line in ("Parameters of first_principles in crazyflow and drone-models; a section of their params.toml.",
                 "Their so_rpy physics are fits of another controller's closed loop, which a model does not hold.",
                 *(line.replace("Omega_i = sqrt", "Omega_i [rad/s] = sqrt") for line in
                   command_lines(model, made["rpm2thrust"][2] / RAD_S_PER_RPM**2)),
                 "  RPM = Omega 30 / pi", *about.lines()):
        document.add(tomlkit.comment(line))
    table = tomlkit.table()
    for key, value in made.items():
        table[key] = value
        table[key].comment(UNITS[key])
    document[name] = table
    path = Path(folder) / "crazyflow_params.toml"
    write_bytes(path, tomlkit.dumps(document).encode())
    return Exported((path,), about)


UNITS = {"gravity_vec": "m/s^2", "mass": "kg", "L": "m, greatest distance of a motor from an axis", "J": "kg m^2",
         "rpm2thrust": "N, N/RPM, N/RPM^2", "rpm2torque": "N m, N m/RPM, N m/RPM^2", "thrust2torque": "m",
         "rotor_dyn_coef": "1/s, 1/(s RPM), rising and falling", "mixing_matrix": "motor places over L, signs of spin",
         "drag_matrix": "N s/m", "prop_inertia": "kg m^2", "thrust_min": "N per motor", "thrust_max": "N per motor",
         "vmotor2thrust": "N/V^k, index is order"}
