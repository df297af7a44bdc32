"""The logging chain piece by piece: losses, interpolation, clock, motion capture."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from practice_crowd import VEHICLES

from nanobench_tools import so3
from nanobench_tools.errors import UsageError
from nanobench_tools.practice.clock import ClockError, draw_clock
from nanobench_tools.practice.flying import LOGGED, STEP_S, flight_rngs
from nanobench_tools.practice.logging_chain import PERFECT, LoggingChain, received, record, resample
from nanobench_tools.practice.mocap import body_rate, savgol_derivative
from nanobench_tools.practice.timeline import LEAD_S
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.sources.interpolation import carries_no_packet


@settings(deadline=None, max_examples=40)
@given(share=st.floats(0.0, 0.5), burst=st.floats(0.0, 0.7), gap=st.floats(0.03, 0.2), seed=st.integers(0, 99))
def test_losses_have_the_share_and_never_last_too_long(share, burst, gap, seed):
    kept = received(np.random.default_rng(seed), 20_000, share, burst, gap)
    apart = np.diff(np.flatnonzero(kept))
    assert 0.01 * apart.max() <= gap + 0.0051
    assert 1.0 - kept.mean() <= share + 0.02
    if gap > 0.12:  # long bursts are cut short, which loses less
        assert 1.0 - kept.mean() == pytest.approx(share, abs=0.03)


def test_kink_share_is_the_share_of_rows_without_a_packet_near():
    rng = np.random.default_rng(3)
    sent = 0.01 * np.arange(4000) + 0.004
    stamps = sent[received(rng, 4000, 0.2, 0.45, 0.08)]
    rows = np.arange(0.05, 39.9, 0.01)
    values = resample(stamps, rng.standard_normal((len(stamps), 3)), rows)
    lonely = np.array([not np.any((stamps > a) & (stamps < b)) for a, b in zip(rows[:-2], rows[2:], strict=True)])
    np.testing.assert_array_equal(carries_no_packet(rows, values)[1:-1], lonely)
    assert 0.05 < lonely.mean() < 0.15


def test_beyond_the_last_packet_the_line_goes_on():
    stamps, values = np.array([0.0, 1.0, 2.0]), np.array([[0.0], [1.0], [3.0]])
    np.testing.assert_allclose(resample(stamps, values, np.array([0.5, 2.5, 4.0]))[:, 0], [0.5, 4.0, 7.0])


def test_the_clock_is_late_by_what_was_asked_for():
    clock = draw_clock(np.random.default_rng(1), 40.0, 0.02, 0.001, 0.03)
    t = np.arange(0.0, 40.0, 0.01)
    wander = clock.late_s(t) - 0.02 - 0.001 * t
    assert wander.std() == pytest.approx(0.03, rel=1e-3)
    assert wander.mean() == pytest.approx(0.0, abs=1e-4)
    assert np.all(np.diff(clock.stamp(t)) > 0.0)
    assert np.all(clock.stamp(t) >= t + clock.late_s(t) - 1e-12)
    np.testing.assert_allclose(clock.shifted(5.0).late_s(t - 5.0), clock.late_s(t), atol=1e-12)
    np.testing.assert_allclose(ClockError().stamp(t), t, atol=1e-14, rtol=0)


def test_savgol_velocity_is_a_cubic_fit_through_eleven_rows():
    rng = np.random.default_rng(2)
    t = 0.01 * np.arange(60)
    x = np.cumsum(rng.standard_normal((60, 3)), axis=0)
    found = savgol_derivative(t, x)
    for row in (5, 23, 54):
        window = slice(row - 5, row + 6)
        for k in range(3):
            fit = np.polyfit(t[window] - t[row], x[window, k], 3)
            assert found[row, k] == pytest.approx(fit[2], rel=1e-8)


def test_body_rate_of_a_steady_turn_about_a_tilted_axis():
    t = 0.01 * np.arange(200)
    w = np.array([1.0, -2.0, 0.5])
    q = so3.multiply(so3.from_euler_zyx(0.3, 0.2, -1.0), so3.exp(t[:, None] * w))
    np.testing.assert_allclose(body_rate(t, q)[6:-6], np.tile(w, (188, 1)), atol=2e-4)
    np.testing.assert_allclose(body_rate(t, -q), body_rate(t, q), atol=1e-12)


@pytest.mark.real
def test_published_velocity_and_rate_columns_are_made_so(real_data):
    folder = real_data / "nanobench" / "datasets" / "dataset"
    flight = load_recordings([folder / "B2_circle_fast_rep3.csv.xz"]).flights[0]
    mocap = flight["mocap"]
    velocity = savgol_derivative(mocap.time_s, mocap["px", "py", "pz"])
    np.testing.assert_allclose(velocity[6:-6], mocap["vx", "vy", "vz"][6:-6], atol=1e-6)
    rate = body_rate(mocap.time_s, mocap["qx", "qy", "qz", "qw"])
    np.testing.assert_allclose(rate[6:-6], mocap["wx", "wy", "wz"][6:-6], atol=1e-4)


FAST = list(VEHICLES).index("fast figure_eight")


@pytest.fixture(scope="module")
def flown(crowd):
    return crowd.flown


def test_a_perfect_chain_gives_the_truth_back(flown):
    recorded = record(flown, FAST, PERFECT, flight_rngs(2, 0, 9)[6:])
    rows = recorded.streams["mocap"].time_s
    truth = flown.truth["position_m"][:, FAST]
    speed = np.linalg.norm(flown.truth["velocity_m_s"][:, FAST], axis=1).max()
    starts = np.arange(LEAD_S, LEAD_S + 0.0101, 0.0001)
    error = [np.abs(np.stack([np.interp(rows + s, flown.time_s, c) for c in truth.T], 1)
                    - recorded.streams["mocap"]["px", "py", "pz"]).max() for s in starts]
    first = starts[int(np.argmin(error))]
    assert min(error) < speed * 1e-4 + 2e-4
    for name, (_, sub) in LOGGED.items():
        sent = flown.time_s + sub * STEP_S
        expected = resample(sent, flown.messages[name][:, FAST], rows + first)
        scale = np.abs(flown.messages[name][:, FAST]).max(axis=0) + 1e-9
        assert np.quantile(np.abs(recorded.streams[name].values - expected) / scale, 0.99) < 0.02, name
        assert recorded.streams[name].samples == pytest.approx(len(rows), abs=1)


def test_late_stamps_move_the_streams_and_not_the_mocap(flown):
    chains = [LoggingChain(loss=(0.0, 0.0), tail_s=(0.0, 0.0), lost_frames=0.0, offset_s=x) for x in (0.0, 0.05)]
    prompt, late = (record(flown, FAST, chain, flight_rngs(2, 0, 9)[6:]).streams for chain in chains)
    np.testing.assert_array_equal(prompt["mocap"].values, late["mocap"].values)
    t, x = prompt["imu"].time_s, prompt["imu"]["gyro_x"]
    np.testing.assert_allclose(late["imu"]["gyro_x"][20:], np.interp(t[20:] - 0.05, t, x), atol=1e-9)


def test_the_end_is_a_continued_line_when_asked_for(flown):
    streams = record(flown, FAST, LoggingChain(), flight_rngs(2, 0, 9)[6:]).streams
    imu = streams["imu"]
    bent = np.abs(np.diff(imu.values, 2, axis=0)).max(axis=1) > 1e-9
    assert 0.18 < imu.time_s[-1] - imu.time_s[1:-1][bent][-1] < 0.42
    gaps = np.diff(streams["mocap"].time_s)
    assert gaps.min() > 0.0099
    assert gaps.max() < 0.0401


def test_impossible_settings_are_refused():
    with pytest.raises(UsageError, match="packet loss"):
        LoggingChain(loss=(0.3, 0.1))
    with pytest.raises(UsageError, match="longest_gap_s"):
        LoggingChain(longest_gap_s=0.005)
