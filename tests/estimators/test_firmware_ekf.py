"""The vehicle's filter run again on flights: how near it stays, and what it may not know."""

from dataclasses import replace
from importlib.metadata import entry_points

import numpy as np
import pytest

from estimators.firmware_ekf import FirmwareEkf
from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.protocols import blackout, task3


@pytest.fixture(scope="module")
def flight(crowd):
    return crowd.flight("slow trefoil")


def test_it_is_found_by_its_name():
    assert entry_points(group="nanobench.estimators")["firmware_ekf"].load() is FirmwareEkf


def test_with_all_poses_it_stays_near_the_truth(flight):
    found = FirmwareEkf().estimate(flight)
    mocap = flight["mocap"]
    at = np.searchsorted(mocap.time_s, found.time_s)
    assert len(found.time_s) > 0.95 * len(flight["imu"])
    assert np.sqrt(np.mean(np.sum((found.position_m - mocap["px", "py", "pz"][at]) ** 2, axis=1))) < 0.04
    turned = so3.geodesic_angle(found.quaternion, mocap["qx", "qy", "qz", "qw"][at])
    assert np.degrees(np.median(turned)) < 2.0
    assert np.median(np.linalg.norm(found.velocity_m_s - mocap["vx", "vy", "vz"][at], axis=1)) < 0.15


def test_nothing_later_leaks(flight):
    """IMU, poses and motors after t are noise: nothing at or before t changes."""
    rng = np.random.default_rng(3)
    bent = {}
    for name in ("imu", "mocap", "motor"):
        stream = flight[name]
        values, late = stream.values.copy(), stream.time_s > 12.0
        values[late] = rng.normal(0.0, 3.0, (np.sum(late), values.shape[1]))
        bent[name] = replace(stream, values=values)
    for method in (FirmwareEkf(), FirmwareEkf(held=True)):
        whole, other = method.estimate(flight), method.estimate(flight.with_streams(**bent))
        before = whole.time_s <= 12.0
        for field in ("position_m", "quaternion", "velocity_m_s"):
            assert np.array_equal(getattr(whole, field)[before], getattr(other, field)[before])
        assert np.abs(whole.position_m[~before] - other.position_m[~before]).max() > 1.0


def test_it_does_not_look_at_the_logged_estimate(flight):
    names = [name for name in flight.streams if name not in ("imu", "mocap", "motor")]
    alone = FirmwareEkf().estimate(flight.without_streams(*names))
    assert np.array_equal(alone.position_m, FirmwareEkf().estimate(flight).position_m)


def test_poses_and_samples_without_numbers_are_left(flight):
    mocap, imu = flight["mocap"], flight["imu"]
    hit = np.arange(300, 900, 7)
    sick = mocap.values.copy()
    sick[hit, 0] = np.nan
    keep = np.delete(np.arange(len(mocap)), hit)
    fewer = replace(mocap, time_s=mocap.time_s[keep], values=mocap.values[keep])
    found = FirmwareEkf().estimate(flight.with_streams(mocap=replace(mocap, values=sick)))
    assert np.array_equal(found.position_m, FirmwareEkf().estimate(flight.with_streams(mocap=fewer)).position_m)
    values = imu.values.copy()
    values[500:700] = np.nan
    holed = FirmwareEkf().estimate(flight.with_streams(imu=replace(imu, values=values)))
    assert np.isfinite(holed.position_m).all()
    assert not np.any((holed.time_s >= imu.time_s[500]) & (holed.time_s <= imu.time_s[699]))


def test_blackout_and_clean_take_it(flight, audited):
    case = task3.select([flight], {flight.name: audited(flight)}, "clean")[0]
    value = blackout.score(case, FirmwareEkf())
    assert np.isfinite([w.error_m for w in value.windows]).all()
    short = [w.error_m for w in value.windows if w.h_s == 1.0]
    assert np.median(short) < 0.5
    assert np.isfinite(task3.score(case, FirmwareEkf(), "clean").metrics["ate_rmse_m"])


def test_without_imu_or_poses_it_says_so(flight):
    with pytest.raises(InputError, match="imu"):
        FirmwareEkf().estimate(flight.without_streams("imu"))
    with pytest.raises(InputError, match="a pose to start from"):
        FirmwareEkf().estimate(blackout.given_until(flight, -1.0))
