"""Every number the firmware computed, within the tolerances that come with the numbers."""

import functools

import numpy as np
import pytest
from firmware_tables import columns, read, replay

from nanobench_tools.firmware import lee, mellinger, motor_output, pid
from nanobench_tools.firmware.flatness import body_rates
from nanobench_tools.firmware.records import CONTROL, WRENCH

pytestmark = pytest.mark.real
MOTORS = ("m1", "m2", "m3", "m4")
table = functools.lru_cache(maxsize=2)(read)


def worst(found, told):
    return float(np.max(np.abs(np.asarray(found, float) - told)))


@pytest.mark.parametrize(("scenario", "rows"), [
    ("steps_from_ground", 5000), ("figure8_position_only", 4000), ("helix_yaw_wraps", 4000),
    ("star_corners_saturating", 4000), ("velocity_world_body_hover_mixed", 4200),
    ("attitude_rate_thrust_zero_resets", 3200), ("blocked_windup_then_free", 4000), ("full_state_quaternion_yaw", 1600),
    ("random_every_step", 1000), ("real_B3_figure8_fast_rep1", 15000)])
def test_pid_cascade(real_data, scenario, rows):
    told, out, state = replay(pid, table(real_data, "pid_controller.csv.xz"), scenario, CONTROL)
    assert len(out) == rows
    # nothing but the printed digits may differ: the arithmetic is that of the firmware
    np.testing.assert_array_equal(out["thrust"], told["out_thrust"].astype(np.float32))
    for name in ("roll", "pitch", "yaw"):
        np.testing.assert_array_equal(out[name], told[f"out_{name}"])
    assert worst(state["velocity_setpoint"], columns(told, "vel_sp_body_x", "vel_sp_body_y", "vel_sp_z")) < 1e-6
    angles = [f"att_des_{name}_deg" for name in ("roll", "pitch_legacy", "yaw")]
    assert worst(state["attitude_deg"], columns(told, *angles)) < 1e-4
    rates = [f"rate_des_{name}_dps" for name in ("roll", "pitch_legacy", "yaw")]
    assert worst(state["rate_deg_s"], columns(told, *rates)) < 1e-2
    integrals = columns(told, *(f"integ_{name}" for name in pid.LOOPS))
    assert worst(state["block"][:, :, pid.INTEGRAL], integrals) < 1e-5


@pytest.mark.parametrize(("scenario", "rows"), [
    ("position_only_steps", 3000), ("position_only_figure8", 2000), ("full_state_figure8_yaw", 2000),
    ("attitude_modes_and_reset", 2200), ("far_target_integrator_and_output_clamp", 1250), ("random_every_step", 1000),
    ("open_loop_real_B3_figure8_fast_rep1", 4000)])
def test_mellinger(real_data, scenario, rows):
    told, out, state = replay(mellinger, table(real_data, "mellinger.csv.xz"), scenario, CONTROL)
    assert len(out) == rows
    np.testing.assert_array_equal(out["thrust"], told["out_thrust"].astype(np.float32))
    for name in ("roll", "pitch", "yaw"):
        assert worst(out[name], told[f"out_{name}"]) <= 1
        assert np.mean(out[name] == told[f"out_{name}"]) > 0.995
    for field, names in (("z_wanted", ("z_des_x", "z_des_y", "z_des_z")),
                         ("integral", ("i_err_x", "i_err_y", "i_err_z")),
                         ("integral_m", ("i_err_m_x", "i_err_m_y", "i_err_m_z")),
                         ("rate", ("prev_omega_roll", "prev_omega_pitch")),
                         ("rate_setpoint", ("prev_sp_omega_roll", "prev_sp_omega_pitch"))):
        assert worst(state[field], columns(told, *names)) < 1e-6, field


@pytest.mark.parametrize(("scenario", "rows", "torque_N_m"), [
    ("position_only_steps", 2500, 1e-7), ("full_state_figure8_yaw", 1500, 1e-7),
    ("attitude_modes_and_cutoff", 900, 1e-7), ("random_every_step", 600, 5e-5)])
def test_lee(real_data, scenario, rows, torque_N_m):
    told, out, state = replay(lee, table(real_data, "lee.csv.xz"), scenario, WRENCH)
    assert len(out) == rows
    assert worst(out["thrust_N"], told["out_thrust_N"]) < 1e-6
    assert worst(out["torque_N_m"], columns(told, *(f"out_torque_{axis}_Nm" for axis in "xyz"))) < torque_N_m
    for j in range(3):
        assert worst(state["rotation"][:, :, j], columns(told, *(f"Rdes_{i}{j}" for i in range(3)))) < 1e-6
    for field, names in (("integral", "i_pos_"), ("integral_r", "i_att_"), ("rate", "omega_")):
        assert worst(state[field], columns(told, *(names + axis for axis in "xyz"))) < 1e-6, field
    wanted = columns(told, *(f"omega_r_{axis}" for axis in "xyz"))
    assert np.max(np.abs(state["rate_wanted"] - wanted) / (1.0 + np.abs(wanted))) < 1e-5


def test_parameters_are_those_the_running_code_held(real_data):
    told = table(real_data, "controller_parameters.csv")
    values = {(block, name): value for block, name, value in zip(*told.values(), strict=True)}
    block = dict(zip(("posX", "posY", "posZ", "velX", "velY", "velZ", "attRoll", "attPitch", "attYaw", "rateRoll",
                      "ratePitch", "rateYaw"), pid.defaults()[0]["block"], strict=True))
    keys = {"kp": pid.KP, "ki": pid.KI, "kd": pid.KD, "kff": pid.KFF, "integral_limit": pid.I_LIMIT, "dt": pid.DT,
            "output_limit": pid.OUT_LIMIT, "d_filter_enabled": pid.FILTERED}
    seen = 0
    for (group, name), value in values.items():
        if group == "mellinger":
            assert mellinger.defaults()[0][name] == np.float32(value), name
        elif group == "pid":
            key = {"thrustBase": "thrust_base", "thrustMin": "thrust_min"}[name]
            assert pid.defaults()[0][key] == value
        else:
            assert block[group.removeprefix("pid_")][keys[name]] == np.float32(value), (group, name)
        seen += 1
    assert seen == 117
    low_pass = table(real_data, "lpf2p_coefficients.csv")
    for fs, fc, *told_b in zip(*(low_pass[k] for k in ("fs_hz", "fc_hz", "b0", "b1", "b2", "a1", "a2")), strict=True):
        np.testing.assert_allclose(pid.low_pass(fs, fc), told_b, rtol=2e-6)


@pytest.mark.parametrize("signal", ["impulse", "step", "noise_plus_sine", "with_nan_inf"])
def test_low_pass_of_the_derivative(real_data, signal):
    told = table(real_data, "lpf2p_response.csv")
    rows = (told["filter"] == "pid_derivative_20Hz_at_100Hz") & (told["signal"] == signal)
    gains, memory = pid.defaults()[0]["block"][0], np.zeros(4, np.float32)
    found = [pid._filtered(gains, memory, value) for value in told["input"][rows].astype(np.float32)]
    assert rows.sum() >= 82
    np.testing.assert_allclose(found, told["output"][rows], atol=2e-5)


def test_legacy_mixer_and_cap(real_data):
    told = table(real_data, "power_distribution_legacy.csv")
    control, counts = np.zeros(len(told["thrust"]), CONTROL), np.zeros((len(told["thrust"]), 4), np.int32)
    for name in CONTROL.names:
        control[name] = told[name]
    for one, motor in zip(control, counts, strict=True):
        motor_output.mix_legacy(one, motor)
    np.testing.assert_array_equal(counts, columns(told, *(f"{m}_uncapped" for m in MOTORS)))
    for motor in counts:
        motor_output.cap(motor)
    np.testing.assert_array_equal(counts, columns(told, *MOTORS))
    told = table(real_data, "motor_cap.csv")
    counts = columns(told, *(f"{m}_in" for m in MOTORS)).astype(np.int32)
    for motor in counts:
        motor_output.cap(motor)
    np.testing.assert_array_equal(counts, columns(told, *MOTORS))


def test_force_torque_mixer(real_data):
    told = table(real_data, "power_distribution_force_torque.csv")
    wrench, counts = np.zeros(len(told["thrust_N"]), WRENCH), np.zeros((len(told["thrust_N"]), 4), np.int32)
    wrench["thrust_N"] = told["thrust_N"]
    wrench["torque_N_m"] = columns(told, *(f"torque_{axis}_Nm" for axis in "xyz"))
    for one, motor in zip(wrench, counts, strict=True):
        motor_output.mix_wrench(one, motor_output.BUILD[0], motor)
    np.testing.assert_array_equal(counts, columns(told, *(f"{m}_uncapped" for m in MOTORS)))


def test_battery_compensation(real_data):
    told = table(real_data, "battery_compensation.csv")
    command, volt = (told[name].astype(np.float32) for name in ("thrust_command", "supply_voltage_V"))
    found = motor_output.compensated(command, volt, *motor_output.BUILD[0])
    assert worst(found, told["pwm_float"]) < 0.05
    assert worst(found.astype(int), told["pwm_int"]) <= 1


def test_whole_motor_chain(real_data):
    told = table(real_data, "motor_chain.csv.xz")
    n = len(told["thrust"])
    control, counts = np.zeros(n, CONTROL), np.zeros((n, 1, 4), np.int32)
    filtered = np.full(1, motor_output.VOLTAGE_START_V)
    for name in CONTROL.names:
        control[name] = told[name]
    volt, voltage = told["vbat_V"].astype(np.float32), []
    for k in range(n):
        motor_output.drive_legacy(1, control[k:k + 1], volt[k:k + 1], filtered, motor_output.BUILD, counts[k])
        voltage.append(filtered[0])
    assert worst(np.array(voltage), told["filtered_voltage_V"]) < 1e-6
    assert worst(counts[:, 0], columns(told, *MOTORS)) <= 1
    assert np.mean(counts[:, 0] == columns(told, *MOTORS)) > 0.99


def test_body_rates_of_the_planner(real_data):
    told = table(real_data, "planner_samples.csv.xz")
    flying = told["planner_state"] == 1
    acceleration, jerk = columns(told, "ax", "ay", "az")[flying], columns(told, "jx", "jy", "jz")[flying]
    found = body_rates(acceleration, jerk, told["yaw_rad"][flying], np.zeros(flying.sum()))
    assert flying.sum() > 500
    assert worst(found[:, :2], columns(told, "omega_x", "omega_y")[flying]) < 5e-4
