"""Set-points of every type, who wins, and what happens when none comes."""

import math
import struct

import numpy as np
import pytest
from still_vehicle import StillVehicle

from nanobench_tools.radio.crtp import Packet
from nanobench_tools.radio.simulated import setpoints
from nanobench_tools.radio.simulated.commander import HIGH_LEVEL, RADIO
from nanobench_tools.radio.simulated.onboard_services import Onboard
from nanobench_tools.radio.simulated.quaternion32 import compress
from nanobench_tools.radio.simulated.supervisor import State

MODES = ("mode_x", "mode_y", "mode_z", "mode_roll", "mode_pitch", "mode_yaw", "mode_quat")


def modes(setpoint) -> str:
    """Letters d, a, v for x, y, z, roll, pitch, yaw, quaternion."""
    return "".join("dav"[int(setpoint[0][name])] for name in MODES)


def rpyt(roll: float, pitch: float, yaw: float, thrust: int) -> bytes:
    return struct.pack("<fffH", roll, pitch, yaw, thrust)


def test_roll_pitch_yaw_thrust_is_locked_until_zero_has_been_asked_for() -> None:
    port = setpoints.RollPitchYawThrust()
    assert port.read(rpyt(0, 0, 0, 40000))["thrust"] == 0
    assert port.read(rpyt(0, 0, 0, 0))["thrust"] == 0
    assert port.read(rpyt(0, 0, 0, 40000))["thrust"] == 40000
    assert port.read(rpyt(0, 0, 0, 999))["thrust"] == 0
    assert port.read(rpyt(0, 0, 0, 65000))["thrust"] == 60000


def test_roll_and_pitch_are_angles_yaw_a_negated_rate() -> None:
    got = setpoints.RollPitchYawThrust().read(rpyt(5.0, -7.0, 30.0, 0))
    assert modes(got) == "dddaavd"
    assert got["attitude_deg"][0, :2].tolist() == [5.0, -7.0]
    assert got["rate_deg_s"][0, 2] == -30.0


def test_rates_are_asked_for_through_the_flight_mode() -> None:
    port = setpoints.RollPitchYawThrust()
    port.mode.stabModeRoll = port.mode.stabModePitch = setpoints.RATE
    got = port.read(rpyt(50.0, -70.0, 30.0, 0))
    assert modes(got) == "dddvvvd"
    assert got["rate_deg_s"][0].tolist() == [50.0, -70.0, -30.0]
    port.mode.stabModeYaw = setpoints.ANGLE
    assert modes(port.read(rpyt(0, 0, 45.0, 0))) == "dddvvad"


def test_height_and_position_can_be_held_through_the_flight_mode() -> None:
    port = setpoints.RollPitchYawThrust()
    port.mode.althold = 1
    got = port.read(rpyt(0, 0, 0, 49150))
    assert modes(got)[2] == "v"
    assert got["velocity_m_s"][0, 2] == pytest.approx(0.5, abs=1e-3)
    port.mode.althold, port.mode.posSet = 0, 1
    got = port.read(rpyt(1.0, 2.0, 90.0, 1500))
    assert modes(got) == "aaaddad"
    assert got["position_m"][0].tolist() == [-2.0, 1.0, 1.5]


@pytest.mark.parametrize(("kind", "payload", "wanted", "field", "values"), [
    (8, (0.1, 0.2, 0.3, 40.0), "vvvddvd", "velocity_m_s", (0.1, 0.2, 0.3)),
    (9, (5.0, -6.0, 40.0, 0.7), "ddaaavd", "position_m", (0.0, 0.0, 0.7)),
    (10, (0.1, 0.2, 40.0, 0.7), "vvaddvd", "velocity_m_s", (0.1, 0.2, 0.0)),
    (7, (1.0, 2.0, 3.0, 90.0), "aaaddad", "position_m", (1.0, 2.0, 3.0)),
    (4, (5.0, -6.0, 40.0, 0.7), "ddvaavd", "velocity_m_s", (0.0, 0.0, 0.7)),
])
def test_generic_setpoints(kind, payload, wanted, field, values) -> None:
    got = setpoints.generic(struct.pack("<B4f", kind, *payload))
    assert modes(got) == wanted
    assert got[field][0] == pytest.approx(values)
    assert got["rate_deg_s"][0, 2] == (0.0 if kind == 7 else 40.0)


def test_old_types_turn_the_other_way() -> None:
    for old in (1, 2, 5):
        payload = (1.0, 2.0, 40.0, 0.5) if old != 1 else (1.0, 2.0, 0.5, 40.0)
        assert setpoints.generic(struct.pack("<B4f", old, *payload))["rate_deg_s"][0, 2] == -40.0


def test_full_state_is_in_thousandths_and_rates_in_rad() -> None:
    q = (0.0, 0.0, math.sin(0.4), math.cos(0.4))
    data = struct.pack("<B9hI3h", 6, 1000, -2000, 500, 100, 0, -100, 9, 8, 7, compress(q), 1000, -500, 250)
    got = setpoints.generic(data)
    assert modes(got) == "aaaddda"
    assert got["position_m"][0] == pytest.approx((1.0, -2.0, 0.5))
    assert got["acceleration_m_s2"][0] == pytest.approx((0.009, 0.008, 0.007))
    assert got["rate_deg_s"][0] == pytest.approx(np.degrees((1.0, -0.5, 0.25)), rel=1e-5)
    assert got["quaternion"][0] == pytest.approx(q, abs=3e-3)


def test_manual_and_remote_control() -> None:
    got = setpoints.generic(struct.pack("<BfffHB", 11, 50.0, -60.0, 10.0, 30000, 1))
    assert modes(got) == "dddvvvd"
    assert got["thrust"][0] == 30000
    got = setpoints.generic(struct.pack("<BB4H", 3, 0, 1750, 1500, 1500, 1500))
    assert modes(got) == "dddaavd"
    assert got["attitude_deg"][0, 0] == -25.0
    assert got["thrust"][0] == pytest.approx(32767.5)


def test_stop_and_unknown_types_are_null_and_broken_ones_nothing() -> None:
    assert modes(setpoints.generic(b"\0")) == "ddddddd"
    assert modes(setpoints.generic(b"\x63abc")) == "ddddddd"
    for broken in (b"", b"\x07abc", struct.pack("<B4f", 7, 1.0, math.nan, 0.0, 0.0), b"\x06abc", b"\x0babc", b"\x03a"):
        assert setpoints.generic(broken) is None
    assert setpoints.RollPitchYawThrust().read(b"short") is None
    assert setpoints.RollPitchYawThrust().read(rpyt(math.inf, 0, 0, 0)) is None


@pytest.fixture
def onboard() -> Onboard:
    made = Onboard(StillVehicle())
    made.vehicle.turning = True
    made.advance(1200)
    return made


def position(z: float) -> Packet:
    return Packet(7, 0, struct.pack("<B4f", 7, 0.0, 0.0, z, 0.0))


def test_the_radio_wins_over_the_high_level_until_it_gives_way(onboard: Onboard) -> None:
    assert onboard.commander.priority == HIGH_LEVEL
    onboard.receive(position(1.0))
    assert onboard.commander.priority == RADIO
    onboard.advance(onboard.tick_ms + 100)
    assert onboard.commander.setpoint["position_m"][0, 2] == 1.0
    onboard.receive(Packet(7, 1, struct.pack("<BI", 0, 0)))
    assert onboard.commander.priority == HIGH_LEVEL
    onboard.advance(onboard.tick_ms + 20)
    assert modes(onboard.commander.setpoint) == "ddddddd"


def test_without_setpoints_it_levels_out_and_then_stops_for_good(onboard: Onboard) -> None:
    onboard.receive(position(1.0))
    start = onboard.tick_ms
    seen: dict[State, int] = {}
    while onboard.tick_ms < start + 3000:
        onboard.advance(onboard.tick_ms + 10)
        seen.setdefault(onboard.supervisor.state, onboard.tick_ms - start)
        if onboard.supervisor.state == State.WARNING_LEVEL_OUT:
            given = onboard.vehicle.stabilizer.setpoint
            assert modes(given) == "ddaaavd"
            assert given["position_m"][0, 2] == 1.0
    assert 500 < seen[State.WARNING_LEVEL_OUT] <= 560
    assert 2000 < seen[State.FREE_FALL] <= 2060
    assert onboard.supervisor.state == State.LOCKED
    assert not onboard.vehicle.stabilizer.loop["allowed"][0]
    onboard.receive(position(1.0))
    onboard.advance(onboard.tick_ms + 100)
    assert onboard.supervisor.state == State.LOCKED


def test_a_setpoint_in_time_ends_the_warning(onboard: Onboard) -> None:
    onboard.receive(position(1.0))
    onboard.advance(onboard.tick_ms + 800)
    assert onboard.supervisor.state == State.WARNING_LEVEL_OUT
    onboard.receive(position(1.0))
    onboard.advance(onboard.tick_ms + 50)
    assert onboard.supervisor.state == State.FLYING


def test_emergency_stop_by_packet_watchdog_and_parameter() -> None:
    for how in ("packet", "watchdog", "parameter"):
        made = Onboard(StillVehicle())
        made.advance(1200)
        assert made.supervisor.motors_allowed
        if how == "parameter":
            made.params.set("stabilizer.stop", 1)
        else:
            made.receive(Packet(6, 1, b"\x03" if how == "packet" else b"\x04"))
        made.advance(made.tick_ms + (1200 if how == "watchdog" else 150))
        assert made.supervisor.state == State.LOCKED, how


def test_it_arms_by_itself_disarms_on_request_and_arms_again(onboard: Onboard) -> None:
    assert onboard.supervisor.armed
    assert onboard.receive(Packet(13, 0, b"\1\0"))[0].data == b"\1\1"
    onboard.advance(onboard.tick_ms + 40)
    assert onboard.supervisor.state == State.RESET
    onboard.advance(onboard.tick_ms + 200)
    assert onboard.supervisor.armed
    assert onboard.supervisor.motors_allowed


def test_tumbled_on_its_back_it_has_crashed_until_turned_and_asked(onboard: Onboard) -> None:
    onboard.advance(onboard.tick_ms + 100)
    assert onboard.supervisor.state == State.FLYING
    loop = onboard.vehicle.stabilizer.loop
    loop["acc_g"][0] = (0.0, 0.0, -1.0)
    onboard.advance(onboard.tick_ms + 200)
    assert onboard.supervisor.state == State.CRASHED
    info = int(onboard.supervisor.info(onboard.high_level.status))
    assert info & 1 << 5
    assert info & 1 << 7
    assert onboard.receive(Packet(13, 0, b"\2"))[0].data == b"\2\0"
    loop["acc_g"][0] = (0.0, 0.0, 1.0)
    onboard.advance(onboard.tick_ms + 100)
    assert onboard.receive(Packet(13, 0, b"\2"))[0].data == b"\2\1"
    onboard.advance(onboard.tick_ms + 200)
    assert onboard.supervisor.motors_allowed


def test_poses_reach_the_filter_and_the_log(onboard: Onboard) -> None:
    onboard.receive(Packet(6, 1, struct.pack("<B7f", 8, 1, 2, 3, 0, 0, 0, 1)))
    s = onboard.vehicle.stabilizer
    assert s.waiting == 1
    assert s.measured["position_m"][0].tolist() == [1, 2, 3]
    assert s.measured["attitude_sd_rad"][0] == pytest.approx(4.5e-3)
    onboard.receive(Packet(6, 0, struct.pack("<3f", 4, 5, 6)))
    onboard.receive(Packet(6, 2, struct.pack("<B3hB3h", 0xE7, 100, 200, 300, 0x11, 1, 1, 1)))
    onboard.receive(Packet(6, 1, struct.pack("<BB3hI", 9, 0xE7, 100, 200, 300, 0xC0000000)))
    assert s.waiting == 4
    for nonsense in (struct.pack("<B7f", 8, math.nan, 0, 0, 0, 0, 0, 1), struct.pack("<B7f", 8, 0, 0, 0, 0, 0, 0, 0)):
        onboard.receive(Packet(6, 1, nonsense))
    assert s.waiting == 4
    assert onboard.localization.last[:3] == pytest.approx((0.1, 0.2, 0.3))
