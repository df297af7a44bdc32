"""``mpc_hover`` as C: a folder that builds within the Crazyflie firmware's tree, and alone on the host.

The files of ``firmware_app`` are copied; ``vehicle_parameters.h`` and ``hover_program.h`` are written for a model, the
README with an estimate of its cost.
"""

from pathlib import Path

import numpy as np

from nanobench_tools.firmware.app_files import Operations, array, constant, header, write_folder
from nanobench_tools.firmware.motor_output import ARM_M, YAW_ARM_M
from nanobench_tools.firmware.thrust_curve import COEFFICIENTS, THRUST_MIN_N
from nanobench_tools.physics.export.account import Account, Exported
from nanobench_tools.physics.model import Model

from .condense import UNIT_N
from .hover_mpc import HORIZON, ITERATIONS, LEAST_MARGIN, LIMITS, PERIOD_S, STATES, HoverMpc

TARGET = "firmware-app"
FIXED = (170, 22, 12)
"""Multiply-adds, divisions and square roots, and trigonometric functions of a command outside the program, counted in
hover_mpc.c."""


def cost(iterations: int, unknowns: int = 4 * HORIZON) -> Operations:
    """Of a command after so many ``iterations`` of the solver, each of which adds a bound.

    By the loops of hover_mpc.c and DAQP: the answer without bounds, iterations and the answer within bounds. An
    iteration scans all bounds, adds a row to the factor, and finds multipliers and the step.
    """
    n, found = unknowns, FIXED[0] + unknowns * (STATES + 2)
    for active in range(iterations):
        found += n * (n + 1) // 2 + n + active * (n + active + 2)
    return Operations(found + (4 * n if iterations else 0), FIXED[1] + 4 * iterations + sum(range(iterations)),
                      FIXED[2])


def costs(unknowns: int = 4 * HORIZON) -> dict[int, Operations]:
    """By iterations: of a command that meets no bound, of one with one iteration, and the most there can be."""
    return {iterations: cost(iterations, unknowns) for iterations in (0, 1, ITERATIONS - 1)}


def write_app(model: Model, folder: Path | str) -> Exported:
    """Writes the folder of a controller for ``model``. Raises InputError for a model that is not driven by PWM or
    cannot hover, MissingExtraError without casadi or daqp."""
    controller = HoverMpc(model)
    inverse, scale, free = controller.program.normalised()
    wide = len(inverse)
    floats = inverse[np.triu_indices(wide)].size + scale.size + free.size
    table = "\n".join(f"| {k} | {c.multiply_adds} | {c.cycles} | {c.milliseconds:.2f} |"
                      for k, c in costs(wide).items())
    headers = {"src/vehicle_parameters.h": _parameters(controller),
               "src/hover_program.h": _program(inverse, scale, free)}
    files = write_folder("controllers.mpc", "firmware_app", Path(folder), headers,
                         {"table": table, "table_bytes": str(4 * floats), "unknowns": str(wide)})
    return Exported(files, _account(model, controller))


def _account(model: Model, controller: HoverMpc) -> Account:
    terms = {term.name: term.equation for term in model.terms if term.name != "command_delay"}
    factor = f"one factor at hover, {controller.vehicle.thrust_scale:.3f} of the firmware's thrust curve"
    return Account(
        approximated={name: factor if name.startswith("thrust_") else f"linear about hover: {text}"
                      for name, text in terms.items()},
        left_out={"command_delay": "the controller is on board; its commands wait for no radio"}
        if "command_delay" in model else {})


def _parameters(controller: HoverMpc) -> str:
    v = controller.vehicle
    scalars = (
        ("HOVER_MPC_PERIOD_S", PERIOD_S, "s"),
        ("VEHICLE_MASS_KG", v.mass_kg, "kg"), ("VEHICLE_GRAVITY_M_S2", v.gravity_m_s2, "m/s^2"),
        ("VEHICLE_MOTOR_SHARE", v.motor_share,
         f"of a command that a rotor follows in a period; lag {v.motor_tau_s:.4g} s"),
        ("VEHICLE_THRUST_SCALE", v.thrust_scale, "thrust over what the firmware's curve promises, at hover"),
        ("FIRMWARE_LEAST_THRUST_N", LEAST_MARGIN * THRUST_MIN_N, "N of a motor; below it the firmware gives none"),
        ("FIRMWARE_ARM_M", float(ARM_M), "m, of a motor about x and y in the firmware's mixer"),
        ("FIRMWARE_YAW_ARM_M", float(YAW_ARM_M), "m, torque about z over thrust in the firmware's mixer"),
        ("LIMIT_LEVEL_M_S2", LIMITS[0], "m/s^2 that answer level errors"),
        ("LIMIT_UP_M_S2", LIMITS[1], "m/s^2 that answer vertical errors"),
        ("LIMIT_TURN_RAD", LIMITS[2], "rad of an error of attitude that are answered"))
    body = f"#define HOVER_MPC_RATE_HZ {round(1.0 / PERIOD_S)} /* Hz */\n"
    body += f"#define HOVER_MPC_PERIOD_MS {round(1e3 * PERIOD_S)} /* ms */\n"
    body += "".join(constant(*scalar) for scalar in scalars)
    body += array("VEHICLE_DRAG_1_S", v.drag_1_s, "1/s, drag over mass along the heading, across it and up")
    body += array("VEHICLE_AIR_N_S_M", v.air_N_s_m, "N s/m, thrusts that balance the moment of an air velocity")
    body += array("FIRMWARE_THRUST_N", np.array(COEFFICIENTS), "N/V^k, thrust of a motor by its voltage")
    body += array("LIMIT_POSITION_1_S2", v.position_1_s2, "1/s^2, acceleration that answers a position error")
    body += array("LIMIT_VELOCITY_1_S", v.velocity_1_s, "1/s, acceleration that answers a velocity error")
    body += array("LIMIT_INTEGRAL", v.most_integral, "m s of position x, y, z; rad s of heading")
    return header("VEHICLE_PARAMETERS_H", "The vehicle as the controller knows it, in SI units.", TARGET, body)


def _program(inverse: np.ndarray, scale: np.ndarray, free: np.ndarray) -> str:
    wide = len(inverse)
    body = (f"#define HOVER_MPC_UNKNOWNS {wide}\n#define HOVER_MPC_ERRORS {STATES}\n"
            f"#define HOVER_MPC_ITERATIONS {ITERATIONS}\n")
    body += array("PROGRAM_FREE", free, "answer without bounds per error, scaled")
    body += array("PROGRAM_SCALE", scale / UNIT_N, "1/N")
    body += array("PROGRAM_INVERSE", inverse[np.triu_indices(wide)], "upper triangle, by rows of length one")
    return header("HOVER_PROGRAM_H", "Predictive control about hover: the constant program.", TARGET, body)
