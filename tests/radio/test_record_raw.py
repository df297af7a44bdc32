"""Blocks, raw packets and clocks: hand-made cases, invented links with known delays, files cut anywhere."""

import struct
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from nanobench_tools.errors import InputError
from nanobench_tools.radio.align import align, ticks_of
from nanobench_tools.radio.blocks import Block, default_blocks, read_blocks, resolve
from nanobench_tools.radio.packets import (
    FLUSH_S,
    LOG,
    LOOP,
    NOTE,
    POSE,
    Packets,
    PacketWriter,
    Record,
    read_packets,
    repair,
)
from nanobench_tools.radio.record_export import loop_of
from nanobench_tools.sources.nanobench_columns import STREAMS

FLOATS = {v: "float" for block in default_blocks() for v in block.variables}
STORED = FLOATS | {f"motor.m{i}": "uint16_t" for i in (1, 2, 3, 4)} | {"supervisor.info": "uint16_t"}


def test_default_blocks_are_the_streams_of_the_format_and_fit():
    found = resolve(default_blocks(), STORED, "x")
    assert {block.name for block in found} == set(STREAMS) - {"mocap"}
    assert max(block.layout.size for block in found) == 24


@pytest.mark.parametrize(("text", "words"), [
    ("blocks: {a: {period_ms: 10, variables: [acc.x, acc.y, acc.z, gyro.x, gyro.y, gyro.z, pm.vbat]}}", "28 bytes"),
    ("blocks: {a: {period_ms: 15, variables: [acc.x]}}", "multiple of 10"),
    ("blocks: {a: {period_ms: 10, variables: []}}", "no variables"),
    ("blocks: {a: {period_ms: 10, variables: [accx]}}", "group.name"),
    ("blocks: {a: {period_ms: 10, variables: [acc.x, acc.x]}}", "twice"),
    ("blocks: {a: {period_ms: 10, variables: [{acc.x: double}]}}", "type 'double'"),
    ("blocks: {a: {rate: 10, variables: [acc.x]}}", "period_ms and variables"),
    ("blocks: []", "no blocks"), ("blocks: {a: [", "no YAML"), ("", "no blocks"),
    ("blocks: {" + ", ".join(f"b{i}: {{variables: [acc.x]}}" for i in range(17)) + "}", "17 blocks"),
])
def test_a_file_of_blocks_that_cannot_be_is_one_line(tmp_path, text, words):
    path = tmp_path / "blocks.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        resolve(read_blocks(path), STORED, "x")


def test_a_variable_that_the_vehicle_lacks_is_named():
    with pytest.raises(InputError, match=r"no log variable pm\.vbat"):
        resolve(default_blocks(), {k: v for k, v in STORED.items() if k != "pm.vbat"}, "udp://x")


def test_types_are_those_of_the_file_else_those_on_board(tmp_path):
    path = tmp_path / "blocks.yaml"
    path.write_text("blocks: {a: {period_ms: 100, variables: [motor.m1, {acc.x: FP16}]}}")
    block, = resolve(read_blocks(path), STORED, "x")
    assert block.types == ("uint16_t", "FP16")
    assert np.frombuffer(block.layout.pack(500, 0.5), block.dtype)[0].item() == (500, 0.5)
    assert Block.from_json(block.to_json()) == block


def test_raw_packets_come_back_and_a_file_may_end_anywhere(tmp_path):
    path = tmp_path / "a.packets"
    with PacketWriter(path, {"uri": "x"}) as writer:
        for k in range(50):
            writer.write(LOG, k % 3, 100.0 + k, bytes(range(k % 27)))
        writer.sheet(200.0, {"a": 1})
        writer.note(201.0, "ground")
    whole = read_packets(path)
    assert whole.header == {"uri": "x"}
    assert not whole.cut
    assert [len(r.payload) for r in whole.of(LOG)] == [k % 27 for k in range(50)]
    assert whole.sheet == {"a": 1}
    assert whole.of(NOTE, 0)[0].payload == b"ground"
    data = path.read_bytes()
    start = len(data) - 200
    for end in range(start, len(data)):
        path.write_bytes(data[:end])
        assert len(read_packets(path).records) <= 52
    path.write_bytes(data[:-30] + bytes([data[-30] ^ 1]) + data[-29:])
    assert "22 bytes were left out" in read_packets(path).cut
    for bad in (b"", b"hello", data[:30]):
        path.write_bytes(bad)
        with pytest.raises(InputError):
            read_packets(path)


def test_what_a_killed_program_wrote_before_the_last_tenth_of_a_second_is_kept(tmp_path):
    """Five records are on the file though the program goes on and never closes it."""
    path = tmp_path / "a.packets"
    code = ("import sys, time; from pathlib import Path\n"
            "from nanobench_tools.radio.packets import *\n"
            f"w = PacketWriter(Path({str(path)!r}), {{}})\n"
            "for k in range(5):\n    w.write(LOG, k, time.time(), b'x' * 20)\n"
            "sys.stdin.read()\n")
    assert FLUSH_S < 0.1
    command = [sys.executable, "-c", code]
    with subprocess.Popen(command, cwd=Path(__file__).parents[2], stdin=subprocess.PIPE) as process:
        until = time.monotonic() + 60.0  # a busy machine is slow, not wrong
        while len(written(path)) < 5 and time.monotonic() < until:
            time.sleep(0.02)
        process.kill()
    assert [(r.number, r.payload) for r in written(path)] == [(k, b"x" * 20) for k in range(5)]


def written(path: Path) -> list[Record]:
    """Records of a file that is being written."""
    with suppress(InputError):
        return read_packets(path).records
    return []


@pytest.mark.parametrize("drift", [0.0, 40e-6, -25e-6])
def test_ticks_are_put_on_the_hosts_clock(drift):
    rng = np.random.default_rng(1)
    taken = np.sort(rng.uniform(0.0, 30.0, 9000))
    tick = np.floor(1e3 * (7.0 + taken * (1.0 + drift))) / 1e3
    arrival = 1.7e9 + taken + 0.010 + rng.exponential(0.003, len(taken)) * (rng.uniform(size=len(taken)) < 0.4)
    trips = 0.020 + rng.exponential(0.002, 300)
    found = align(arrival, tick, trips)
    error = found.host(tick) - 1.7e9 - taken  # a tick is up to 1 ms before
    assert np.abs(error + 0.0005).max() < 0.0012
    assert np.abs(np.median(error) + 0.0005) < found.ci95_s < 0.001
    assert found.rate == pytest.approx(1.0 - drift, abs=5e-6)
    assert found.bound_s == pytest.approx(0.011, abs=2e-4)


def test_an_unequal_way_is_within_the_bound_and_outside_the_interval():
    tick = np.arange(0.0, 20.0, 0.01)
    found = align(tick + 0.018, tick, np.full(50, 0.020))  # 2 ms up, 18 ms down
    error = float(np.abs(found.host(tick) - tick).max())
    assert error == pytest.approx(0.008, abs=1e-4)
    assert found.ci95_s < error < found.bound_s


def test_ticks_that_wrap_go_on():
    late = 2**24 - 1500.0
    ticks = [(late + np.arange(0.0, 4000.0, 10.0)) % 2**24, (late + 5.0 + np.arange(0.0, 4000.0, 10.0)) % 2**24]
    arrivals = [np.arange(0.0, 4.0, 0.01) + 0.001 * i for i in range(2)]
    for one in ticks_of(ticks, arrivals):
        np.testing.assert_allclose(np.diff(one), 0.01, atol=1e-9)


def test_too_few_packets_are_refused():
    with pytest.raises(InputError, match="3 log packets"):
        align(np.arange(3.0), np.arange(3.0), np.array([0.01]))


def test_layout_is_the_firmwares():
    block = Block("a", 10, ("acc.x", "motor.m1"), ("float", "uint16_t"))
    assert struct.pack("<fH", 1.5, 7) == block.layout.pack(1.5, 7)


@pytest.mark.parametrize("seed", range(20))
def test_twenty_random_bytes_of_damage_lose_a_fifth_of_a_second_at_most(tmp_path, seed):
    """A stream of 100 poses and 300 log packets a second; the bytes are in one place."""
    path, rng = tmp_path / "a.packets", np.random.default_rng(seed)
    with PacketWriter(path, {"uri": "x"}) as writer:
        for k in range(500):
            writer.write(POSE, 0, 1e9 + 0.01 * k, rng.bytes(36))
            for number in range(3):
                writer.write(LOG, number, 1e9 + 0.01 * k + 0.002 * number, rng.bytes(27))
    whole, data = read_packets(path).records, bytearray(path.read_bytes())
    at = int(rng.integers(200, len(data) - 200))
    data[at:at + 20] = rng.bytes(20)
    path.write_bytes(data)
    found = read_packets(path)
    assert "damaged place" in found.cut
    assert set(found.records) < set(whole)
    times = np.array([r.time_s for r in found.records])
    assert np.diff(times).max() < 0.2
    assert len(whole) - len(found.records) <= 3
    repair(path, tmp_path / "b.packets")
    again = read_packets(tmp_path / "b.packets")
    assert again.records == found.records
    assert not again.cut


def test_damage_everywhere_still_gives_what_is_whole(tmp_path):
    path, rng = tmp_path / "a.packets", np.random.default_rng(1)
    with PacketWriter(path, {"uri": "x"}) as writer:
        for k in range(1000):
            writer.write(LOG, 0, 1e9 + 0.01 * k, rng.bytes(27))
    data = bytearray(path.read_bytes())
    for at in rng.integers(100, len(data), 20):
        data[at] ^= 0xFF
    path.write_bytes(data)
    assert 975 < len(read_packets(path).records) < 1000


def test_the_delay_of_the_loop_is_recorded_and_summarized():
    records = [Record(LOOP, 0, 100.0 + 0.01 * k, struct.pack("<d", 1e-4 * k)) for k in range(101)]
    found = loop_of(Packets({}, records, ""))["loop"]
    assert found == {"ticks": 101, "late_p50_ms": 5.0, "late_p99_ms": 9.9, "late_most_ms": 10.0}
    assert loop_of(Packets({}, [], "")) == {}


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """Twenty random bytes somewhere."""
    at = int(rng.integers(0, len(data) - 20))
    return data[:at] + rng.bytes(20) + data[at + 20:]


def test_twenty_random_bytes_lose_at_most_a_fifth_of_a_second(tmp_path):
    """300 damaged files: nothing is made up, and the records around the damage are all there."""
    path = tmp_path / "a.packets"
    rng = np.random.default_rng(3)
    with PacketWriter(path, {"uri": "x", "blocks": ["b" * 90]}) as writer:
        for k in range(500):  # as a flight has: 3 blocks every 10 ms
            writer.write(LOG, k % 3, 100.0 + 0.01 * (k // 3), rng.bytes(24))
    data, whole = path.read_bytes(), read_packets(path).records
    known = set(whole)
    for _ in range(300):
        broken = damaged(data, rng)
        path.write_bytes(broken)
        found = read_packets(path)
        assert found.header == {"uri": "x", "blocks": ["b" * 90]}
        assert set(found.records) <= known
        times = np.array([100.0, *(r.time_s for r in found.records), whole[-1].time_s])
        assert np.diff(times).max() < 0.2
        assert len(whole) - len(found.records) <= 3
