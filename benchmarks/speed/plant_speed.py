"""How many times faster than real time closed loops run on the plant, in one process on one core.

    python benchmarks/speed/plant_speed.py [--vehicles 512] [--seconds 1]

SYNTHETIC: vehicles that hover. Counted is processor time of whole flights (``plants.closed_loop.fly``): sensing,
controller with guard, motors, battery, physics at 500 Hz, records; not compilation. ``onboard``: the firmware's
Kalman filter at 1 kHz for every vehicle, as the gate and the simulated rows have it. ``compiled chain`` is a loop
without the filter, the Controller protocol and its guard. It is the firmware's own step, mixer and compensation, and
the estimate is the truth. The practice plant is stepped by NumPy behind the same controller.
"""

import argparse
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from kept import show

from controllers.plants.closed_loop import fly
from controllers.plants.ensemble import draw, shipped_simulator
from controllers.plants.kalman_senses import Onboard
from controllers.plants.senses import SUBSTEPS, TICK_S
from nanobench_tools.firmware import motor_output, pid
from nanobench_tools.firmware.onboard import PidCascade, estimates, setpoints
from nanobench_tools.firmware.records import CONTROL, ESTIMATE, SETPOINT
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.flying import STEP_S
from nanobench_tools.practice.rigid_bodies import Plant as PracticePlant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles

REQUIRED = 1000.0


def hover(n: int) -> Reference:
    goal = np.tile([0.0, 0.0, 1.0], (n, 1))
    return Reference(goal, np.zeros(n), np.zeros((n, 3)), np.zeros((n, 3)))


def whole(n: int, ticks: int) -> float:
    """Processor time [s] of a flight behind the PID cascade."""
    crowd = draw(shipped_simulator(), n)
    plant = crowd.plant(np.tile([0.0, 0.0, 1.0], (n, 1)))
    senses, told = Onboard(plant, crowd.sensing(), crowd.rngs(2)), hover(n)
    before = time.process_time()
    fly(plant, senses, PidCascade(), lambda tick: told, ticks)
    return time.process_time() - before


def chain(n: int, ticks: int) -> float:
    """The same with the firmware's compiled steps called directly; the estimate moves at 100 Hz, the gyro at 500
    Hz."""
    crowd = draw(shipped_simulator(), n)
    plant = crowd.plant(np.tile([0.0, 0.0, 1.0], (n, 1)))
    setpoint, estimate, control = np.zeros((1, n), SETPOINT), np.zeros((1, n), ESTIMATE), np.zeros((1, n), CONTROL)
    setpoints(hover(n), setpoint[0])
    state, trace, counts = np.zeros(n, pid.STATE), np.zeros((0, n), pid.STATE), np.zeros((n, 4), np.int32)
    filtered, parameters = np.full(n, 3.6), pid.defaults()
    before = time.process_time()
    for tick in range(ticks):
        s = plant.state
        estimates(VehicleState(s[0:3].T, s[3:6].T, s[6:10].T, s[10:13].T, plant.battery_V), estimate[0])
        for sub in range(SUBSTEPS):
            estimate["gyro_deg_s"][0] = np.degrees(plant.state[10:13].T)
            pid.run_steps(np.array([2 * (tick * SUBSTEPS + sub + 1)]), parameters, state, setpoint, estimate, control,
                          trace)
            motor_output.drive_legacy(2, control[0], plant.battery_V.astype(np.float32), filtered, motor_output.BUILD,
                                      counts)
            plant.advance(counts / 65535)
    return time.process_time() - before


def practice(n: int, ticks: int) -> float:
    """The NumPy vehicle of the practice flights behind the same controller, without its records and noise."""
    rngs = [np.random.default_rng(i) for i in range(n)]
    plant = PracticePlant(draw_vehicles(rngs), np.tile([0.0, 0.0, 0.07], (n, 1)), np.zeros(n))
    plant.state[2] = 1.0
    controller, told = PidCascade(), hover(n)
    controller.reset(n)
    before = time.process_time()
    for step in range(ticks * SUBSTEPS):
        s = plant.state
        state = VehicleState(s[0:3].T, s[3:6].T, s[6:10].T, s[10:13].T, plant.battery_V)
        plant.apply(controller.command(STEP_S * step, state, told))
        plant.step(STEP_S)
    return time.process_time() - before


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vehicles", type=int, default=512)
    parser.add_argument("--seconds", type=float, default=1.0)
    given = parser.parse_args()
    n, ticks = given.vehicles, max(1, round(given.seconds / TICK_S))
    kinds = {"compiled chain": chain, "onboard": whole, "practice plant (NumPy)": practice}
    found = {}
    for name, run in kinds.items():
        run(8, 2)
        found[name] = n * ticks * TICK_S / min(run(n, ticks) for _ in range(2))
        print(f"{name:24} {n} vehicles, {ticks * TICK_S:g} s: {found[name]:8.0f} x real time a core", flush=True)
    ratio = found["compiled chain"] / found["practice plant (NumPy)"]
    print(f"compiled chain over NumPy plant: {ratio:.1f}; required {REQUIRED:g} x real time: "
          f"{'reached' if found['compiled chain'] >= REQUIRED else 'missed'}")
    show("practice plant / compiled chain", ratio, n)
    show("practice plant / whole flight with the firmware's filter",
         found["onboard"] / found["practice plant (NumPy)"], n)


if __name__ == "__main__":
    main()
