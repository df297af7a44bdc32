"""Practice flights as recordings: repeatable, independent of each other, labelled, and the same after a round trip."""

import numpy as np
import pytest

from nanobench_tools.errors import UsageError
from nanobench_tools.flight import STREAM_QUANTITIES
from nanobench_tools.lookup.registry import load
from nanobench_tools.methods import Controller
from nanobench_tools.practice import fly, path_spec, practice_flight, practice_flights
from nanobench_tools.practice.onboard_crowd import OnboardFleet
from nanobench_tools.practice.timeline import Events
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.sources.nanobench import write_nanobench
from nanobench_tools.sources.nanobench_columns import COLUMNS

SHORT = Events(0.4, 1.6, 2.6, 3.0, 3.4)
"""A flight of 3.4 s that hardly leaves the ground: enough where only equality counts."""


@pytest.mark.slow
def test_the_same_seed_gives_the_same_bits_and_another_seed_does_not():
    spec = [path_spec("circle", duration_s=1.0)]
    row = load("controllers", "onboard_pid")()
    assert isinstance(row, Controller)
    a, b, c = (fly(controller, spec, seed=s, events=[SHORT])
               for controller, s in ((OnboardFleet(["pid"]), 1), (row, 1), (row, 2)))
    for name in a.messages:
        np.testing.assert_array_equal(a.messages[name], b.messages[name])  # the registered row is the same cascade
    assert not np.array_equal(a.messages["imu"], c.messages["imu"])


@pytest.mark.slow
def test_a_flight_does_not_depend_on_its_neighbours(practice):
    third = practice[2]
    assert third.metadata["practice"]["controller"] == "mellinger"
    alone = practice_flight(9, "circle", "fast", controller="mellinger", index=2, duration_s=4.0)
    assert alone.name == third.name
    for name, stream in third.streams.items():
        np.testing.assert_array_equal(stream.values, alone[name].values, err_msg=name)
        np.testing.assert_array_equal(stream.time_s, alone[name].time_s)
        assert stream.samples == alone[name].samples


def test_all_columns_are_there_in_the_vocabulary(practice):
    flight = practice[0]
    assert set(flight.streams) == {c.stream for c in COLUMNS}
    for name, stream in flight.streams.items():
        assert stream.quantities == tuple(c.quantity for c in COLUMNS if c.stream == name)
        assert stream.unit == tuple(STREAM_QUANTITIES[name][q][0] for q in stream.quantities)
        assert np.isfinite(stream.values).all()
        assert len(stream) == len(flight["mocap"])
    np.testing.assert_allclose(np.linalg.norm(flight["mocap"]["qx", "qy", "qz", "qw"], axis=1), 1.0, atol=1e-7)
    live = flight["attitude_qw"].time_s < flight.span.end_s - 0.5
    assert np.abs(np.linalg.norm(flight["attitude_qw"]["qx", "qy", "qz", "qw"], axis=1)[live] - 1.0).max() < 1e-3


def test_it_flies(practice):
    for flight in practice:
        pid = flight.metadata["practice"]["controller"] == "pid"
        z, t = flight["mocap"]["pz"], flight["mocap"].time_s
        lift = t[np.argmax(z > z[0] + 0.05)] - t[np.argmax(flight["motor"]["m1"] > 0.02)]
        assert (0.9 < lift < 1.8) if pid else (0.4 < lift < 1.0)
        assert 0.75 < np.median(z[(t > 5.0) & (t < 9.0)]) < 1.25
        assert np.ptp(z[-100:]) < 0.001
        speed = np.linalg.norm(flight["mocap"]["vx", "vy", "vz"], axis=1)
        assert 0.3 < speed[(t > 6.5) & (t < 9.0)].mean() < 1.5
        quiet = flight["pid"]
        if pid:
            assert quiet["cmd_thrust"].max() > 0.7
        else:
            assert not quiet["roll", "pitch", "cmd_thrust"].any()
            assert np.ptp(quiet["yaw"]) == 0.0


def test_accelerometer_and_attitude_agree_on_gravity_at_rest(practice):
    for flight in practice:
        rest = flight["imu"].time_s < 1.5
        acc = flight["imu"]["acc_x", "acc_y", "acc_z"][rest].mean(axis=0)
        roll, pitch = (flight["attitude"][name][rest].mean() for name in ("roll", "pitch"))
        np.testing.assert_allclose(acc, 9.81 * np.array([-np.sin(pitch), np.sin(roll), 1.0]), atol=0.2)
        tilt = np.linalg.norm(flight.metadata["practice"]["tilt_rad"])
        assert np.radians(1.0) < tilt < np.radians(3.0)
        mocap = flight["mocap"]["roll", "pitch"][rest].mean(axis=0)
        assert np.hypot(*(mocap - [roll, pitch])) == pytest.approx(tilt, abs=0.01)


def test_written_and_read_again_it_is_the_same_and_synthetic(practice, tmp_path):
    for flight in practice:
        write_nanobench(flight, tmp_path / f"{flight.name}.csv.gz")
    loaded = load_recordings([tmp_path], cache=False)
    assert not loaded.failed
    again = {int(f.epoch_s): f for f in loaded.flights}
    for flight in practice:
        read = again[int(flight.epoch_s)]
        assert read.provenance.synthetic
        assert not read.provenance.findings
        for key in ("family", "speed", "reference_speed_m_s", "duration_s"):
            assert read.metadata[key] == flight.metadata[key], key
        for name, stream in flight.streams.items():
            np.testing.assert_allclose(read[name].values, stream.values, atol=1e-8, err_msg=name)
            np.testing.assert_allclose(read[name].time_s, stream.time_s, atol=1e-6)
            assert read[name].samples == stream.samples, name


class Wrong:
    name, information, period_s = "wrong", "as flown", 0.002

    def __init__(self, command):
        self.command = lambda time_s, state, reference: command(state)

    def reset(self, n):
        pass


@pytest.mark.parametrize(("controller", "says"), [
    (Wrong(lambda s: np.zeros(3)), r"returned shape \(3,\) for 1 vehicles"),
    (Wrong(lambda s: 1 / 0), "raised ZeroDivisionError at 0.000 s")])
def test_a_bad_controller_is_named(controller, says):
    with pytest.raises(UsageError, match=says):
        fly(controller, [path_spec("circle", duration_s=1.0)])


def test_a_bad_period_and_an_unknown_name_are_named():
    slow = Wrong(lambda s: np.zeros((1, 4)))
    slow.period_s = 0.003
    with pytest.raises(UsageError, match=r"multiple of 0\.002"):
        fly(slow, [path_spec("circle", duration_s=1.0)])
    with pytest.raises(UsageError, match="known: pid, mellinger"):
        practice_flights(1, controllers=("indi",))
