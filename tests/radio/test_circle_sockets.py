"""Through sockets and in real time: the command line against a served vehicle, and what a kill -9 leaves."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from controllers.plants.served_vehicle import served
from nanobench_tools.cli.main import main
from nanobench_tools.radio.fly.stop_socket import path_of
from nanobench_tools.radio.packets import read_packets
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.commander import RADIO
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie
from nanobench_tools.radio.simulated.supervisor import State

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
GENTLY_M_S = 1.8
"""A fall from a metre ends with 4.4 m/s."""


@pytest.fixture(scope="module")
def server():
    vehicle = SimulatedCrazyflie(served(), "127.0.0.1", 0, radio=RadioOptions(latency_s=0.002))
    with vehicle:
        yield vehicle


def mocap(server: SimulatedCrazyflie) -> str:
    return "simulated://{}:{}".format(*server.mocap_address)


def test_record_and_a_second_client(server, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("nanobench_tools.radio.vehicle_link.ANSWER_S", 1.0)
    first = subprocess.Popen([sys.executable, "-m", "nanobench_tools.cli.main", "record", "--uri", server.uri,
                              "--mocap", mocap(server), "--seconds", "60", "--out", str(tmp_path / "first"), "--quiet"],
                             cwd=ROOT)
    raw = wait_for_file(tmp_path / "first")
    before = len(read_packets(raw).records)
    try:
        assert main(["record", "--uri", server.uri, "--seconds", "3", "--out", str(tmp_path / "second")]) == 2
        assert "not connected to another program" in capsys.readouterr().err
    finally:
        first.kill()
        first.wait()
    assert len(read_packets(raw).records) > before
    has_gone(server)
    assert main(["record", "--uri", server.uri, "--mocap", mocap(server), "--seconds", "2", "--out", str(tmp_path),
                 "--quiet"]) == 0
    assert len(list(tmp_path.glob("*.csv"))) == 1
    assert len(list(tmp_path.glob(".raw/*/imu.parquet"))) == 1


def has_gone(server: SimulatedCrazyflie) -> None:
    """Waits until the vehicle has noticed that its client has gone."""
    until = time.monotonic() + 60.0
    while server._client is not None and time.monotonic() < until:
        time.sleep(0.02)


def wait_for_file(folder: Path, seconds: float = 120.0) -> Path:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        found = [p for p in folder.glob(".raw/*.packets") if p.stat().st_size > 30_000]
        if found:
            return found[0]
        time.sleep(0.05)
    raise AssertionError(f"no recording in {folder} after {seconds} s")


FLIES = """
import sys
from nanobench_tools.cli.flights.flight_controllers import pilot_for
from nanobench_tools.radio.fly.flight_plan import chosen_path
from nanobench_tools.radio.fly.session import Request, fly_session
from nanobench_tools.radio.mocap.mocap_sources import pose_source
from nanobench_tools.radio.fly.safety import Limits
uri, mocap = sys.argv[1:]
busy = Limits((-9.0, 9.0) * 3, stale_s=9.0, silent_s=9.0, overrun_s=9.0, late_ticks=10**6, tilt_deg=180.0)
print(fly_session(Request(chosen_path("circle", 0.5, 0.2, 60.0), pilot_for("onboard_pid", None, None), busy, uri,
                          pose_source(mocap, uri), ())).outcome.stop, file=sys.stderr)
"""
"""A flight that does not end because this machine has other things to do."""


def killed_in_the_air(server: SimulatedCrazyflie) -> str:
    """Kills a program once it has streamed for a second; "" or why it did not come to that."""
    program = subprocess.Popen([sys.executable, "-c", FLIES, server.uri, mocap(server)], cwd=ROOT,
                               stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 90.0
    while time.monotonic() < until and program.poll() is None:
        onboard = server.simulation.onboard  # another one if the vehicle had to be switched on again
        if onboard.vehicle.true_pose()[0][2] > 0.6 and onboard.commander.priority == RADIO:
            time.sleep(0.5)
            break
        time.sleep(0.02)
    flew = program.poll() is None
    program.kill()
    said = program.communicate()[1]
    return "" if flew else said[-300:]


def test_kill_9_in_the_air_lands_the_vehicle(server):
    """The companion process takes over within the two seconds of the vehicle's watchdog."""
    for _ in range(3):  # checks before take-off do refuse to fly from a machine that is too busy
        has_gone(server)
        said = killed_in_the_air(server)
        if not said:
            break
    assert not said
    onboard, until = server.simulation.onboard, time.monotonic() + 60.0
    high, sank = onboard.vehicle.true_pose()[0][2], 0.0
    end = onboard.tick_ms + 9000
    while onboard.tick_ms < end and time.monotonic() < until and onboard.vehicle.true_pose()[0][2] > 0.03:
        sank = max(sank, -float(onboard.vehicle.true_pose()[1][2]))
        assert onboard.supervisor.state != State.LOCKED
        time.sleep(0.005)
    print("killed at", high, "sank with", sank)
    assert high > 0.3
    assert sank < GENTLY_M_S
    assert onboard.vehicle.true_pose()[0][2] < 0.05
    while path_of(server.uri).exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not path_of(server.uri).exists()
