"""What cflib's own examples use beside connecting, logging and the motion commander: each class against the vehicle."""

import threading
import warnings
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from cflib.crazyflie.log import LogConfig
from cflib.crazyflie.mem import MemoryElement, Poly4D
from cflib.crazyflie.swarm import CachedCfFactory, Swarm
from cflib.crazyflie.syncLogger import SyncLogger
from cflib.localization.param_io import ParamFileManager
from cflib.positioning import position_hl_commander
from cflib.positioning.position_hl_commander import PositionHlCommander
from cflib.utils import reset_estimator
from cflib.utils.param_file_helper import ParamFileHelper
from cflib_world import WorldTime, linked_to, until
from still_vehicle import StillVehicle

from nanobench_tools.radio.simulated.onboard_services import Build
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie
from nanobench_tools.radio.simulated.supervisor import State

GAIN = "pid_rate.roll_kp"
pytestmark = pytest.mark.usefixtures("cflib_drivers")


@pytest.fixture(scope="module")
def served():
    with SimulatedCrazyflie(StillVehicle()) as vehicle:
        yield vehicle


@pytest.fixture
def linked(served):
    with linked_to(served) as link:
        yield link


def block(name: str, period_ms: int, *variables: str) -> LogConfig:
    made = LogConfig(name, period_ms)
    for variable in variables:
        made.add_variable(variable)
    return made


def test_sync_logger_gives_blocks_one_by_one_and_ends_with_the_link(served, linked) -> None:
    blocks = [block("fast", 10, "stabilizer.roll", "acc.z"), block("slow", 100, "pm.vbat")]
    found: dict[str, list[int]] = {"fast": [], "slow": []}
    with SyncLogger(linked, blocks) as logger:
        for tick, values, which in logger:
            found[which.name].append(tick)
            assert set(values) == ({"stabilizer.roll", "acc.z"} if which.name == "fast" else {"pm.vbat"})
            if len(found["slow"]) == 3:
                break
    assert set(np.diff(found["fast"])) == {10}
    assert set(np.diff(found["slow"])) == {100}
    logger = SyncLogger(linked, block("last", 10, "acc.z"))
    logger.connect()
    next(logger)
    closing = threading.Timer(0.2, linked.close_link)
    closing.start()
    assert all(values.keys() == {"acc.z"} for _, values, _ in logger)  # and it ends
    closing.join()


def answered(ask, *given) -> object:
    """What a call of cflib tells its callback at last."""
    told: list = []
    ask(*given, lambda name, value: told.append(value))
    assert until(lambda: told)
    return told[0]


def test_a_parameter_is_stored_looked_up_and_cleared(served, linked, tmp_path: Path) -> None:
    parameters = linked.cf.param
    assert answered(parameters.get_default_value, GAIN) == 250.0
    assert answered(parameters.persistent_get_state, GAIN) == (False, 250.0, None)
    parameters.set_value(GAIN, 260.0)
    assert answered(parameters.persistent_store, GAIN) is True
    state = answered(parameters.persistent_get_state, GAIN)
    assert state == (True, 250.0, 260.0)
    ParamFileManager.write(tmp_path / "gains.yaml", {GAIN: state._replace(stored_value=255.0)})
    assert ParamFileHelper(linked.cf).store_params_from_file(tmp_path / "gains.yaml")
    assert answered(parameters.persistent_get_state, GAIN) == (True, 250.0, 255.0)
    assert served.simulation.onboard.params.value(GAIN) == 255.0
    assert answered(parameters.persistent_clear, GAIN) is True
    assert answered(parameters.persistent_get_state, GAIN) == (False, 250.0, None)


def test_a_trajectory_that_was_uploaded_is_read_back_from_memory(linked) -> None:
    memory = linked.cf.mem.get_mems(MemoryElement.TYPE_TRAJ)[0]
    memory.trajectory = [Poly4D(1.0 + k, x=Poly4D.Poly([0.1 * k] * 8)) for k in range(5)]
    assert memory.write_data_sync()
    read: list[tuple[int, bytes]] = []
    linked.cf.mem.mem_read_cb.add_callback(lambda which, address, data: read.append((address, bytes(data))))
    assert linked.cf.mem.read(memory, 0, 5 * 132)
    assert until(lambda: read)
    assert read == [(0, b"".join(bytes(piece.pack()) for piece in memory.trajectory))]


def test_tables_come_from_the_cache_the_second_time(served, tmp_path: Path) -> None:
    spent = []
    for _ in range(2):
        with linked_to(served, rw_cache=str(tmp_path)) as link:
            spent.append({f"{group}.{name}" for group, members in link.cf.log.toc.toc.items() for name in members})
            kept = sorted((path.name, path.stat().st_mtime_ns) for path in tmp_path.glob("*.json"))
    assert spent[0] == spent[1]
    assert len(kept) == 2
    assert kept == sorted((path.name, path.stat().st_mtime_ns) for path in tmp_path.glob("*.json"))


def test_the_console_is_heard_and_an_emergency_stop_locks(served) -> None:
    with SimulatedCrazyflie(StillVehicle()) as own, linked_to(own) as link:
        heard: list[str] = []
        link.cf.console.receivedChar.add_callback(heard.append)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that there is another way from protocol 12 on
            link.cf.loc.send_emergency_stop()
        assert until(lambda: own.simulation.onboard.supervisor.state == State.LOCKED)
        assert until(lambda: "SUP: Locked, reboot required" in "".join(heard))


@pytest.mark.slow
def test_ten_in_a_swarm_are_told_in_sequence_and_side_by_side(tmp_path: Path) -> None:
    with ExitStack() as stack:
        ten = [stack.enter_context(SimulatedCrazyflie(StillVehicle())) for _ in range(10)]
        for number, one in enumerate(ten):
            one.simulation.onboard.vehicle.stabilizer.loop["estimate"]["position_m"][0] = (number, -number, 0.5)
        swarm = stack.enter_context(Swarm([one.uri for one in ten], factory=CachedCfFactory(rw_cache=str(tmp_path))))
        swarm.parallel_safe(lambda link: link.wait_for_params())
        swarm.sequential(lambda link: link.cf.param.set_value("stabilizer.controller", "1"))
        swarm.parallel_safe(lambda link, value: link.cf.param.set_value("stabilizer.controller", value),
                            args_dict={one.uri: ["2"] for one in ten})
        places = swarm.get_estimated_positions()
        assert until(lambda: all(one.simulation.onboard.selection.controller == 2 for one in ten))
    assert [places[one.uri] for one in ten] == [(k, -k, 0.5) for k in range(10)]


@pytest.mark.slow
def test_the_position_commander_flies_from_place_to_place_and_lands(monkeypatch: pytest.MonkeyPatch) -> None:
    from controllers.plants.served_vehicle import served as vehicle

    own = vehicle()
    with SimulatedCrazyflie(own, build=Build(positioning=True)) as served, linked_to(served) as link:
        world = WorldTime(served)
        for module in (reset_estimator, position_hl_commander):
            monkeypatch.setattr(module, "time", world)
        reset_estimator.reset_estimator(link)
        with PositionHlCommander(link, default_velocity=0.5, default_height=0.5) as flying:
            flying.forward(0.4)
            flying.go_to(0.4, 0.3, 0.6)
            world.sleep(0.5)
            there = own.true_pose()[0].copy()
            assert flying.get_position() == pytest.approx((0.4, 0.3, 0.6))
        assert until(lambda: own.true_pose()[0][2] < 0.05)
        assert served.broken is None
    assert there == pytest.approx((0.4, 0.3, 0.6), abs=0.15)
