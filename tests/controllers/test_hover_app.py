"""The predictive controller about hover: its program against other solvers, its C against its Python, its refusals."""

import ctypes
import struct
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hover_library import Twins, built, needs_compiler, stepped
from scipy.linalg import cholesky, solve_discrete_are, solve_triangular
from scipy.optimize import lsq_linear

from controllers.mpc.casadi_code import Call
from controllers.mpc.hover_app import cost, write_app
from controllers.mpc.hover_mpc import ERRORS, STEP_S, TOLERATED_INTEGRAL, HoverMpc
from controllers.mpc.prediction_model import Equations4, default_model, stages_function
from controllers.mpc.predictive_base import Weights, about_hover
from controllers.plants.ensemble import draw, shipped_simulator
from controllers.plants.served_vehicle import served
from controllers.plants.simulated_flights import flown
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.motor_output import MotorOutput
from nanobench_tools.firmware.records import WRENCH
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.physics.model import Model
from nanobench_tools.protocols.simulated import Paths, specs_of
from nanobench_tools.radio.crtp import Packet
from nanobench_tools.radio.simulated.onboard_services import Build, Onboard

pytestmark = pytest.mark.skipif(needs_compiler, reason="NO C COMPILER OR MAKE: the exported controller is not tested")
STUB = Path(__file__).parents[1] / "firmware_stub"
STRICT = ["-std=c11", "-Wall", "-Wextra", "-Werror", "-Wdouble-promotion", "-Wfloat-conversion"]
FLOAT = ["-DDAQP_SINGLE_PRECISION", "-DDAQP_NO_SOFT_WEIGHTS", "-fsingle-precision-constant"]
REST = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
HERE = np.array([0.0, 0.0, 1.0, *[0.0] * 10])
FREE, BOUNDED, CLIPPED, SINKING = range(4)
WITHIN = 1e-3
"""Of the range of a command: what C and Python may differ by."""


@pytest.fixture(scope="module")
def app(tmp_path_factory):
    folder = tmp_path_factory.mktemp("app")
    write_app(default_model(), folder)
    return folder


@pytest.fixture(scope="module")
def library(app):
    return built(app)


@pytest.fixture(scope="module")
def controller():
    made = HoverMpc()
    made.reset(1)
    return made


def compiled(app, out, *arguments):
    """Compiles the exported sources with the stub and more."""
    sources = [str(app / "src" / name) for name in ("out_of_tree_controller.c", "hover_mpc.c", "daqp_float.c")]
    headers = out.parent / "headers"
    headers.mkdir(exist_ok=True)
    for name in ("FreeRTOS", "app", "controller", "controller_pid", "log", "pm", "stabilizer_types", "task"):
        (headers / f"{name}.h").write_text('#include "firmware_stub.h"\n')
    subprocess.run(["cc", *STRICT, *FLOAT, f"-I{STUB}", f"-I{headers}", f"-I{app / 'src'}", *sources,
                    str(STUB / "stub_vehicle.c"), *arguments, "-lm", "-o", str(out)], check=True)


def test_without_bounds_it_is_the_regulator(controller):
    model = default_model()
    hover_N = 0.25 * Equations4(model).mass_kg * 9.81
    a, b = np.eye(ERRORS + 4), np.zeros((ERRORS + 4, 4))
    a[:ERRORS, :ERRORS], b[:ERRORS] = about_hover(Call(stages_function(model, 1, STEP_S, ERRORS)), hover_N, ERRORS)
    for k, error in enumerate((0, 1, 2, 8)):
        a[ERRORS + k, error] = STEP_S
    level, up, heading = TOLERATED_INTEGRAL
    q = np.diag([*Weights().of_errors(ERRORS), *1.0 / np.square([level, level, up, heading])])
    r = Weights().of_inputs(model)
    p = solve_discrete_are(a, b, q + 1e-9 * np.eye(len(q)), r)
    gain = np.linalg.solve(r + b.T @ p @ b, b.T @ p @ a)
    assert -0.1 * controller.program.free[:4] == pytest.approx(gain, rel=1e-5, abs=1e-7)


def test_within_bounds_it_is_the_optimum(controller):
    program, factor = controller.program, cholesky(controller.program.h)
    bounded = 0
    for e in np.random.default_rng(1).standard_normal((20, ERRORS + 4)) * 0.05:
        low, high = np.full(4, -0.6), np.full(4, 0.4)
        right = -solve_triangular(factor, program.f @ e, trans="T")
        best = lsq_linear(factor, right, (np.tile(low, 10), np.tile(high, 10)), tol=1e-12, max_iter=1000).x
        controller.counts = {"bounded": 0, "solver": 0}
        z = controller._solve(e, low, high)
        if controller.counts["solver"] == 0:
            assert z == pytest.approx(best[:4], abs=1e-5)
            bounded += controller.counts["bounded"]
    assert bounded > 5


def flight(library, family, speed_m_s, seconds):
    paths = Paths(tuple(specs_of([family], [speed_m_s], seconds)))
    twins = Twins(library)
    found = flown(twins, paths, draw(shipped_simulator(), 1, 0, None, 0.0))
    goal = paths.all[0][:len(found.position_m), 0]
    return twins, np.linalg.norm(found.position_m[:, 0] - goal, axis=1)


def test_c_flies_a_path_as_python_commands(library):
    twins, error_m = flight(library, "figure_eight", 0.5, 2.5)
    assert len(twins.wrenches) > 2000
    assert twins.differences().max() < WITHIN
    assert np.sqrt(np.mean(error_m[300:] ** 2)) < 0.05


@pytest.mark.slow
def test_c_commands_as_python_where_motors_are_at_their_bounds_and_in_a_long_flight(library):
    for family, speed, seconds, least in (("random_waypoints", 1.0, 8.0, 50), ("figure_eight", 0.5, 30.0, 0)):
        twins, _ = flight(library, family, speed, seconds)
        assert twins.differences().max() < WITHIN
        assert np.count_nonzero(np.array(twins.outcomes) == BOUNDED) >= least


def test_random_inputs_are_answered_as_in_python(library, controller):
    """Far outside of flights: most answers are bounded, some are clipped."""
    rng, outcomes, wrenches = np.random.default_rng(4), [], []
    for _ in range(400):
        now, goal = REST + 0.3 * rng.standard_normal(13), HERE + 0.3 * rng.standard_normal(13)
        now[6:10] /= np.linalg.norm(now[6:10])
        goal[10:] = 0.0  # Python is given a jerk, which makes them
        now, goal = now.astype(np.float32).astype(float), goal.astype(np.float32).astype(float)
        library.hover_mpc_reset()
        controller.reset(1)
        outcome, wrench = stepped(library, now, goal, 3.8)
        controller.command(0.0, VehicleState(now[None, :3], now[None, 3:6], now[None, 6:10], now[None, 10:],
                                             np.array([3.8])),
                           Reference(goal[None, :3], goal[9:10], goal[None, 3:6], goal[None, 6:9]))
        outcomes.append(outcome)
        wrenches.append((wrench, [*controller._wrench["thrust_N"], *controller._wrench["torque_N_m"][0]]))
    c, python = np.array(wrenches, float).swapaxes(0, 1)
    assert np.count_nonzero(np.array(outcomes) == BOUNDED) > 100
    assert (np.abs(c - python) / np.ptp(python, axis=0)).max() < WITHIN


def test_invalid_inputs_are_bridged_then_it_sinks_level(library):
    hover_N = 0.04085 * 9.81 / HoverMpc().vehicle.thrust_scale
    for bad in (np.nan, np.inf, -np.inf, 1e30):
        for k in range(13):
            library.hover_mpc_reset()
            good = [stepped(library, REST, HERE, 3.8)[1] for _ in range(3)][-1]
            state, goal = REST.copy(), HERE.copy()
            state[k] = goal[k] = bad
            answers = [stepped(library, state, HERE, 3.8) for _ in range(60)]
            assert answers[0][0] != SINKING
            assert answers[0][1] == pytest.approx(good, abs=0.02)
            assert answers[-1][0] == SINKING
            assert answers[-1][1] == pytest.approx([0.9 * hover_N, 0.0, 0.0, 0.0], rel=1e-4)
            outcome, wrench = stepped(library, REST, goal, 3.8)
            assert outcome != SINKING
            assert np.isfinite(wrench).all()
        library.hover_mpc_reset()
        assert np.isfinite(stepped(library, REST, np.full(13, bad), bad)[1]).all()
        library.hover_mpc_reset()
        assert stepped(library, np.full(13, bad), HERE, 3.8)[0] == SINKING  # there never was a valid one


MAIN = r"""
#include <stdio.h>
#include "hover_mpc.h"
int main(void) {
    float in[27], out[4];
    hover_mpc_reset();
    while (fread(in, sizeof in, 1, stdin) == 1) {
        hover_mpc_step((const HoverMpcState *)in, (const HoverMpcReference *)(in + 13), in[26], out);
        fwrite(out, sizeof out, 1, stdout);
    }
    return 0;
}
"""


@pytest.mark.slow
def test_sanitizers_find_no_fault(app, library, tmp_path):
    (tmp_path / "main.c").write_text(MAIN)
    compiled(app, tmp_path / "sane", str(tmp_path / "main.c"), "-g", "-O1", "-fsanitize=address,undefined",
             "-fno-sanitize-recover=all")
    rng = np.random.default_rng(3)
    rows = np.hstack([REST, HERE, 3.8]) + rng.standard_normal((600, 27)) * rng.choice([0.02, 0.3, 3.0], (600, 1))
    rows[rng.random(rows.shape) < 0.002] = np.nan
    rows = rows.astype(np.float32)
    ran = subprocess.run([tmp_path / "sane"], input=rows.tobytes(), capture_output=True, check=True)
    assert ran.stderr == b""
    found = np.frombuffer(ran.stdout, np.float32).reshape(-1, 4)
    library.hover_mpc_reset()
    other = np.array([stepped(library, row[:13], row[13:26], row[26])[1] for row in rows])
    assert np.isfinite(found).all()
    assert found == pytest.approx(other, rel=1e-3, abs=1e-4)


class Stub:
    """The controller within the interface of the firmware."""

    def __init__(self, app, folder):
        compiled(app, folder / "libstub.so", "-shared", "-fPIC", "-O2")
        self._library = ctypes.CDLL(str(folder / "libstub.so"))
        self._library.stub_step.argtypes = [ctypes.c_uint32, *[ctypes.c_void_p] * 3, ctypes.c_float, ctypes.c_void_p]
        self._library.controllerOutOfTreeInit()

    def step(self, step, estimate, goal, modes, volts):
        """Wrench (4,), or None where the PID controller was asked."""
        estimate, goal, modes = np.asarray(estimate, np.float32), np.asarray(goal, np.float32), np.array(modes, np.intc)
        out = np.zeros(4, np.float32)
        handed = self._library.stub_step(step, estimate.ctypes.data, goal.ctypes.data, modes.ctypes.data, volts,
                                         out.ctypes.data)
        return None if handed else out


def test_it_hands_over_what_it_does_not_fly(app, tmp_path):
    stub = Stub(app, tmp_path)
    goal = [*HERE, 0.0, 0.0, np.sin(0.25), np.cos(0.25)]
    turned = [*REST[:6], 0.0, 0.0, np.sin(0.25), np.cos(0.25), *REST[10:]]
    for modes in ([1, 1, 1, 0, 0], [0, 0, 1, 1, 0], [2, 2, 1, 1, 0], [1, 1, 0, 1, 0], [1, 1, 1, 2, 0], [0] * 5):
        assert stub.step(2, REST, goal, modes, 3.8) is None
    assert stub.step(3, REST, goal, [1, 1, 1, 1, 0], 3.8) is None  # its own first command comes in the next step
    first = stub.step(4, REST, goal, [1, 1, 1, 1, 0], 3.8)
    assert stub.step(5, REST + 1.0, goal, [1, 1, 1, 1, 0], 3.8).tolist() == first.tolist()  # held
    assert stub.step(6, turned, goal, [1, 1, 1, 0, 1], 3.8) == pytest.approx(first, abs=1e-4)  # heading of a quaternion


def test_it_flies_the_served_vehicle_as_python_commands(app, tmp_path):
    """Estimates, set-points of the high-level commander, battery and motors are those of the served vehicle."""
    stub, python = Stub(app, tmp_path), HoverMpc()
    vehicle = served()
    onboard = Onboard(vehicle, Build(positioning=True))
    onboard.advance(2000)
    motors, wrench = MotorOutput(1, 0.001), np.zeros(1, WRENCH)
    python.reset(1)
    loop, found = vehicle.stabilizer.loop, []
    for packet, seconds in ((struct.pack("<BBff?f", 7, 0, 1.0, 0.0, False, 1.0), 1.5),
                            (struct.pack("<BB?fffff", 4, 0, False, 0.3, -0.2, 1.2, 0.5, 1.0), 2.0)):
        onboard.receive(Packet(8, 0, packet))
        for _ in range(round(1000 * seconds)):
            e, s, step = loop["estimate"][0], vehicle.stabilizer.setpoint[0], int(loop["step"][0]) + 1
            volts = float(loop["vbat_V"][0])
            goal = [*s["position_m"], *s["velocity_m_s"], *s["acceleration_m_s2"], s["attitude_deg"][2],
                    *s["rate_deg_s"], 0.0, 0.0, 0.0, 1.0]
            modes = [s[f"mode_{name}"] for name in ("x", "y", "z", "yaw", "quat")]
            seen = [*e["position_m"], *e["velocity_m_s"], *e["quaternion"], *e["gyro_deg_s"]]
            command = stub.step(step, seen, goal, modes, volts)
            if command is not None:
                if step % 2 == 0:
                    state = VehicleState(*(np.array([part], float) for part in (
                        seen[:3], seen[3:6], seen[6:10], np.radians(seen[10:]))), np.array([volts]))
                    push = s["acceleration_m_s2"].astype(float) + np.array([0.0, 0.0, 9.81])
                    # Python is told how fast the heading turns, the firmware the rate about the body's z
                    turn = np.radians(s["rate_deg_s"][2:3].astype(float)) * np.linalg.norm(push) / push[2]
                    python.command(0.0, state, Reference(*(np.array([part], float) for part in (
                        goal[:3], np.radians(goal[9]), goal[3:6], goal[6:9], s["jerk_m_s3"])), turn))
                    found.append((command, [*python._wrench["thrust_N"], *python._wrench["torque_N_m"][0]]))
                wrench["thrust_N"], wrench["torque_N_m"] = command[0], command[1:]
                counts = motors(wrench, np.array([volts])) * 65535.0
                loop["direct"][0], loop["override"] = np.rint(counts[0]), 1
            onboard.advance(onboard.tick_ms + 1)
    c, own = np.array(found, float).swapaxes(0, 1)
    assert len(found) > 1000
    assert (np.abs(c - own) / np.ptp(own, axis=0)).max() < WITHIN
    assert vehicle.true_pose()[0] == pytest.approx([0.3, -0.2, 1.2], abs=0.05)


def test_the_estimate_of_its_cost_by_hand(app):
    # outside the program 170; 4 unknowns of 20 errors and two bounds; 10 entries of the triangle, 4 of the step; answer
    assert cost(1, 4).multiply_adds == 170 + 4 * 22 + 10 + 4 + 16
    assert cost(2, 4).multiply_adds - cost(1, 4).multiply_adds == 10 + 4 + 7
    assert f"| 0 | {cost(0, 40).multiply_adds} |" in (app / "README.md").read_text()


def test_what_cannot_be_exported_is_refused(tmp_path):
    model = default_model()
    turned = Model(replace(model.vehicle, spin=(1.0, -1.0, 1.0, -1.0)), {t.name: model.values_of(t.name)
                                                                         for t in model.terms})
    with pytest.raises(InputError, match="not in the order of the Crazyflie"):
        write_app(turned, tmp_path)
    with pytest.raises(InputError, match="cannot turn it about all axes"):
        write_app(model.without("yaw_torque"), tmp_path)
    assert not list(tmp_path.iterdir())
