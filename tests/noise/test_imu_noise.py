"""Noise of an IMU: published Allan deviations, simulated sensors of known noise, the file that estimators read."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from estimators.error_state_ekf import ErrorStateEkf
from estimators.imu_noise import ImuNoise, packet_rate_hz, read_imu_noise, reckon_with
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.flight import Flight, Provenance, Span, make_stream
from nanobench_tools.noise.inflight import InFlight
from nanobench_tools.noise.rest import at_rest, overlapping_allan

IMU = ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")
MOTORS = ("m1", "m2", "m3", "m4")
MOCAP = ("px", "py", "pz", "qx", "qy", "qz", "qw", "vx", "vy", "vz")

NBS14 = np.array([892.0, 809.0, 823.0, 798.0, 671.0, 644.0, 883.0, 903.0, 677.0])
"""Frequency values of NIST SP 1065, table 28; its table 29 holds the deviations."""


def flight_of(t, imu, motor, mocap=None):
    streams = {"imu": make_stream("imu", t, imu, IMU),
               "motor": make_stream("motor", t, np.tile(motor, (len(t), 4)), MOTORS)}
    if mocap is not None:
        streams["mocap"] = make_stream("mocap", t, mocap, MOCAP)
    return Flight("made", streams, {}, Provenance("made", "", "test", synthetic=True))


def test_allan_deviation_of_the_published_data_set():
    found = [np.sqrt(overlapping_allan(NBS14[:, None], m)[0][0]) for m in (1, 2)]
    assert found == pytest.approx([91.22945, 85.95287], abs=1e-5)


def test_allan_deviation_equals_that_of_allantools():
    import allantools

    x = np.random.default_rng(0).normal(size=1000)
    _, theirs, _, _ = allantools.oadev(x, rate=100.0, data_type="freq", taus=np.array([0.01, 0.1, 0.5]))
    ours = [np.sqrt(overlapping_allan(x[:, None], m)[0][0]) for m in (1, 10, 50)]
    assert ours == pytest.approx(theirs, rel=1e-9)


def test_white_noise_at_rest_is_found_and_interpolated_rows_do_not_hide_it():
    """Rows drawn between packets at half the rate scatter less; the density of what they were drawn from is found."""
    rng = np.random.default_rng(1)
    t = np.arange(0.0, 200.0, 0.01)
    density = np.array([0.002] * 3 + [0.0003] * 3)
    packets = np.arange(0.0, 200.01, 0.02)
    sent = rng.normal(size=(len(packets), 6)) * density * np.sqrt(50.0)
    rows = np.stack([np.interp(t, packets, column) for column in sent.T], axis=1)
    assert rows.std() < 0.9 * sent.std()
    rows[:, 2] += 9.81
    rest = at_rest([flight_of(t, rows, 0.0)])
    assert rest.acc_density == pytest.approx(density[:3], rel=0.1)
    assert rest.gyro_density == pytest.approx(density[3:], rel=0.1)


def test_a_wandering_bias_has_a_floor():
    rng = np.random.default_rng(2)
    t = np.arange(0.0, 300.0, 0.01)
    walk = np.cumsum(rng.normal(size=(len(t), 6)), axis=0) * 1e-4 * 0.1
    rest = at_rest([flight_of(t, walk + 0.01 * rng.normal(size=(len(t), 6)), 0.0)])
    assert np.isfinite(rest.acc_instability).all()
    assert at_rest([flight_of(t, walk, 0.6)]) is None


def test_noise_in_flight_is_found_against_poses():
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 120.0, 0.01)
    rotation = Rotation.from_rotvec(np.outer(0.3 * t, [0.0, 0.0, 1.0]))
    gyro_density, acc_density = 0.01, 0.02
    imu = np.column_stack([np.tile([0.0, 0.0, 9.81], (len(t), 1)), np.tile([0.0, 0.0, 0.3], (len(t), 1))])
    imu[:, :3] += rng.normal(size=(len(t), 3)) * acc_density * 10.0
    imu[:, 3:] += rng.normal(size=(len(t), 3)) * gyro_density * 10.0 + [0.01, -0.01, 0.02]
    mocap = np.column_stack([np.zeros((len(t), 3)), rotation.as_quat(), np.zeros((len(t), 3))])
    flown = InFlight()
    flown.add(flight_of(t, imu, 0.6, mocap), [Span(0.0, 120.0)])
    gyro, acc, *_ = flown.densities()
    assert gyro == pytest.approx(gyro_density, rel=0.2)
    assert acc == pytest.approx(acc_density, rel=0.3)
    assert flown.gyro_bias[0] == pytest.approx([0.01, -0.01, 0.02], abs=0.003)
    row = flown.by_pwm()[0]
    assert row["pwm"] == pytest.approx(0.6, abs=0.05)
    assert row["acc_sd_m_s2"] == pytest.approx([acc_density * 10.0] * 3, rel=0.1)


def test_file_and_back(tmp_path):
    noise = ImuNoise(gyro_rad_s_sqrtHz=0.012, acc_walk_m_s3_sqrtHz=0.003, stamp_s_sqrtHz=0.004)
    path = tmp_path / "imu_noise.toml"
    path.write_text(noise.to_toml("made by hand\ntwice"), "utf-8")
    assert read_imu_noise(path) == noise


@pytest.mark.parametrize(("text", "match"), [
    ("x = [", "cannot be read"), ('schema = "other"', "schema"), ('schema = "nanobench-imu-noise/1"', "no table"),
    ('schema = "nanobench-imu-noise/1"\n[imu]\ngiro = 1.0', "unknown key"),
    ('schema = "nanobench-imu-noise/1"\n[imu]\nacc_m_s2_sqrtHz = -1.0', "positive number"),
    ('schema = "nanobench-imu-noise/1"\n[imu]\nacc_m_s2_sqrtHz = "much"', "positive number")])
def test_a_bad_file_is_one_line(tmp_path, text, match):
    path = tmp_path / "imu_noise.toml"
    path.write_text(text, "utf-8")
    with pytest.raises(InputError, match=match) as error:
        read_imu_noise(path)
    assert "\n" not in str(error.value)


def test_fewer_packets_are_noisier():
    noise = ImuNoise(rate_hz=100.0).at_rate(25.0)
    assert noise.gyro_rad_s_sqrtHz == pytest.approx(2.0 * ImuNoise().gyro_rad_s_sqrtHz)
    assert noise.gyro_walk_rad_s2_sqrtHz == ImuNoise().gyro_walk_rad_s2_sqrtHz
    assert ImuNoise().at_rate(float("nan")) == ImuNoise()
    t = np.arange(0.0, 10.0, 0.01)
    half = make_stream("imu", t, np.zeros((len(t), 6)), IMU, samples=500)
    assert packet_rate_hz(half) == pytest.approx(50.0, rel=0.01)


def test_estimators_take_it():
    method = ErrorStateEkf()
    reckon_with(method, ImuNoise(gyro_rad_s_sqrtHz=0.5))
    assert method.settings["gyro_noise"] == 0.5
    assert ErrorStateEkf.settings.get("gyro_noise") != 0.5
    with pytest.raises(UsageError, match="takes no noise"):
        reckon_with(object(), ImuNoise())


def test_estimate_refuses_a_noise_that_nobody_takes(tmp_path, capsys):
    path = tmp_path / "imu_noise.toml"
    path.write_text(ImuNoise().to_toml(), "utf-8")
    assert main(["estimate", "--protocol", "aided", "--imu-noise", str(path)]) == 2
    assert "--imu-noise goes with --method" in capsys.readouterr().err
    assert main(["estimate", "--method", "hold_position", "--imu-noise", str(path)]) == 2
    assert "hold_position" in capsys.readouterr().err


@pytest.mark.real
@pytest.mark.slow
def test_real_recording(real_data, tmp_path, capsys):
    where = sorted((real_data / "nanobench").rglob("B9_trefoil_slow_rep3*.xz"))[:1]
    assert main(["noise", "--data", str(where[0]), "--out", str(tmp_path), "--quiet"]) == 0
    noise = read_imu_noise(tmp_path / "imu_noise.toml")
    assert 1e-4 < noise.gyro_rad_s_sqrtHz < 0.1
    assert 1e-3 < noise.acc_m_s2_sqrtHz < 0.3
    assert capsys.readouterr().out == ""
