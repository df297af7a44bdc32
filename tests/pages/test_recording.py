"""What is drawn of one recording, against numbers known by construction."""

import json
from dataclasses import replace

import numpy as np
import pytest

from nanobench_tools.pages.audit_entry import fault_counts, share_clean, share_valid, total
from nanobench_tools.pages.recording import PATH_RATE_HZ, view


@pytest.fixture
def flight(make):
    return make.flight()


def titles(drawn):
    """Title of the y axis, and above it, of each panel; as text of Plotly."""
    layout = drawn["figure"]["layout"]
    above = {a["xref"].partition(" ")[0]: a["text"] for a in layout["annotations"]}
    return [(layout["yaxis" + n]["title"]["text"].partition(" [")[0], above.get("x" + n, ""))
            for n in ("", *map(str, range(2, 1 + len(drawn["figure"]["panels"]))))]


def panel(drawn, title):
    """Number of the panel whose y axis or title is so called, as Plotly counts."""
    k = next(k for k, found in enumerate(titles(drawn)) if title in found or f"<b>{title}</b>" in found)
    return str(k + 1) if k else ""


def traces(drawn, title):
    return [t for t in drawn["figure"]["data"] if t["yaxis"] == f"y{panel(drawn, title)}"]


def values(drawn, title, name, key="y"):
    trace = [t for t in traces(drawn, title) if t["meta"] == name][-1]
    return np.array([np.nan if v is None else v for v in trace[key]])


def test_errors_are_the_offsets_the_flight_was_made_with(flight, make):
    drawn = view(flight, make.entry(flight))
    before = values(drawn, "position error", "position error", "x") < 14.9
    assert values(drawn, "position error", "position error")[before] == pytest.approx(100.0, abs=0.1)
    assert values(drawn, "attitude error", "attitude error") == pytest.approx(10.0, abs=0.01)
    shown = [drawn["figure"]["layout"][f"yaxis{panel(drawn, t)}"]["title"]["text"] for t in
             ("position error", "attitude error")]
    assert shown == ["position error [mm]", "attitude error [deg]"]


def test_the_frame_is_what_is_clean_and_the_rest_is_said(flight, make):
    drawn = view(flight, make.entry(flight))
    n = panel(drawn, "position error")
    layout = drawn["figure"]["layout"]
    assert layout[f"yaxis{n}"]["range"][1] == pytest.approx(108.0, abs=0.2)
    (shaded,) = [s for s in layout["shapes"] if s["xref"] == f"x{n}"]
    assert (shaded["x0"], shaded["x1"], shaded["fillcolor"]) == (15.0, 20.0, "var(--red)")
    assert "Outside the frame: position error from 100 to 1e+04 mm" in drawn["figure"]["note"]


def test_paths_have_gaps_where_the_audit_cuts_and_setpoints_only_in_the_air(flight, make):
    drawn = view(flight, make.entry(flight))
    estimate, setpoint, truth = (values(drawn, "from above", name, "x") for name in
                                 ("onboard estimate", "set-point", "motion capture"))
    t = np.linspace(0.0, 20.0, len(truth))
    assert len(truth) == 20.0 * PATH_RATE_HZ
    assert np.isfinite(truth).all()
    assert np.array_equal(np.isnan(estimate), t >= 15.0)
    assert np.array_equal(np.isnan(setpoint), (t < 2.0) | (t > 18.0))
    assert truth == pytest.approx(np.cos(2 * np.pi * t / 10.0), abs=2e-3)
    assert values(drawn, "from above", "motion capture", "customdata") == pytest.approx(t, abs=2e-3)  # for the cursor


def test_zeros_that_are_logged_when_nothing_is_asked_are_no_place(flight, make):
    flight.streams["setpoint"].values[1000:1500, [flight["setpoint"].columns.index(a) for a in "xyz"]] = 0.0
    drawn = values(view(flight, make.entry(flight)), "from above", "set-point", "x")
    t = np.linspace(0.0, 20.0, len(drawn))
    assert np.isnan(drawn[(t > 10.05) & (t < 14.95)]).all()
    assert np.isfinite(drawn[((t > 9.0) & (t < 9.9)) | ((t > 15.1) & (t < 16.0))]).all()


def test_the_audit_is_bars_in_the_air_usable_and_an_event_each(flight, make):
    drawn = view(flight, make.entry(flight))
    bars = traces(drawn, "audit")
    assert drawn["figure"]["layout"][f"yaxis{panel(drawn, 'audit')}"]["ticktext"] == ["in the air", "usable",
                                                                                        "dead stream", "spike"]
    assert [t["marker"]["color"] for t in bars] == [f"var(--{name})" for name in ("sky", "green", "red", "red")]
    assert (bars[1]["base"], bars[1]["x"]) == ([2.0], [13.0])
    assert drawn["events"]["rows"][0] == ["a straight line to the end", "15.00–20.00", "", "estimator"]
    assert (drawn["severity"], drawn["advice"]) == ("cut", "try --clock retimed")


def test_a_recording_that_was_not_audited_is_drawn_whole(flight):
    drawn = view(flight, None)
    assert np.isfinite(values(drawn, "from above", "onboard estimate", "x")).all()
    assert drawn["severity"] == ""
    with pytest.raises(StopIteration):
        panel(drawn, "audit")


@pytest.mark.parametrize(("missing", "gone"), [
    ("battery", {"battery"}), ("motor", {"motor PWM ratio"}), ("mocap", {"position error", "attitude error"})])
def test_what_is_missing_has_no_panel_and_the_rest_is_drawn(make, missing, gone):
    flight = make.flight().without_streams(missing)
    drawn = view(flight, make.entry(flight))
    there = {title for title, _ in titles(drawn)}
    assert {"battery", "motor PWM ratio", "position error", "attitude error", "x", "y", "z"} - there - {"x"} == gone


def test_a_recording_without_any_stream_still_has_a_page(make):
    flight = make.flight(streams=())
    drawn = view(flight, make.entry(flight))
    assert titles(drawn) == [("", "<b>audit</b>")]
    json.dumps(drawn, allow_nan=False)


def test_values_that_are_no_numbers_do_not_reach_the_page(make):
    flight = make.flight()
    broken = flight["estimator"].values.copy()
    broken[100:200] = np.nan
    broken[300] = np.inf
    quaternion = np.zeros_like(flight["attitude_qw"].values)
    flight = flight.with_streams(estimator=replace(flight["estimator"], values=broken),
                                 attitude_qw=replace(flight["attitude_qw"], values=quaternion))
    json.dumps(view(flight, make.entry(flight)), allow_nan=False)


def test_stamps_that_go_back_do_not_break_the_comparison(make):
    flight = make.flight()
    t = flight["mocap"].time_s.copy()
    t[500:510] = t[495]
    drawn = view(flight.with_streams(mocap=replace(flight["mocap"], time_s=t)), make.entry(flight))
    assert np.nanmax(values(drawn, "attitude error", "attitude error")) == pytest.approx(10.0, abs=0.02)


def test_the_moving_clock_has_its_band(flight, make):
    warp = [[2.0, 0.0, 0.002], [6.0, 0.04, 0.002], [18.0, -0.01, 0.004]]
    drawn = view(flight, make.entry(flight), {"warp": warp})
    assert values(drawn, "clock error", "clock error") == pytest.approx([0.0, 40.0, -10.0])
    band = next(t for t in traces(drawn, "clock error") if t.get("fill") == "toself")
    upper, lower = np.split(np.array(band["y"]), 2)
    assert lower[::-1] == pytest.approx([-4.0, 36.0, -18.0], abs=0.3)
    assert upper + lower[::-1] == pytest.approx([0.0, 80.0, -20.0], abs=1.0)


def test_shares_and_counts_of_an_audit(flight, make):
    entry = make.entry(flight)
    assert share_valid(entry, "estimator") == pytest.approx(0.75)
    assert share_valid(entry, "battery") == 1.0
    assert share_clean(entry) == pytest.approx(0.75)
    assert fault_counts(entry) == {"dead_stream": 1, "spike": 1}
    assert total([[0, 2], [1, 3]]) == 3.0
    assert total(None) is None


def test_the_spectrum_is_drawn_with_the_rotors(flight, make):
    entry = make.entry(flight)
    rotors = [{"order": 1, "rotor_hz": 300.0, "seen_at_hz": 200.0, "rms": 0.1, "share": 0.5}]
    gyro = {"unit": "rad/s", "windows": 9, "up_to_hz": 250.0, "rms": 0.28, "highest": 2.0, "clipped_rows": 0,
            "peak_hz": 80.0, "peak_rms": 0.28, "rotors": rotors, "load": "", "against": [], "interpolated": False,
            "spectrum": [[20.0, 0.01], [80.0, 0.4], [250.0, 0.01]]}
    entry["health"] = {"vibration": {"gyro": gyro}, "battery": None, "lacks": []}
    drawn = view(flight, entry)
    assert values(drawn, "gyro vibration", "gyro") == pytest.approx([0.01, 0.4, 0.01])
    assert "strongest at 80 Hz" in dict(drawn["facts"])["Health"]
    assert any(s["x0"] == 200.0 for s in drawn["figure"]["layout"]["shapes"])
    assert "gyro vibration" not in [title for title, _ in titles(view(flight, make.entry(flight)))]
