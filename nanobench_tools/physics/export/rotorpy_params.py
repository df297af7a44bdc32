"""A model as parameters of RotorPy 3 (``quad_params``), an independent simulator of multirotors.

RotorPy's world is z up, its body x forward, y left, z up, its quaternions x, y, z, w body to world: as here. Rotors
keep the numbers of the motors, r1 = motor 1. Per rotor, with the air velocity v of its hub in the body (Folk, Paulos,
Kumar 2023, RotorPy, arXiv 2306.04485; vehicles/multirotor.py of 3.0):

    T = k_eta Omega^2 + k_h (v_x^2 + v_y^2)    H = -Omega diag(k_d, k_d, k_z) v    tau_m dOmega/dt = cmd - Omega

    M_z = direction k_m Omega^2    M_flap = -k_flap Omega v x e3    and at the centre D = -|v| diag(c_D) v

Drag of rotors grows with their speed there; ours in proportion to velocity alone is made equal at the speed of hover.
"""

from pathlib import Path
from typing import Any

from ...results.result_files import to_text, write_bytes
from ..model import Model
from .account import Account, Exported, account
from .rotors import Assumed, Rotors, command_lines, commands, get, rotors

SCHEMA = "nanobench-rotorpy/1"
AT_ONCE_S = 1e-3
"""RotorPy divides by the lag; rotors without one get this."""
NO_YAW = 1e-9
"""Yaw torque over thrust [m] of a model without one: RotorPy inverts its mixer."""
GRAVITY_M_S2 = 9.81
"""Fixed in RotorPy."""

EXACT = {"mass": "", "inertia": "", "thrust_rpm": "k_eta", "yaw_torque": "k_m = k_eta times ours"}
APPROXIMATED = {
    "motor_lag": "RotorPy's rotor speeds lag, with one time constant (the mean of up and down); here thrusts lag: "
                 "equal for small changes about any speed",
    "com_offset": "rotors are placed about the centre of mass; RotorPy's c_D drag has no moment about it",
    "drag_linear": "equal at the summed rotor speed of hover, x and y by their mean; RotorPy adds damping of rates",
    "drag_rotor": "equal without rates, x and y by their mean; RotorPy adds damping of rates",
    "drag_quadratic": "equal for air along one body axis; RotorPy takes |v| v_i, here |v_i| v_i",
    "drag_torque": "as k_flap, equal at the summed rotor speed of hover",
    "inflow": "as k_z and k_h, equal at the rotor speed of hover and in still air",
}


def quad_params(model: Model, assumed: Assumed | None = None) -> tuple[dict[str, Any], Account]:
    """(RotorPy's parameters as plain numbers and lists, what they express). InputError for a model without hover."""
    about = rotors(model, assumed or Assumed())
    drag = get(model, "drag_linear", "d", (0.0,) * 3)
    rotor, quadratic = get(model, "drag_rotor", "d", (0.0,) * 3), get(model, "drag_quadratic", "q", (0.0,) * 3)
    inflow = model.values_of("inflow") if "inflow" in model else {"k_z": 0.0, "k_h": 0.0}
    jx, jy, jz = about.inertia_kg_m2
    made = {
        "mass": about.mass_kg, "Ixx": jx, "Iyy": jy, "Izz": jz, "Ixy": 0.0, "Iyz": 0.0, "Ixz": 0.0,
        "num_rotors": 4, "rotor_pos": {f"r{i}": list(p) for i, p in enumerate(about.motors_m, start=1)},
        "rotor_directions": list(about.spin), "rI": [0.0, 0.0, 0.0],
        "c_Dx": quadratic[0], "c_Dy": quadratic[1], "c_Dz": quadratic[2],
        "k_eta": about.k_f, "k_m": about.k_m or NO_YAW * about.k_f,
        "k_d": 0.5 * (drag[0] + drag[1]) / about.sum_rad_s + 0.5 * (rotor[0] + rotor[1]),
        "k_z": drag[2] / about.sum_rad_s + rotor[2] + about.hover_N * inflow["k_z"] / about.hover_rad_s,
        "k_h": about.hover_N * inflow["k_h"], "k_flap": get(model, "drag_torque", "c", 0.0) / about.sum_rad_s,
        "tau_m": max(sum(about.tau_s) / 2.0, AT_ONCE_S) if about.tau_s else AT_ONCE_S,
        "rotor_speed_min": 0.0, "rotor_speed_max": about.speed_max_rad_s, "motor_noise_std": 0.0,
        "k_w": 1.0, "k_v": 10.0, "kp_att": 3000.0, "kd_att": 360.0,
    }
    exact = EXACT if "drag_quadratic" in model else {**EXACT, "com_offset": "rotors placed about the centre of mass"}
    return made, account(model, "RotorPy", exact, APPROXIMATED, _assumed(model, about))


def _assumed(model: Model, about: Rotors) -> dict[str, str]:
    found = dict(about.assumed)
    found["k_w, k_v, kp_att, kd_att"] = "gains of RotorPy's own controllers: its defaults"
    if about.tau_s is None:
        found["tau_m"] = f"{AT_ONCE_S:g} s: the model has no lag, RotorPy needs one"
    if not about.k_m:
        found["k_m"] = f"{NO_YAW:g} m times k_eta: the model has no yaw torque, RotorPy needs one"
    if about.gravity_m_s2 != GRAVITY_M_S2:
        found["gravity"] = f"{GRAVITY_M_S2:g} m/s^2 is fixed in RotorPy; the model has {about.gravity_m_s2:g}"
    return found


def commands_beside(model: Model) -> dict[str, Any]:
    """What RotorPy's parameters do not hold: from PWM to thrust asked for, wind, whether rotors lag."""
    lags = get(model, "motor_lag", "tau_up_s", 0.0), get(model, "motor_lag", "tau_down_s", 0.0)
    return {"commands": {"input": model.vehicle.input, "terms": commands(model, True).as_dict()},
            "wind_m_s": get(model, "wind", "w_m_s", (0.0, 0.0, 0.0)), "rotors_lag": max(lags) > 0.0}


def write_rotorpy(model: Model, folder: Path, assumed: Assumed | None = None) -> Exported:
    """rotorpy_params.json, for the adapter, and rotorpy_params.py, to import ``quad_params`` from."""
    made, about = quad_params(model, assumed)
    beside = {"schema": SCHEMA, **commands_beside(model),
              "exact": about.exact, "approximated": about.approximated, "left_out": about.left_out,
              "assumed": about.assumed}
    folder = Path(folder)
    paths = folder / "rotorpy_params.json", folder / "rotorpy_params.py"
    write_bytes(paths[0], to_text({**made, "nanobench": beside}).encode())
    write_bytes(paths[1], _module(made, about, command_lines(model, made["k_eta"])).encode())
    return Exported(paths, about)


def _module(made: dict[str, Any], about: Account, lines: list[str]) -> str:
    """Python source of the parameters, arrays where RotorPy wants them."""
    comment = "\n".join(("Parameters of a vehicle for RotorPy: Multirotor(quad_params).", "", *lines, "",
                         *about.lines())).replace("\\", "").replace('"""', "'''")
    body = []
    for key, value in made.items():
        if key == "rotor_pos":
            inner = "".join(f"        {name!r}: np.array({p!r}),\n" for name, p in value.items())
            body.append(f"    {key!r}: {{\n{inner}    }},\n")
        else:
            written = f"np.array({value!r})" if isinstance(value, list) else repr(value)
            body.append(f"    {key!r}: {written},\n")
    return f'"""{comment}\n"""\n\nimport numpy as np\n\nquad_params = {{\n{"".join(body)}}}\n'
