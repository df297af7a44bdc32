"""``nanobench convert --to rrd``: what the file holds, read back by Rerun's own reader."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError, MissingExtraError, how_to_install
from nanobench_tools.flight import Flight, Provenance, Span, make_stream
from nanobench_tools.frames import gravity_up
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.steps.export import export

HIDDEN = slice(800, 1000)
"""Rows that the cameras do not see: 8 to 10 s."""


@pytest.fixture(scope="module")
def flight():
    """A noisy circle of 20 s, on the ground at either end; two seconds without motion capture and IMU."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 20.0, 0.01)
    angle = 2.0 * np.pi * t / 10.0
    risen = np.clip(np.minimum(t - 2.0, 18.0 - t) / 2.0, 0.0, 1.0)
    place = np.column_stack([np.cos(angle), np.sin(angle), risen**3 * (10.0 - 15.0 * risen + 6.0 * risen**2)])
    force = np.gradient(np.gradient(place, t, axis=0), t, axis=0) + gravity_up()
    place += rng.normal(0.0, 1e-5, place.shape)
    heading = np.interp(t, [2.0, 18.0], 2.0 * np.pi * np.array([0.2, 1.8]))  # nothing turns on the ground
    turn = so3.from_euler_zyx(rng.normal(0.0, 1e-4, len(t)), rng.normal(0.0, 1e-4, len(t)), heading)
    seen = np.ones(len(t), dtype=bool)
    seen[HIDDEN] = False
    gyro = np.column_stack([rng.normal(0.0, 0.01, (len(t), 2)), np.gradient(heading, t)])
    gyro[:, 2] += rng.normal(0.0, 0.01, len(t))
    flown = (t > 2.0) & (t < 18.0)
    motors = np.where(flown[:, None], 0.6 + rng.normal(0.0, 0.02, (len(t), 4)), 0.0)
    acc = so3.rotate_inverse(turn, force) + rng.normal(0.0, 0.05, (len(t), 3))
    streams = {
        "mocap": make_stream("mocap", t[seen], np.hstack([place, turn])[seen],
                             ("px", "py", "pz", "qx", "qy", "qz", "qw"), rate_hz=100.0),
        "estimator": make_stream("estimator", t, place + rng.normal(0.0, 1e-3, place.shape), ("x", "y", "z"),
                                 rate_hz=100.0),
        "imu": make_stream("imu", t[seen], np.hstack([acc, gyro])[seen],
                           ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"), rate_hz=100.0),
        "motor": make_stream("motor", t, motors, ("m1", "m2", "m3", "m4"), rate_hz=100.0),
        "setpoint": make_stream("setpoint", t, np.where(flown[:, None], place, 0.0), ("x", "y", "z"), rate_hz=100.0),
        "battery": make_stream("battery", t, 4.1 - 0.02 * t[:, None] + rng.normal(0.0, 2e-3, (len(t), 1)), ("vbat",),
                               rate_hz=100.0),
    }
    return Flight("circle", streams, {"family": "circle"}, Provenance("circle.csv", "ab" * 32, "test"), 1.7e9)


class Read:
    """Rows of a file by entity and component, as Rerun's reader gives them."""

    def __init__(self, path):
        from rerun.chunk import RrdReader

        reader = RrdReader(path)
        (self.store,) = reader.recordings()
        self.blueprints = reader.blueprints()
        self.found = {}
        for chunk in reader.stream().to_chunks():
            batch = chunk.to_record_batch()
            for name in batch.schema.names:
                if ":" in name or chunk.entity_path.startswith("/__properties"):
                    time_s = None if chunk.is_static else np.array(
                        [value.value for value in batch.column("time")]) * 1e-9
                    self.found[chunk.entity_path, name] = (time_s, batch.column(name).to_pylist())

    def rows(self, entity, component):
        """Times (n,) s and the list of values of each row."""
        time_s, values = self.found[entity, component]
        order = np.argsort(time_s, kind="stable")
        return time_s[order], [values[i] for i in order]

    def one(self, entity, component):
        """What holds at all times."""
        time_s, (value,) = self.found[entity, component]
        assert time_s is None
        return value

    def has(self, entity):
        return any(path == entity for path, _ in self.found)


def written(flight, folder):
    return Read(export(flight, folder, "rrd"))


@pytest.fixture(scope="module")
def read(flight, tmp_path_factory):
    """The file of the flight as it is."""
    return written(flight, tmp_path_factory.mktemp("rrd"))


def cut(flight, name):
    """Faults of a stream that take rows away, by the audit."""
    from nanobench_tools.auditing.faults.kinds import cutting

    return [f for f in audit(flight).faults if f.kind in cutting() and f.stream in (name, "")]


@pytest.mark.slow
def test_the_path_is_the_positions_and_breaks_where_no_sample_is(flight, read):
    strips = read.one("/world/paths/mocap", "LineStrips3D:strips")
    assert len(strips) == 2
    mocap = flight["mocap"]
    before = mocap.time_s < 9.0
    for strip, rows in zip(strips, (before, ~before), strict=True):
        drawn, there = np.array(strip), mocap["px", "py", "pz"][rows]
        assert len(there) - 2 <= len(drawn) <= len(there)  # the ends of a gap are the audit's
        nearest = np.abs(there[:, None, :] - drawn[None, ::50, :]).max(axis=2).min(axis=0)
        assert nearest.max() < 1e-6
    time_s, places = read.rows("/world/mocap", "Transform3D:translation")
    kept = np.searchsorted(mocap.time_s, time_s - 1e-6)
    np.testing.assert_allclose(time_s, mocap.time_s[kept], rtol=0, atol=1e-9)
    np.testing.assert_allclose(np.array(places)[:, 0], mocap["px", "py", "pz"][kept], rtol=0, atol=1e-6)
    _, turns = read.rows("/world/mocap/body", "Transform3D:quaternion")
    angle = so3.geodesic_angle(np.array(turns)[:, 0], mocap["qx", "qy", "qz", "qw"][kept])
    assert angle.max() < 1e-6


def test_the_vehicle_vanishes_while_nothing_is_known_of_it(read):
    time_s, points = read.rows("/world/mocap", "Points3D:positions")
    assert [len(p) for p in points] == [1, 0, 1, 0]
    assert time_s == pytest.approx([0.0, 7.99, 10.0, 19.99], abs=0.011)
    _, arrows = read.rows("/world/mocap/body", "Arrows3D:vectors")
    assert [len(a) for a in arrows] == [3, 0, 3, 0]


def test_a_series_is_the_numbers_of_the_stream_and_breaks_where_there_are_none(flight, read):
    time_s, values = read.rows("/imu/gyro", "Scalars:scalars")
    values, gyro = np.array(values), flight["imu"]["gyro_x", "gyro_y", "gyro_z"]
    (broken,) = np.flatnonzero(np.isnan(values).all(axis=1))
    assert time_s[broken] == pytest.approx(7.99, abs=0.011)
    assert time_s[broken + 1] == pytest.approx(10.0, abs=0.011)
    measured = np.delete(np.arange(len(values)), broken)
    rows = np.searchsorted(flight["imu"].time_s, time_s[measured] - 1e-6)
    np.testing.assert_array_equal(values[measured], gyro[rows])
    assert len(measured) >= len(gyro) - 2
    assert read.one("/imu/gyro", "SeriesLines:names") == [f"gyro_{axis} [rad/s]" for axis in "xyz"]
    assert read.one("/imu/accelerometer", "SeriesLines:names")[0] == "acc_x [m/s^2]"
    assert read.one("/battery", "SeriesLines:names") == ["vbat [V]"]
    assert read.one("/motor_command", "SeriesLines:names")[3] == "m4 [share of full]"


def test_bars_stand_on_zero_and_reach_up_to_the_command(flight, read):
    time_s, centres = read.rows("/bars/command", "Boxes2D:centers")
    _, halves = read.rows("/bars/command", "Boxes2D:half_sizes")
    assert centres[-1] == []
    centres, halves = np.array(centres[:-1]), np.array(halves[:-1])
    rows = np.searchsorted(flight["motor"].time_s, time_s[:-1] - 1e-6)
    asked = flight["motor"]["m1", "m2", "m3", "m4"][rows]
    np.testing.assert_allclose(halves[:, :, 1] - centres[:, :, 1], asked, atol=1e-6)
    assert np.abs(centres[:, :, 1] + halves[:, :, 1]).max() == 0.0


def test_marks_stand_where_the_audit_says(flight, tmp_path):
    broken = flight["estimator"].values.copy()
    broken[1200:, :] = broken[1199] + np.arange(1.0, len(broken) - 1199)[:, None] * [0.01, 0.0, 0.0]
    flight = flight.with_streams(estimator=replace(flight["estimator"], values=broken))
    read, verdict = written(flight, tmp_path), audit(flight)
    faults = cut(flight, "estimator")
    first_s = min(f.start_s for f in faults)
    assert first_s == pytest.approx(12.0, abs=0.05)  # where it was made to run away
    time_s, texts = read.rows("/log", "TextLog:text")
    levels = [level for (level,) in read.rows("/log", "TextLog:level")[1]]
    dead = [(t, level) for t, (text,), level in zip(time_s, texts, levels, strict=True)
            if text.startswith("dead stream")]
    assert dead == [(pytest.approx(first_s, abs=1e-8), "ERROR")]
    time_s, states = read.rows(r"/audit/dead\ stream\ estimator", "StateChange:state")
    assert states == [["on"], []]
    assert time_s == pytest.approx([first_s, verdict.span.end_s], abs=1e-6)
    time_s, _ = read.rows("/world/onboard_estimate", "Transform3D:translation")
    assert time_s.max() <= first_s
    assert max(np.array(s)[:, 0].max() for s in read.one("/world/paths/onboard_estimate", "LineStrips3D:strips")) < 1.1


def test_usable_is_one_inside_the_audits_spans_and_zero_outside(flight, read):
    from nanobench_tools.auditing.audit_verdict import verdict_of

    verdict = verdict_of(audit(flight))
    assert verdict.usable
    time_s, values = read.rows("/usable", "Scalars:scalars")
    values = np.array(values)[:, 0]
    at = np.linspace(0.05, 19.9, 777)
    drawn = values[np.searchsorted(time_s, at, side="right") - 1]
    inside = np.any([(at >= s.start_s) & (at < s.end_s) for s in verdict.usable], axis=0)
    np.testing.assert_array_equal(drawn, inside.astype(float))
    assert 0 < inside.sum() < len(at)


def test_set_points_are_drawn_in_the_air_only(read):
    strips = read.one("/world/paths/set_point", "LineStrips3D:strips")
    assert min(np.linalg.norm(np.array(s)[:, :2], axis=1).min() for s in strips) > 0.9  # a zero would be at the origin


def test_rows_between_packets_are_not_drawn(flight, tmp_path):
    t = flight["imu"].time_s
    values = flight["imu"].values.copy()
    packets = np.flatnonzero(np.arange(len(t)) % 4 == 0)
    values = np.column_stack([np.interp(t, t[packets], column[packets]) for column in values.T])
    flight = flight.with_streams(imu=replace(flight["imu"], values=values, samples=None))
    assert any(f.kind == "interpolated" and f.stream == "imu" for f in audit(flight).faults)
    read = written(flight, tmp_path)
    time_s, drawn = read.rows("/imu/gyro", "Scalars:scalars")
    time_s = time_s[np.isfinite(np.array(drawn)[:, 0])]
    there = np.isin(np.round(t[packets], 6), np.round(time_s, 6))
    assert there[:-1].mean() > 0.99  # packets stay
    assert len(time_s) < 0.6 * len(t)  # of three rows between two packets the one beside none shows that it is drawn
    said = [text for (text,) in read.rows("/log", "TextLog:text")[1]]
    assert any(text.startswith("imu: ") and "between packets" in text for text in said)


@pytest.mark.parametrize(("missing", "gone"), [
    ("mocap", {"/world/mocap", "/world/paths/mocap"}), ("imu", {"/imu/gyro", "/imu/accelerometer"}),
    ("estimator", {"/world/onboard_estimate"}), ("motor", {"/bars/command", "/motor_command"}),
    ("setpoint", {"/world/paths/set_point"})])
@pytest.mark.slow
def test_what_is_missing_is_not_there_and_the_rest_is(flight, tmp_path, missing, gone):
    read = written(flight.without_streams(missing), tmp_path)
    everything = {"/world/mocap", "/world/paths/mocap", "/imu/gyro", "/imu/accelerometer", "/world/onboard_estimate",
                  "/bars/command", "/motor_command", "/world/paths/set_point", "/battery", "/usable", "/log"}
    assert {entity for entity in everything if not read.has(entity)} == gone


def test_values_that_are_no_numbers_are_no_places(flight, tmp_path):
    values = flight["mocap"].values.copy()
    values[300:310] = np.nan
    values[400, 0] = np.inf
    read = written(flight.with_streams(mocap=replace(flight["mocap"], values=values)), tmp_path)
    _, places = read.rows("/world/mocap", "Transform3D:translation")
    assert np.isfinite(np.array(places)).all()
    assert len(read.one("/world/paths/mocap", "LineStrips3D:strips")) == 4


def test_names_and_properties_of_any_characters(flight, tmp_path):
    name = "Flug #7: ä\ud800 [a] 'b'"
    odd = replace(flight, name=name, metadata={"family": "o\udcff/'\"", "note": ["x", 1]},
                  provenance=replace(flight.provenance, synthetic=True))
    read = Read(export(replace(odd, name=name.replace("\ud800", "\ufffd")), tmp_path, "rrd"))
    shown = name.replace("\ud800", "\ufffd")
    assert read.one("/__properties", "RecordingInfo:name") == [f"SYNTHETIC {shown}"]
    assert read.one("/__properties/flight", "trajectory") == ["o\ufffd/'\""]
    assert read.one("/__properties/flight", "sha256") == ["ab" * 32]
    assert read.one("/__properties", "RecordingInfo:start_time") == [int(1.7e18)]
    assert read.store.application_id == "nanobench"
    assert len(read.blueprints) == 1


def test_an_existing_file_is_replaced_whole_and_a_folder_is_said(flight, tmp_path):
    (tmp_path / "circle.rrd").write_bytes(b"older")
    assert written(flight, tmp_path).has("/world/mocap")
    assert [p.name for p in tmp_path.iterdir()] == ["circle.rrd"]
    (tmp_path / "other" / "circle.rrd").mkdir(parents=True)
    with pytest.raises(InputError, match=r"circle\.rrd: cannot be written"):
        export(flight, tmp_path / "other", "rrd")


def test_the_verb_writes_one_file_a_recording(nanobench, flight, tmp_path):
    for name in ("one", "other"):
        export(replace(flight.during(Span(0.0, 12.0 + len(name))), name=name), tmp_path / "csv", "nanobench")
    code, out, _ = nanobench("convert", tmp_path / "csv", "--to", "rrd", "--out", tmp_path / "rrd", "--jobs", 1)
    assert code == 0
    assert f"Next, look at it: rerun {tmp_path / 'rrd' / 'one.rrd'}" in " ".join(out.split())
    ids = {path.name: Read(path).store.recording_id for path in (tmp_path / "rrd").glob("*.rrd")}
    assert sorted(ids) == ["one.rrd", "other.rrd"]
    assert len(set(ids.values())) == 2  # the viewer shows them beside each other


@pytest.mark.real
@pytest.mark.slow
def test_a_real_flight_keeps_every_pose(real_data, tmp_path):
    source = sorted((real_data / "nanobench").rglob("*trefoil_medium*.csv.xz"))[0]
    (flight,) = load_recordings([source]).flights
    read = written(flight, tmp_path)
    time_s, places = read.rows("/world/mocap", "Transform3D:translation")
    mocap = flight["mocap"]
    rows = np.searchsorted(mocap.time_s, time_s - 1e-6)
    np.testing.assert_allclose(np.array(places)[:, 0], mocap["px", "py", "pz"][rows], rtol=0, atol=1e-6)
    lost = mocap.time_s[np.setdiff1d(np.arange(len(mocap)), rows)]
    spans = [f.span for f in cut(flight, "mocap")]
    assert all(any(s.start_s <= t <= s.end_s for s in spans) for t in lost)


def test_without_rerun_the_extra_is_named_before_anything_is_read(monkeypatch, capsys, flight, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["convert", "nowhere.csv", "--to", "rrd", "--out", str(tmp_path)]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert f"rerun-sdk is not installed; {how_to_install('viewer')}" in err
    with pytest.raises(MissingExtraError):
        export(flight, tmp_path, "rrd")
    assert list(tmp_path.iterdir()) == []
