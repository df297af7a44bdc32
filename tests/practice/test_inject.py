"""Every injection does what its truth says, and nothing elsewhere."""

import numpy as np
import pytest

from nanobench_tools.practice.inject import FILE_INJECTIONS, INJECTIONS
from nanobench_tools.practice.inject.place import FIRMWARE
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.sources.nanobench import write_nanobench

CASES = [(kind, size, case) for kind, x in INJECTIONS.items() for size in x.sizes for case in x.cases]
WHOLE = {"clock_offset", "clock_drift", "clock_wander", "never_flew", "crash", "copy"}


@pytest.mark.parametrize(("kind", "size", "case"), CASES, ids=lambda x: str(x) if not isinstance(x, dict) else
                         "-".join(map(str, x.values())) or "plain")
def test_truth_and_change_agree(practice, kind, size, case):
    flight = practice[0]
    before = {name: s.values.copy() for name, s in flight.streams.items()}
    scale = 0.4 if kind in ("dead_stream", "frozen_stream", "gap", "mocap_occlusion") else 1.0  # the flight is short
    size = size * scale if size is not None and size > 1.0 and scale < 1.0 else size
    function = INJECTIONS[kind].function
    changed, fault = function(flight, np.random.default_rng(5), size, **case)
    again, same = function(flight, np.random.default_rng(5), size, **case)
    assert (fault.kind, repr(fault)) == (kind, repr(same))
    for name, values in before.items():
        np.testing.assert_array_equal(flight[name].values, values)  # the input is left alone
        np.testing.assert_array_equal(changed[name].values, again[name].values)
    assert fault.start_s <= fault.end_s
    assert fault.evidence.startswith("injected: ")
    touched = [n for n in before if changed[n].values.shape != before[n].shape
               or not np.array_equal(changed[n].values, before[n], equal_nan=True)
               or not np.array_equal(changed[n].time_s, flight[n].time_s)]
    if kind == "copy":
        assert not touched
    elif fault.stream:
        assert fault.stream in touched
        if not (kind == "gap" and fault.stream == "mocap"):
            assert touched == [fault.stream]
    elif kind not in ("duplicate_time", "coarse_time", "no_common_time", "backward_time", "never_flew", "crash"):
        assert set(touched) <= set(FIRMWARE)  # on the ground some stand still anyway
        assert {"imu", "estimator"} <= set(touched)
    if fault.stream and kind not in WHOLE and changed[fault.stream].values.shape == before[fault.stream].shape:
        s = changed[fault.stream]
        rows = ~np.isclose(s.values, before[fault.stream], rtol=1e-12, atol=1e-12, equal_nan=True).all(axis=1)
        if kind not in ("mocap_jump", "estimator_reset"):  # these go on after the moment they name
            late = 0.06 if kind == "mocap_occlusion" else 0.0  # the velocity filter reaches five rows further
            assert np.all(s.time_s[rows] >= fault.start_s - late - 1e-9)
            assert np.all(s.time_s[rows] <= fault.end_s + late + 1e-9)
        else:
            assert s.time_s[rows].min() >= fault.start_s - 0.06


def test_an_offset_moves_gyro_and_motors_together(practice):
    changed, fault = INJECTIONS["clock_offset"].function(practice[0], np.random.default_rng(0), 0.05)
    t = practice[0]["imu"].time_s
    for stream, column in (("imu", "gyro_x"), ("motor", "m1")):
        expected = np.interp(t - 0.05, t, practice[0][stream][column])
        np.testing.assert_allclose(changed[stream][column][10:], expected[10:], atol=1e-12)
    assert fault.size == 0.05


def test_a_crash_falls_with_g_and_lies_still(practice):
    changed, fault = INJECTIONS["crash"].function(practice[0], np.random.default_rng(3), 1.0, at_s=8.0)
    mocap, imu = changed["mocap"], changed["imu"]
    falling = (mocap.time_s > fault.start_s) & (mocap.time_s < fault.end_s)
    fit = np.polyfit(mocap.time_s[falling], mocap["pz"][falling], 2)
    assert 2 * fit[0] == pytest.approx(-9.81, abs=0.05)
    assert np.linalg.norm(imu["acc_x", "acc_y", "acc_z"][falling][1:-2], axis=1).max() < 0.5
    lying = imu.time_s > fault.end_s + 0.1
    np.testing.assert_allclose(np.linalg.norm(imu["acc_x", "acc_y", "acc_z"][lying], axis=1), 9.81, atol=0.3)
    assert np.abs(mocap["pz"][lying] - mocap["pz"][0]).max() < 0.01
    assert not changed["motor"].values[lying].any()


@pytest.fixture(scope="module")
def csv(practice, tmp_path_factory):
    return write_nanobench(practice[1], tmp_path_factory.mktemp("csv") / "a.csv").read_bytes()


@pytest.mark.parametrize(("kind", "size", "case"),
                         [(k, s, c) for k, x in FILE_INJECTIONS.items() for s in x.sizes for c in x.cases])
def test_file_faults_are_in_the_bytes_and_seen_by_the_reader(csv, tmp_path, kind, size, case):
    data, fault = FILE_INJECTIONS[kind].function(csv, np.random.default_rng(2), size, **case)
    assert data != csv
    before, after = (len(x.rstrip(b"\n").split(b"\n")) for x in (csv, data))
    width = [len(x.split(b"\n", 1)[0].split(b",")) for x in (csv, data)]
    columns = width[1] - width[0]
    assert columns == {"missing_column": -fault.size, "extra_column": fault.size}.get(kind, 0)
    assert after == before - (fault.size if kind == "truncated" else 0)
    (tmp_path / "a.csv").write_bytes(data)
    loaded = load_recordings([tmp_path], cache=False)
    assert len(loaded.flights) == 1
    found = loaded.flights[0].provenance.findings
    assert kind in {f.kind for f in found}, [f.kind for f in found]
