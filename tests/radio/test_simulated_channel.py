"""The air between: order, delay, what is lost and what is only later; motion capture on the host's clock."""

import struct

import numpy as np
import pytest
from still_vehicle import StillVehicle

from nanobench_tools.errors import InputError
from nanobench_tools.radio.crtp import Packet, pack, parse
from nanobench_tools.radio.mocap.pose_datagram import pack as pack_pose
from nanobench_tools.radio.mocap.pose_datagram import unpack
from nanobench_tools.radio.simulated.channel import RESEND_S, Channel, RadioOptions, repeated
from nanobench_tools.radio.simulated.motion_capture import MocapOptions, MotionCapture
from nanobench_tools.radio.simulated.simulation import Simulation


def test_an_ideal_link_delays_by_its_latency_and_keeps_the_order() -> None:
    air: Channel[int] = Channel(RadioOptions(latency_s=0.01), 1, False)
    for k in range(5):
        air.send(0.001 * k, k, False)
    assert air.due(0.0099) == []
    assert air.due(0.0101) == [0]
    assert air.next_s() == pytest.approx(0.011)
    assert air.due(1.0) == [1, 2, 3, 4]


def test_jitter_has_its_mean_and_never_overtakes() -> None:
    air: Channel[int] = Channel(RadioOptions(latency_s=0.01, jitter_s=0.004, seed=3), 1, False)
    delays = []
    for k in range(3000):
        air.send(float(k), k, False)
        delays.append(air.next_s() - k)
        assert air.due(k + 0.9) == [k]
    assert np.mean(delays) == pytest.approx(0.014, abs=3e-4)
    assert min(delays) >= 0.01
    for k in range(100):
        air.send(5000.0 + 1e-4 * k, k, False)
    assert air.due(6000.0) == list(range(100))


def test_loss_takes_what_nobody_repeats_and_delays_the_rest() -> None:
    air: Channel[int] = Channel(RadioOptions(loss=0.2, seed=1), 1, False)
    for k in range(5000):
        air.send(0.1 * k, k, False)
    assert len(air.due(1e6)) == 5000 - air.lost
    assert air.lost / 5000 == pytest.approx(0.2, abs=0.02)
    sure: Channel[int] = Channel(RadioOptions(loss=0.2, seed=1), 1, False)
    late = 0
    for k in range(5000):
        sure.send(0.1 * k, k, True)
        late += sure.next_s() - 0.1 * k > 0.5 * RESEND_S
        assert sure.due(0.1 * k + 0.09) == [k]
    assert late / 5000 == pytest.approx(0.2, abs=0.02)


def test_what_the_link_repeats() -> None:
    assert repeated(Packet(2, 1, b""))
    assert repeated(Packet(8, 0, b""))
    assert repeated(Packet(5, 1, b""))
    assert repeated(Packet(6, 1, b"\x03"))
    assert repeated(Packet(7, 1, b"\0"))
    assert not repeated(Packet(5, 2, b""))
    assert not repeated(Packet(6, 1, b"\x08"))
    assert not repeated(Packet(3, 0, b""))
    assert not repeated(Packet(7, 0, b""))


@pytest.mark.parametrize("bad", [{"latency_s": -1.0}, {"loss": 1.0}, {"jitter_s": float("nan")},
                                 {"packets_per_s": 1.0}])
def test_impossible_radios_are_refused(bad: dict) -> None:
    with pytest.raises(InputError):
        RadioOptions(**bad)


def linked(**radio) -> Simulation:
    """A still vehicle with nine blocks of 100 Hz running, as in the recordings."""
    made = Simulation(StillVehicle(), 100.0, RadioOptions(**radio), MocapOptions())
    made.post(made.time_s, pack(Packet(5, 1, b"\x05")))
    for block in range(9):
        made.post(made.time_s, pack(Packet(5, 1, bytes([6, block]) + 6 * struct.pack("<BH", 7, block))))
        made.post(made.time_s, pack(Packet(5, 1, bytes([3, block, 1]))))
    return made


def blocks_of(made: Simulation, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """(block, tick) of the log packets that arrive in so many seconds."""
    found = []
    until = made.time_s + seconds
    while made.time_s < until:
        made.post(made.time_s, pack(Packet(15, 0, bytes(9))))
        made.run_until(made.time_s + 0.01)
        packets = [parse(d) for d in made.outgoing(made.time_s)]
        found += [(p.data[0], int.from_bytes(p.data[1:4], "little")) for p in packets if (p.port, p.channel) == (5, 2)]
    return np.array([b for b, _ in found]), np.array([t for _, t in found])


def test_a_narrow_link_makes_the_holes_of_the_recordings() -> None:
    made = linked(packets_per_s=793.0)  # a hundred of them are echoes
    block, tick = blocks_of(made, 10.0)
    rates = np.bincount(block) / 10.0
    assert rates == pytest.approx(77.0, abs=4.0)
    assert made.down.full > 1000
    for which in range(9):
        assert (np.diff(tick[block == which]) % 10 == 0).all()
        assert np.diff(tick[block == which]).max() > 10


def test_a_link_that_hangs_delivers_bursts_and_drops_what_the_queue_cannot_hold() -> None:
    made = linked(hangs_per_s=2.0, hang_s=0.06, seed=5)
    made.run_until(made.time_s + 0.5)
    made.outgoing(made.time_s)
    late, ticks = [], []
    until = made.time_s + 8.0
    while made.time_s < until:
        made.post(made.time_s, pack(Packet(15, 0, bytes(9))))
        made.run_until(made.time_s + 0.002)
        packets = [parse(d) for d in made.outgoing(made.time_s)]
        for p in packets:
            if (p.port, p.channel) == (5, 2) and p.data[0] == 4:
                ticks.append(int.from_bytes(p.data[1:4], "little"))
                late.append(made.time_s - made.time_of(ticks[-1]))
    assert min(late) >= -1e-3
    assert np.median(late) < 0.003
    assert np.mean(np.array(late) > 0.01) > 0.02
    assert max(late) > 0.04
    assert max(np.diff(ticks)) >= 30
    assert made.down.full > 100


def test_both_directions_hang_at_the_same_time() -> None:
    options = RadioOptions(hangs_per_s=3.0, hang_s=0.05, seed=2)
    one, other = (Channel(options, direction, False, 100.0) for direction in (1, 2))
    times = 100.0 + np.arange(0.0, 10.0, 0.003)
    passed = []
    for air in (one, other):
        for k, t in enumerate(times):
            air.send(float(t), k, False)
        passed.append([len(air.due(float(t) + 0.0015)) for t in times])
    assert passed[0] == passed[1]


def test_a_wide_link_loses_nothing() -> None:
    made = linked()
    block, tick = blocks_of(made, 3.0)
    assert made.down.full == made.down.lost == 0
    assert np.bincount(block).min() >= 299
    assert set(np.diff(tick[block == 4])) == {10}


def test_the_vehicles_clock_drifts_against_the_hosts() -> None:
    made = Simulation(StillVehicle(), 50.0, RadioOptions(), MocapOptions(), drift_ppm=5000.0)
    made.run_until(50.0 + 15.0)
    assert made.onboard.tick_ms - 1000 == pytest.approx(15_075, abs=1)
    assert made.time_of(made.tick_at(123.4)) == pytest.approx(123.4, abs=1.1e-3)


def test_a_world_that_stood_still_goes_on_where_it_was() -> None:
    made = Simulation(StillVehicle(), 50.0, RadioOptions(), MocapOptions())
    made.run_until(51.0)
    made.mocap.due(1e9)
    made.stand_still_until(57.3)
    assert made.onboard.tick_ms == made.tick_at(57.3) == 2000
    made.run_until(57.4)
    assert made.onboard.tick_ms == 2100
    times = [unpack(d).time_s for d in made.mocap.due(1e9)]
    assert 57.3 - 1e-6 <= times[0] <= 57.31 + 1e-6
    assert np.diff(times) == pytest.approx(0.01)
    assert 9 <= len(times) <= 11


def test_poses_come_at_their_rate_with_their_noise_and_delay() -> None:
    cameras = MotionCapture(MocapOptions(rate_hz=50.0, noise_m=0.001, noise_rad=0.0, delay_s=0.03, seed=4), 10.0)
    place, still = np.array([1.0, 2.0, 3.0]), np.array([0.0, 0.0, 0.0, 1.0])
    poses = []
    for k in range(2000):
        assert cameras.next_s == pytest.approx(10.0 + (k + 1) / 50.0)
        cameras.expose(place, still)
        assert cameras.sent_s() == pytest.approx(cameras.next_s - 0.02 + 0.03)
        poses += [unpack(d) for d in cameras.due(1e9)]
    error = np.array([p.position_m for p in poses]) - place
    assert error.std() == pytest.approx(0.001, rel=0.05)
    assert poses[0].time_s == pytest.approx(10.02)
    assert poses[0].quaternion == pytest.approx(still)


def test_a_pose_datagram_has_its_size() -> None:
    assert len(pack_pose(1.0, np.zeros(3), np.zeros(4))) == 36
    with pytest.raises(InputError, match="35 bytes"):
        unpack(bytes(35))


def test_the_same_seed_is_the_same_air() -> None:
    for seed in (1, 2):
        runs = [blocks_of(linked(loss=0.1, jitter_s=0.003, seed=seed), 1.0)[1].tolist() for _ in range(2)]
        assert runs[0] == runs[1]
