"""Services of the simulated Crazyflie against packets packed by hand from the protocol's description."""

import struct
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from still_vehicle import StillVehicle

from nanobench_tools.radio.crtp import Packet, pack, parse
from nanobench_tools.radio.simulated.onboard_services import Build, Onboard
from nanobench_tools.radio.simulated.quaternion32 import compress, decompress
from nanobench_tools.radio.simulated.toc import Contents


@pytest.fixture
def onboard() -> Onboard:
    made = Onboard(StillVehicle())
    made.advance(1500)
    return made


def ask(onboard: Onboard, port: int, channel: int, data: bytes) -> list[bytes]:
    """The answers' data; all come back on the port and channel asked."""
    answers = onboard.receive(Packet(port, channel, data))
    assert all((a.port, a.channel) == (port, channel) for a in answers)
    return [a.data for a in answers]


def table(onboard: Onboard, port: int) -> dict[str, tuple[int, int]]:
    """{group.name: (index, type byte)} as a client fetches it."""
    count, checksum = struct.unpack("<HI", ask(onboard, port, 0, b"\x03")[0][1:7])
    found, items = {}, []
    for i in range(count):
        answer = ask(onboard, port, 0, struct.pack("<BH", 2, i))[0]
        assert answer[:3] == struct.pack("<BH", 2, i)
        assert len(answer) <= 30
        items.append(answer[3:])
        group, name, end = answer[4:].split(b"\0")
        assert end == b""
        found[f"{group.decode()}.{name.decode()}"] = (i, answer[3])
    assert len(found) == count
    assert checksum == zlib.crc32(b"".join(items))
    return found


def test_header_bytes_carry_port_and_channel_and_ignore_the_reserved_bits() -> None:
    assert pack(Packet(5, 2, b"ab")) == b"\x5eab"
    assert parse(b"\x5eab") == parse(b"\x52ab") == Packet(5, 2, b"ab")
    assert parse(b"\xff") is None
    assert parse(b"\xf3") is None
    assert parse(b"") is None
    assert parse(bytes(32)) is None


def test_link_and_platform_say_who_this_is(onboard: Onboard) -> None:
    assert ask(onboard, 15, 1, b"\0")[0] == b"Bitcraze Crazyflie" + bytes(12)
    echo = struct.pack("<Bd", 0, 123.456)
    assert ask(onboard, 15, 0, echo) == [echo]
    assert ask(onboard, 15, 2, b"sink") == []
    assert ask(onboard, 13, 1, b"\0") == [struct.pack("<Bi", 0, 10)]
    assert ask(onboard, 13, 1, b"\1") == [b"\x012025.12.1"]
    assert ask(onboard, 13, 0, b"\1\0") == [b"\1\1"]


def test_both_tables_are_fetched_whole_and_hold_what_recordings_need(onboard: Onboard) -> None:
    logs, params = table(onboard, 5), table(onboard, 2)
    assert ask(onboard, 5, 0, b"\x03")[0][7:] == bytes([16, 128])
    recorded = [f"{g}.{n}" for g, names in {
        "acc": "x y z", "gyro": "x y z", "motor": "m1 m2 m3 m4", "stateEstimate": "x y z vx vy vz ax ay az roll pitch "
        "yaw qx qy qz qw", "ctrltarget": "x y z yaw", "controller": "roll pitch yaw cmd_thrust", "pm": "vbat",
        "stateEstimateZ": "x y z quat rateRoll", "kalman": "stateX varX", "supervisor": "info", "locSrv": "x qw",
    }.items() for n in names.split()]
    assert set(recorded) <= set(logs)
    assert logs["motor.m1"][1] == 2
    assert logs["stateEstimate.x"][1] == 7
    assert {"stabilizer.controller", "stabilizer.estimator", "kalman.resetEstimation", "locSrv.extPosStdDev",
            "flightmode.stabModeRoll", "pid_rate.roll_kp", "ctrlMel.mass", "commander.enHighLevel"} <= set(params)
    assert params["locSrv.extPosStdDev"][1] & 0x0F == 0x06
    assert params["pid_rate.roll_kp"][1] & 0x10
    assert params["firmware.revision0"][1] & 0x4F == 0x4A
    assert ask(onboard, 5, 0, struct.pack("<BH", 2, 9999)) == [b"\x02"]


def test_a_build_may_lack_variables_and_speak_another_version() -> None:
    whole = Onboard(StillVehicle())
    other = Onboard(StillVehicle(), Build(protocol_version=3, without=("motor", "pm.vbat")))
    assert ask(other, 13, 1, b"\0") == [struct.pack("<Bi", 0, 3)]
    assert set(table(whole, 5)) - set(table(other, 5)) == {
        "pm.vbat", *(f"motor.m{i}" for i in range(1, 5)), *(f"motor.m{i}req" for i in range(1, 5))}


def test_the_checksum_changes_with_the_table() -> None:
    one, other = Contents(["a.b"], [7]), Contents(["a.b"], [6])
    assert one.answer(b"\3") != other.answer(b"\3")
    with pytest.raises(ValueError, match="24 characters"):
        Contents(["group_of_many_letters.and_a_name"], [7])


def test_a_parameter_is_read_written_and_echoed(onboard: Onboard) -> None:
    index, _ = table(onboard, 2)["pid_rate.roll_kp"]
    which = struct.pack("<H", index)
    assert ask(onboard, 2, 1, which) == [which + b"\0" + struct.pack("<f", 250.0)]
    new = which + struct.pack("<f", 123.5)
    assert ask(onboard, 2, 2, new) == [new]
    assert onboard.vehicle.stabilizer.gains[0]["block"][0, 9, 0] == 123.5
    assert ask(onboard, 2, 2, new[:-1]) == []
    assert ask(onboard, 2, 2, which + struct.pack("<f", float("nan"))) == []
    assert ask(onboard, 2, 1, struct.pack("<H", 60000)) == [struct.pack("<HB", 60000, 2)]


def test_a_read_only_parameter_is_not_answered_when_written(onboard: Onboard) -> None:
    index, _ = table(onboard, 2)["firmware.revision0"]
    assert ask(onboard, 2, 2, struct.pack("<HI", index, 7)) == []
    assert onboard.params.value("firmware.revision0") != 7


def test_persistent_parameters_are_stored_told_and_cleared(onboard: Onboard) -> None:
    index, _ = table(onboard, 2)["pid_rate.roll_kp"]
    which, default = struct.pack("<H", index), struct.pack("<f", 250.0)
    assert ask(onboard, 2, 3, b"\x02" + which) == [b"\x02" + which + b"\1"]
    assert ask(onboard, 2, 3, b"\x06" + which) == [b"\x06" + which + default]
    assert ask(onboard, 2, 3, b"\x04" + which) == [b"\x04" + which + b"\0" + default]
    ask(onboard, 2, 2, which + struct.pack("<f", 99.0))
    assert ask(onboard, 2, 3, b"\x03" + which) == [b"\x03" + which + b"\0"]
    assert ask(onboard, 2, 3, b"\x04" + which) == [b"\x04" + which + b"\1" + default + struct.pack("<f", 99.0)]
    assert ask(onboard, 2, 3, b"\x05" + which) == [b"\x05" + which + b"\0"]
    assert ask(onboard, 2, 3, b"\x04" + which) == [b"\x04" + which + b"\0" + default]
    other, _ = table(onboard, 2)["stabilizer.estimator"]
    assert ask(onboard, 2, 3, struct.pack("<BH", 2, other))[0][3:] == b"\0"


def test_a_parameter_can_be_set_by_name(onboard: Onboard) -> None:
    head = b"\0flightmode\0stabModeRoll\0"
    assert ask(onboard, 2, 3, head + b"\x08\0") == [head + b"\0"]
    assert onboard.rpyt.mode.stabModeRoll == 0
    assert ask(onboard, 2, 3, b"\0no\0such\0\x08\0") == [b"\0no\0such\0\x02"]


def test_a_log_block_runs_with_time_stamps_and_packed_values(onboard: Onboard) -> None:
    logs = table(onboard, 5)
    loop = onboard.vehicle.stabilizer.loop
    loop["estimate"]["position_m"][0] = (1.5, -2.25, 0.5)
    loop["motor"][0] = (1, 2, 3, 65535)
    onboard.receive(Packet(15, 0, b"\0" * 9))
    items = [(7, "stateEstimate.x"), (8, "stateEstimate.y"), (2, "motor.m4"), (1, "stateEstimate.x")]
    data = b"\x06\x05" + b"".join(struct.pack("<BH", 0x70 | kind, logs[name][0]) for kind, name in items)
    assert ask(onboard, 5, 1, data + b"\x07") == [b"\x06\x05\0"]
    assert ask(onboard, 5, 1, data) == [b"\x06\x05\x11"]
    assert ask(onboard, 5, 1, b"\x03\x05\x02") == [b"\x03\x05\0"]
    start = onboard.tick_ms
    sent = [s for s in onboard.advance(start + 100) if s.packet.port == 5]
    assert [s.tick_ms for s in sent] == [start + 20, start + 40, start + 60, start + 80, start + 100]
    block, low, high, x, y, motor, small = struct.unpack("<BHBfeHB", sent[0].packet.data)
    assert (block, low | high << 16) == (5, start + 20)
    assert (x, y, motor, small) == (1.5, -2.25, 65535, 1)
    assert ask(onboard, 5, 1, b"\x04\x05") == [b"\x04\x05\0"]
    assert onboard.advance(start + 200) == []
    assert ask(onboard, 5, 1, b"\x02\x05") == [b"\x02\x05\0"]
    assert ask(onboard, 5, 1, b"\x03\x05\x01") == [b"\x03\x05\x02"]


def test_a_block_cannot_hold_more_than_a_packet(onboard: Onboard) -> None:
    item = struct.pack("<BH", 7, 0)
    assert ask(onboard, 5, 1, b"\x06\x01" + 6 * item) == [b"\x06\x01\0"]
    assert ask(onboard, 5, 1, b"\x07\x01" + item) == [b"\x07\x01\x07"]
    assert ask(onboard, 5, 1, b"\x06\x02" + struct.pack("<BH", 7, 9999)) == [b"\x06\x02\x02"]
    assert ask(onboard, 5, 1, b"\x05\x00") == [b"\x05\0\0"]
    for block in range(16):
        assert ask(onboard, 5, 1, bytes([6, block]) + item) == [bytes([6, block, 0])]
    assert ask(onboard, 5, 1, b"\x06\x63" + item) == [b"\x06\x63\x0c"]


def test_logs_stop_a_second_after_the_last_packet(onboard: Onboard) -> None:
    ask(onboard, 5, 1, b"\x06\0" + struct.pack("<BH", 7, 0))
    ask(onboard, 5, 1, b"\x03\0\x01")
    start = onboard.tick_ms
    sent = [s for s in onboard.advance(start + 3000) if s.packet.port == 5]
    assert sent[-1].tick_ms - start == 1000


def test_memory_holds_trajectories_and_refuses_the_rest(onboard: Onboard) -> None:
    assert ask(onboard, 4, 0, b"\1") == [b"\1\1"]
    assert ask(onboard, 4, 0, b"\2\0") == [b"\2\0\x12" + struct.pack("<I", 4096) + bytes(8)]
    where = struct.pack("<BI", 0, 132)
    assert ask(onboard, 4, 2, where + b"hello") == [where + b"\0"]
    assert ask(onboard, 4, 1, where + b"\x05") == [where + b"\0hello"]
    beyond = struct.pack("<BI", 0, 4090)
    assert ask(onboard, 4, 1, beyond + b"\x18") == [beyond + b"\x05"]


def test_the_console_breaks_lines_into_packets(onboard: Onboard) -> None:
    onboard.console.say("a line that is longer than one packet")
    data = [p.data for p in onboard.console.take()]
    assert b"".join(data) == b"a line that is longer than one packet\n"
    assert all(len(d) <= 30 for d in data)


@given(st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(lambda q: np.linalg.norm(q) > 0.1))
def test_quaternions_survive_32_bits(values: list[float]) -> None:
    q = np.array(values) / np.linalg.norm(values)
    back = np.array(decompress(compress(q)))
    back = back if back @ q > 0.0 else -back
    assert np.abs(back - q).max() < 3e-3


def test_the_identity_has_the_published_bits() -> None:
    assert compress((0.0, 0.0, 0.0, 1.0)) == 0xC0000000


@settings(max_examples=300, deadline=None)
@given(st.integers(0, 15), st.integers(0, 3), st.binary(max_size=30))
def test_no_packet_breaks_it(port: int, channel: int, data: bytes) -> None:
    made = _FUZZED
    answers = made.receive(Packet(port, channel, data))
    assert all(len(a.data) <= 30 for a in answers)
    made.advance(made.tick_ms + 1)
    assert ask(made, 13, 1, b"\0") == [struct.pack("<Bi", 0, 10)]


_FUZZED = Onboard(StillVehicle())


@pytest.mark.slow
def test_twenty_thousand_random_packets_leave_it_answering() -> None:
    rng = np.random.default_rng(1)
    made = Onboard(StillVehicle())
    ports = [0, 2, 3, 4, 5, 6, 7, 8, 13, 15]
    for _ in range(20_000):
        size = int(rng.integers(0, 31))
        data = rng.integers(0, 256, size, dtype=np.uint8).tobytes()
        if size and rng.random() < 0.7:
            data = bytes([int(rng.integers(0, 14))]) + data[1:]  # a command that exists
        port = int(rng.choice(ports)) if rng.random() < 0.9 else int(rng.integers(0, 16))
        answers = made.receive(Packet(port, int(rng.integers(0, 4)), data))
        assert all(len(a.data) <= 30 for a in answers)
        if rng.random() < 0.05:
            made.advance(made.tick_ms + int(rng.integers(1, 30)))
    assert ask(made, 13, 1, b"\0") == [struct.pack("<Bi", 0, 10)]
    assert len(table(made, 5)) == len(made.log)
