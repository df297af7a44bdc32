"""A made vehicle whose constants are known, simulated by code of its own, is found again."""

import numpy as np
import pytest
from made_logs import INERTIA, K_F, K_M, MASS, ROW_S, SLOPE, flight, fly
from scipy.integrate import solve_ivp

from identification.motors import lag
from identification.motors.motor_result import motor_result
from identification.motors.motor_study import hover, simulator
from identification.motors.rotor_rows import read_log
from nanobench_tools.api.identified_motors import Motors
from nanobench_tools.physics import Vehicle


@pytest.mark.slow
def test_time_constants_delay_and_thrust(study):
    assert study.best_lag == "up and down + delay"
    assert study.lag.tau_up_s == pytest.approx(0.05, abs=0.002)
    assert study.lag.tau_down_s == pytest.approx(0.11, abs=0.004)
    assert study.lag.delay_s == pytest.approx(2 * ROW_S, abs=0.0005)
    assert study.k_f == pytest.approx(K_F, rel=0.005)
    fast, slow = study.slopes
    assert fast == pytest.approx(SLOPE, rel=0.04)
    assert slow == pytest.approx(SLOPE, rel=0.04)


@pytest.mark.slow
def test_the_table_of_nb_motors_holds_the_constants_in_si(study):
    found = Motors(motor_result(study), study)
    truth = {"lag up": (0.05, "s"), "lag down": (0.11, "s"), "delay": (2 * ROW_S, "s"),
             "thrust over squared speed": (K_F, "N s²/rad²"), "J_x": (INERTIA[0], "kg m²")}
    for name, (value, unit) in truth.items():
        assert found.table.loc[name, "value"] == pytest.approx(value, rel=0.05), name
        assert found.table.loc[name, "unit"] == unit
    assert repr(found) == found.sentence
    assert len(repr(found)) < 200
    assert "tau_up_s" in found.to_toml()


@pytest.mark.slow
def test_a_simpler_lag_is_worse_on_flights_held_out(study):
    mean = {name: float(np.mean(rms)) for name, rms in study.lag_rms.items()}
    assert mean["at once"] > mean["one lag + delay"] > 1.2 * mean["up and down + delay"]
    assert mean["up and down + delay"] == pytest.approx(3.0, rel=0.2)  # the noise that was added


@pytest.mark.slow
def test_moments(study):
    found = motor_result(study).moments
    assert found.inertia_kg_m2["x"] == pytest.approx(INERTIA[0], rel=0.03)
    assert found.inertia_kg_m2["y"] == pytest.approx(INERTIA[1], rel=0.03)
    assert found.k_m_per_inertia_z.median == pytest.approx(K_M / INERTIA[2], rel=0.05)
    assert abs(found.reaction_per_inertia_z.median) < 2e-4  # the made rotors have no inertia
    assert found.explained["x"].median > 0.9
    assert found.gyro_behind_speed_s["x"].median == pytest.approx(-2 * ROW_S, abs=0.001)


@pytest.mark.slow
def test_fast_pwm_predicts_rotation_better_than_the_radio(study):
    rows = {row.input: row.metrics["roll_pitch_rate_mae_rad_s"] for row in motor_result(study).rows}
    assert rows["logged"]["10"] < 0.5 * rows["radio"]["10"] < 0.5 * rows["still"]["10"]
    gain = next(g for g in motor_result(study).gains if g.input == "logged" and g.h == 10
                and g.metric == "roll_pitch_rate_mae_rad_s")
    assert gain.less_percent == pytest.approx(100 * (1 - rows["logged"]["10"] / rows["radio"]["10"]))
    assert gain.ci95[0] <= gain.less_percent <= gain.ci95[1]
    assert len(repr(motor_result(study))) < 400


@pytest.mark.slow
def test_the_simulator_is_that_vehicle(study):
    model = simulator(study)
    assert model.values_of("motor_lag")["tau_down_s"] == study.lag.tau_down_s
    assert model.values_of("thrust_rpm")["k_f"] == study.k_f
    assert model.vehicle.mass_kg == MASS
    assert model.vehicle.inertia_kg_m2[:2] == pytest.approx(INERTIA[:2], rel=0.1)


def test_a_step_by_hand():
    """One motor steps up, then down: after a time constant 63 % of the way is done. Against scipy's integrator."""
    row, up, down = 0.002, 0.04, 0.08
    time_s = np.arange(1500) * row
    u = np.where((time_s % 1.0) < 0.5, 0.65, 0.6)
    low, high = 0.6 - 0.5, 0.65 - 0.5  # N, T = u - 0.5

    def slope(t, thrust):
        asked = high if (t % 1.0) < 0.5 else low
        return (asked - thrust) / np.where(asked > thrust, up, down)

    solved = solve_ivp(slope, (0.0, time_s[-1]), [low], t_eval=time_s, max_step=row, rtol=1e-8)
    after = solved.y[0, round(up / row)]
    assert (after - low) / (high - low) == pytest.approx(1.0 - np.exp(-1.0), abs=1e-3)
    speed = np.repeat(np.sqrt(solved.y[0] / K_F)[:, None], 4, axis=1)
    rng = np.random.default_rng(0)
    log = {"u": np.repeat(u[:, None], 4, axis=1), "speed": speed, "battery_V": 4.0 + 0.02 * np.sin(time_s),
           "rate": 0.2 * rng.normal(size=(1500, 3)), "force_z": 9.81 + np.zeros(1500),
           "position": np.zeros((1500, 3)), "velocity": np.ones((1500, 3)),
           "quaternion": np.tile([0, 0, 0, 1.0], (1500, 1))}
    made = read_log(flight(log, row_s=row))
    made.battery_V[:] = 4.0
    found = lag.fit_lag(hover([made], Vehicle(mass_kg=0.035)), lag.windows_of([made]), row)
    assert (found.tau_up_s, found.tau_down_s) == pytest.approx((up, down), rel=0.04)
    assert found.delay_s == pytest.approx(0.0, abs=5e-4)


def test_equal_constants_are_found_equal(few_inputs):
    log = read_log(flight(fly(1, seconds=3.0, up_s=0.04, down_s=0.04, late_rows=0, seed=3)[0]))
    found = lag.fit_lag(hover([log], Vehicle(mass_kg=MASS)), lag.windows_of([log]), log.row_s)
    assert (found.tau_up_s, found.tau_down_s) == pytest.approx((0.04, 0.04), rel=0.02)
