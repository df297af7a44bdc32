"""Set-points against cflib's own, plans by finite differences, pilots, the dry run and the command line's refusals."""

import numpy as np
import pytest

from nanobench_tools import so3
from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError, UsageError
from nanobench_tools.methods import Reference
from nanobench_tools.radio.fly import setpoint_packets as sp
from nanobench_tools.radio.fly.checklist import check_plan
from nanobench_tools.radio.fly.dry_run import rows
from nanobench_tools.radio.fly.flight_loop import Pacer
from nanobench_tools.radio.fly.flight_plan import Plan, chosen_path
from nanobench_tools.radio.fly.pilot import finite
from nanobench_tools.radio.fly.safety import Limits
from nanobench_tools.radio.fly.watch import sparkline
from nanobench_tools.radio.vehicle_link import check_uri

RNG = np.random.default_rng(5)


def plan(name="figure_eight", speed=1.0, seconds=6.0, start=(0.2, -0.1, 0.02), yaw=0.3) -> Plan:
    return Plan(chosen_path(name, speed, None, seconds), np.array(start), yaw)


class Catcher:
    """What cflib's commander would send."""

    def __init__(self) -> None:
        self.data = b""

    def send_packet(self, packet) -> None:
        self.data = bytes(packet.data)


def test_setpoints_are_byte_for_byte_those_of_cflib():
    from cflib.crazyflie.commander import Commander
    from cflib.utils.encoding import compress_quaternion

    caught = Catcher()
    commander = Commander(caught)
    commander.send_position_setpoint(0.1, -0.2, 1.0, np.degrees(0.5))
    assert caught.data == sp.position([0.1, -0.2, 1.0], 0.5)
    for q in [so3.exp(v) for v in RNG.normal(size=(200, 3)) * 2.0] + [np.array([0.0, 0.0, 0.0, 1.0])]:
        assert sp.compressed(q) == compress_quaternion(q)
        assert so3.geodesic_angle(sp.decompressed(sp.compressed(q)), q) < 0.005
    p, v, a, w = (np.round(x, 3) + 1e-5 * np.sign(x) for x in RNG.normal(size=(4, 3)))
    q = so3.exp([0.1, 0.2, 0.3])
    commander.send_full_state_setpoint(p, v, a, q, *w)  # it cuts off where we round: the hundredth of a mm helps
    assert caught.data == sp.full_state(p, v, a, q, w)


def test_rates_have_the_vehicles_signs_and_say_what_they_were_given():
    decoded = sp.decoded(sp.rates(57600.4, np.array([0.1, 0.2, -0.3])))
    assert decoded["thrust_counts"] == 57600
    np.testing.assert_allclose(decoded["rate_rad_s"], [0.1, 0.2, -0.3], atol=1e-6)
    raw = np.frombuffer(sp.rates(1.0, np.array([0.0, 0.2, 0.0]))[1:13], "<f4")
    np.testing.assert_allclose(raw, [0.0, -np.degrees(0.2), 0.0], rtol=1e-6)  # nose up is positive there
    assert sp.decoded(sp.rates(1e9, np.zeros(3)))["thrust_counts"] == 65535
    assert not finite(sp.rates(1.0, np.array([np.nan, 0.0, 0.0])))
    assert finite(sp.position(np.zeros(3), 0.0))


def test_full_state_keeps_its_range_and_leans_into_the_curve():
    zero = np.zeros(3)
    decoded = sp.decoded(sp.full_state(np.full(3, 99.0), zero, zero, np.array([0, 0, 0, 1.0]), zero))
    assert decoded["position_m"] == (32.767,) * 3
    up = so3.rotate(sp.attitude_of(np.array([1.0, -2.0, 0.0]), 0.4), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(up, np.array([1.0, -2.0, 9.81]) / np.linalg.norm([1.0, -2.0, 9.81]), atol=1e-9)


@pytest.mark.parametrize("name", ["figure_eight", "circle", "helix", "trefoil", "lissajous"])
def test_a_plan_is_smooth_from_hover_to_hover(name):
    p = plan(name, 0.8)
    t = np.arange(p.ends["take-off"], p.ends["hover at end"], 0.0005)
    found = p.at(t)
    for value, slope in ((found.position_m, found.velocity_m_s), (found.velocity_m_s, found.acceleration_m_s2),
                         (found.yaw_rad[:, None], found.yaw_rate_rad_s[:, None])):
        np.testing.assert_allclose(np.gradient(value, t, axis=0)[1:-1], slope[1:-1], atol=2e-3 * np.abs(slope).max())
    ends = p.at(np.array([0.0, p.ends["take-off"], p.ends["hover at end"]]))
    np.testing.assert_allclose(ends.velocity_m_s, 0.0, atol=1e-12)
    np.testing.assert_allclose(ends.position_m[0], [0.2, -0.1, p.spec.altitude_m])
    path = p.at(np.array([0.5 * (p.ends["fade-in"] + p.ends["path"])]))
    along = 0.5 * p.spec.duration_s
    np.testing.assert_allclose(path.position_m[0], p.spec.at(np.array([along])).position_m[0], atol=1e-9)


def test_the_future_of_a_reference_is_the_reference_of_the_future():
    p = plan()
    ahead = p.reference(7.0).ahead(np.array([0.0, 0.25]))
    np.testing.assert_array_equal(ahead.position_m[1], p.reference(7.25).position_m)
    np.testing.assert_array_equal(ahead.jerk_m_s3[0], p.reference(7.0).jerk_m_s3)


@pytest.mark.parametrize(("speed", "size", "words"), [(1.0, 3.0, "beyond the fence"), (2.5, None, "the limit is 3.0")])
def test_a_path_outside_the_limits_is_refused(speed, size, words):
    with pytest.raises(InputError, match=words):
        check_plan(Plan(chosen_path("figure_eight", speed, size, 8.0), np.zeros(3), 0.0), Limits())


@pytest.mark.parametrize("given", [("spiral", 1.0, None), ("staircase_climb", None, 1.0),
                                   ("multisine_sysid", 1.0, None)])
def test_a_path_that_cannot_be_is_a_usage_error(given):
    with pytest.raises(UsageError):
        chosen_path(*given, None)


def test_onboard_pilots_are_told_where_to_be():
    p = plan()
    now = p.reference(7.0)
    told = sp.decoded(pilot_for("onboard_pid", None, None).packet(7.0, None, now))
    np.testing.assert_allclose(told["position_m"], now.position_m[0], atol=1e-6)
    full = sp.decoded(pilot_for("onboard_mellinger", "full-state", None).packet(7.0, None, now))
    np.testing.assert_allclose(full["velocity_m_s"], now.velocity_m_s[0], atol=1e-3)
    np.testing.assert_allclose(full["acceleration_m_s2"], now.acceleration_m_s2[0], atol=1e-3)
    early = sp.decoded(pilot_for("lead_pid", None, None).packet(7.0, None, now))
    np.testing.assert_allclose(early["position_m"], p.reference(7.53).position_m[0], atol=1e-6)
    assert [pilot_for(n, None, None).onboard for n in ("onboard_pid", "onboard_mellinger", "geometric")] == [1, 2, 1]


@pytest.mark.parametrize(("name", "kind"), [("onboard_pid", "thrust-rates"), ("geometric", "velocity"),
                                            ("geometric", "full-state"), ("mpc_daqp", "velocity"),
                                            ("nobody", None)])
def test_controllers_and_setpoints_that_do_not_go_together(name, kind):
    with pytest.raises(UsageError):
        pilot_for(name, kind, None)


def test_thrust_and_rates_of_a_hovering_controller_hold_the_vehicle():
    from nanobench_tools.radio.fly.dry_run import BATTERY_V

    pilot = pilot_for("geometric", None, None)
    p = plan()
    pilot.link_delay(0.01)
    pilot.reset()
    hover = p.reference(p.ends["take-off"])
    from nanobench_tools.methods import VehicleState

    state = VehicleState(hover.position_m, np.zeros((1, 3)), so3.from_euler_zyx(0.0, 0.0, hover.yaw_rad),
                         np.zeros((1, 3)), np.array([BATTERY_V]))
    for tick in range(60):  # until its battery compensation has seen the battery
        decoded = sp.decoded(pilot.packet(0.01 * tick, state, hover))
    np.testing.assert_allclose(decoded["rate_rad_s"], 0.0, atol=0.05)
    assert decoded["thrust_counts"] == pytest.approx(0.04085 * 9.81 / 0.943 / 4.0 / 0.12 * 65535, rel=0.03)


def test_a_dry_run_shows_every_phase_and_needs_no_link(capsys):
    found = rows(plan(), pilot_for("onboard_pid", None, None), 0.5)
    assert list(dict.fromkeys(phase for phase, _, _ in found)) == [
        "take-off", "hover", "approach", "fade-in", "path", "fade-out", "hover at end", "landing"]
    assert main(["fly", "--controller", "onboard_pid", "--dry-run", "--seconds", "5", "--speed", "0.5"]) == 0
    text = capsys.readouterr().out
    assert "high-level take-off to 1.00 m" in text
    assert "position" in text


@pytest.mark.parametrize(("arguments", "words"), [
    (["--uri", "wifi://here"], "no URI of a Crazyflie"), (["--uri", "udp://127.0.0.1"], "no URI of a Crazyflie"),
    (["--uri", "udp://127.0.0.1:bad"], "no URI"), ([], "--uri URI and --mocap SOURCE are needed"),
    (["--uri", "udp://127.0.0.1:1", "--blocks", "/no/such.yaml"], "cannot be read"),
    (["--uri", "udp://127.0.0.1:1", "--fence", "1", "0", "0", "1", "0", "1"], "each least below"),
    (["--uri", "udp://127.0.0.1:1", "--trajectory", "spiral"], "unknown trajectory 'spiral'"),
    (["--uri", "udp://127.0.0.1:9"], "udp://127.0.0.1:9: no"),  # nobody serves port 9
])
def test_bad_input_is_one_line_and_exit_code_2(capsys, monkeypatch, arguments, words):
    monkeypatch.setattr("nanobench_tools.radio.vehicle_link.ANSWER_S", 0.4)
    monkeypatch.setattr("nanobench_tools.radio.fly.session.STARTS_S", 0.0)
    extra = ["--mocap", "simulated://127.0.0.1:1"] if arguments else []
    assert main(["fly", "--controller", "onboard_pid", "--quiet", *arguments, *extra]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


def test_uris_of_the_crazyflie_world_pass():
    for uri in ("radio://0/80/2M/E7E7E7E7E7", "udp://127.0.0.1:19850", "tcp://10.0.0.2:5000", "usb://0"):
        check_uri(uri)


class Ticking:
    """A clock that is a little late whenever it is slept on."""

    real = False

    def __init__(self) -> None:
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    def sleep_until(self, time_s: float) -> None:
        self.time_s = max(self.time_s, time_s) + 0.0002


def test_deadlines_missed_are_counted_and_not_made_up_for():
    clock = Ticking()
    pacer = Pacer(clock, 0.01)
    for tick in range(100):
        pacer.wait()
        clock.time_s += 0.035 if tick == 50 else 0.004
        pacer.sent(0.004)
        pacer.done()
    found = pacer.beat.summary()
    assert found["ticks"] == 100
    assert found["missed"] == 3  # the tick itself and the two it slept through
    assert found["begin_p50_ms"] == pytest.approx(0.2, abs=1e-6)


def test_a_sparkline_is_as_long_as_its_values():
    assert sparkline([0.0, 0.1, 0.2, float("nan")], 0.2) == "▁▅█ "


def test_references_without_derivatives_are_rates_no_controller_can_guess():
    bare = Reference(np.zeros((1, 3)), np.zeros(1), np.zeros((1, 3)), np.zeros((1, 3)))
    with pytest.raises(UsageError):
        sp.of_reference("thrust-rates", bare)
    assert sp.decoded(sp.of_reference("full-state", bare))["rate_rad_s"] == (0.0, 0.0, 0.0)


def test_the_tracking_error_is_that_of_the_path_alone():
    from nanobench_tools.radio.fly.outcome import TrackingError
    from nanobench_tools.radio.fly.pose_tracker import Believed

    found, still = TrackingError(), np.zeros(3)
    assert np.isnan(found.rmse_m)
    for phase, off_m in (("hover", 5.0), ("path", 0.3), ("path", 0.4), ("landing", 5.0)):
        believed = Believed(0.0, np.array([off_m, 0.0, 0.0]), still, np.array([0.0, 0.0, 0.0, 1.0]), still, 0.0)
        found.tick(0.0, phase, believed, still, 0.0)
    assert found.rmse_m == pytest.approx(np.sqrt(0.125))
    assert found.largest_m == pytest.approx(0.4)
