"""Flying over a link: jitter of the 100 Hz loop with a predictive controller, and the circle with every controller.

``--minutes N`` (default 5) flies MPC in real time against a served vehicle in another process. It reports late ticks
and set-points, missed deadlines, and where the time of those ticks went. ``--circle`` flies the simulated vehicle on
its own clock over 10 ms and 2 % loss with every controller and seed. It prints tracking error and the audit of the
clock. ``--hidden`` hides effects in the vehicle and asks ``nanobench diagnose``. Figures of a busy machine are figures
of that machine, so the load is printed, too.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from tick_times import Stopwatch

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
CONTROLLERS = ("onboard_pid", "onboard_mellinger", "geometric", "mpc_daqp")
SAG_V = 3.55
"""Voltage that a simulator without a battery believes in: that of a flight's beginning."""


def constant_voltage(model):
    """``model`` as one that knows PWM only sees it."""
    terms = dict(model.as_dict())
    c = terms.pop("thrust_voltage")["c"]
    return type(model)(model.vehicle, {"thrust_pwm": {"c": tuple(v * SAG_V**k for k, v in enumerate(c))}, **terms})


HIDDEN = {  # plant and simulator, both made of the shipped model
    "nothing": (lambda model: model, lambda model: model),
    "weak motor": (lambda model: model.with_term("motor_imbalance", g=(0.88, 1.04, 1.04, 1.04)), lambda model: model),
    "payload of 2 g": (lambda model: model.with_term("mass", m=model.vehicle.mass_kg + 0.002), lambda model: model),
    "battery sag ignored": (lambda model: model, constant_voltage),
}
SERVE = """
import contextlib, os, sys
with contextlib.suppress(AttributeError, OSError):  # the vehicle's own time must not stand still for other processes
    os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
from controllers.plants.served_vehicle import served
from nanobench_tools.radio.simulated.channel import RadioOptions
from nanobench_tools.radio.simulated.server import SimulatedCrazyflie
with SimulatedCrazyflie(served(battery_V=4.15), '127.0.0.1', 0, radio=RadioOptions(latency_s=0.01, loss=0.02)) as s:
    print(s.uri, '%s:%d' % s.mocap_address, flush=True)
    sys.stdin.read()
"""


def loop(minutes: float) -> None:
    """The real-time loop, in flights of 60 s of path each."""
    from nanobench_tools.cli.flights.flight_controllers import pilot_for
    from nanobench_tools.radio.fly import mission
    from nanobench_tools.radio.fly.flight_plan import chosen_path
    from nanobench_tools.radio.fly.safety import Limits
    from nanobench_tools.radio.fly.session import Request, fly_session
    from nanobench_tools.radio.mocap.mocap_sources import pose_source

    late, sent, ticks, missed, flown = [], [], 0, 0, 0.0
    fly_whole = mission.Flight._fly

    def watched(flight):
        watches: list[Stopwatch] = []
        made = mission.Pacer

        def pacer(*given):
            flight.pacer = made(*given)
            watches.append(Stopwatch(flight))
            return flight.pacer

        mission.Pacer = pacer
        try:
            return fly_whole(flight)
        finally:
            mission.Pacer = made
            for watch in watches:
                watch.report()

    mission.Flight._fly = watched
    while flown < 60.0 * minutes:
        server = subprocess.Popen([sys.executable, "-c", SERVE], cwd=ROOT, stdin=subprocess.PIPE,
                                  stdout=subprocess.PIPE, text=True)
        try:
            uri, address = server.stdout.readline().split()
            path = min(60.0, max(60.0 * minutes - flown, 6.0))
            limits = Limits(stale_s=1.0, late_ticks=1000, battery_V=2.5)
            outcome = fly_session(Request(chosen_path("figure_eight", 1.0, None, path),
                                          pilot_for("mpc_daqp", None, None), limits, uri,
                                          pose_source(f"simulated://{address}", uri), ())).outcome
        finally:
            server.stdin.close()
            try:
                server.wait(10.0)
            except subprocess.TimeoutExpired:
                server.kill()
        beat = outcome.beat
        late += beat.late_s
        sent += (np.array(beat.sent_s) - np.median(beat.sent_s or [0.0])).tolist()
        ticks, missed, flown = ticks + beat.ticks, missed + beat.missed, flown + 0.01 * beat.ticks
        print(f"flight of {0.01 * beat.ticks:.0f} s, {outcome.stop or 'flown to its end'}, load "
              f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)
        if outcome.stop is not None:
            break
    mission.Flight._fly = fly_whole
    if not late:
        return
    begin, send = 1e3 * np.array(late), 1e3 * np.abs(sent)
    print(f"loop with mpc_daqp, real time: {ticks} ticks, {missed} deadlines missed. Start late by p50 "
          f"{np.percentile(begin, 50):.2f} p99 {np.percentile(begin, 99):.2f} max {begin.max():.2f} ms. Set-point p50 "
          f"{np.percentile(send, 50):.2f} p99 {np.percentile(send, 99):.2f} ms about its median")


def fly_virtual(name: str, folder: Path, seed: int, seconds: float, model=None) -> None:
    from controllers.plants.served_vehicle import ServedVehicle, served
    from nanobench_tools.cli.flights.flight_controllers import pilot_for
    from nanobench_tools.radio.blocks import default_blocks
    from nanobench_tools.radio.fly.flight_plan import chosen_path
    from nanobench_tools.radio.fly.safety import Limits
    from nanobench_tools.radio.fly.session import Request, fly_session
    from nanobench_tools.radio.fly.virtual import VirtualWorld
    from nanobench_tools.radio.simulated.channel import RadioOptions
    from nanobench_tools.radio.simulated.motion_capture import MocapOptions

    vehicle = served(seed=seed) if model is None else ServedVehicle(model, seed=seed)
    world = VirtualWorld(vehicle, RadioOptions(latency_s=0.010, loss=0.02, seed=seed),
                         MocapOptions(noise_m=1.2e-5, noise_rad=6e-4, seed=seed))
    with world.served() as uri:
        stop = fly_session(Request(chosen_path("figure_eight", 1.0, None, seconds), pilot_for(name, None, None),
                                   Limits(), uri, world, default_blocks(), record_to=folder, clock=world)).outcome.stop
    if stop is not None:
        print(f"{name}, seed {seed}: {stop}")


def circle(seeds: int, seconds: float, written: str | None) -> None:
    """SYNTHETIC: tracking error, clock and faults of every controller, from the recordings alone."""
    from nanobench_tools.auditing.faults.kinds import kinds
    from nanobench_tools.auditing.recording_audit import audit
    from nanobench_tools.cli.main import main
    from nanobench_tools.sources.discover import load_recordings

    with tempfile.TemporaryDirectory() as place:
        for seed in range(seeds):
            folder = Path(place) / str(seed)
            for name in CONTROLLERS:
                fly_virtual(name, folder, seed, seconds)
            for flight in load_recordings([folder]).flights:
                found = audit(flight)
                clock = found.clock["imu"]
                faults = sorted({f.kind for f in found.faults if kinds()[f.kind].in_overview})
                print(f"seed {seed} {flight.metadata['controller']}: gyro {1e3 * clock.offset_s:+.1f} ms late, of "
                      f"which its filter is 3.8; faults {', '.join(faults) or 'none'}", flush=True)
        main(["control", "--data", place, "--plant", "real", "--protocol", "clean", "--jobs", "1",
              *(["--json", written] if written else [])])


def hidden(effects: list[str], flights: int, seconds: float) -> None:
    """SYNTHETIC: what ``diagnose`` says of recordings of a vehicle that has more in it than the simulator."""
    from controllers.plants.served_vehicle import served_simulator
    from nanobench_tools.cli.main import main
    from nanobench_tools.physics.simulator import loads, write_simulator

    nominal = loads(served_simulator(), "shipped")
    with tempfile.TemporaryDirectory() as place:
        for what in effects:
            flown, believed = (made(nominal) for made in HIDDEN[what])
            simulator = Path(place) / "believed.toml"
            write_simulator(believed, simulator)
            folder, out = Path(place) / what.replace(" ", "_"), Path(place) / "verdict" / what.replace(" ", "_")
            for seed in range(flights):
                fly_virtual("onboard_pid", folder, seed, seconds, flown)
            main(["diagnose", "--data", str(folder), "--simulator", str(simulator), "--out", str(out), "--jobs", "1",
                  "--quiet"])
            verdict = json.loads((out / "verdict.json").read_text())
            named = [", ".join([f["term"], *(f"{n} {p['value']:.4g} {p['ci95']}" for n, p in f["parameters"].items())])
                     for f in verdict["findings"]]
            print(f"{what}, {flights} flights: {verdict['outcome']}; {'; '.join(named) or 'nothing named'}", flush=True)


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("--minutes", type=float, default=5.0)
    asked.add_argument("--circle", action="store_true")
    asked.add_argument("--hidden", action="store_true")
    asked.add_argument("--effect", choices=list(HIDDEN), action="append", help="of --hidden; default: all")
    asked.add_argument("--seeds", type=int, default=3)
    asked.add_argument("--seconds", type=float, default=12.0, help="of path, on the simulation's own clock")
    asked.add_argument("--json", help="of --circle: the result of `nanobench control`")
    given = asked.parse_args()
    started = time.time()
    if given.circle:
        circle(given.seeds, given.seconds, given.json)
    if given.hidden:
        hidden(given.effect or list(HIDDEN), given.seeds, given.seconds)
    if not (given.circle or given.hidden):
        loop(given.minutes)
    print(f"took {time.time() - started:.0f} s, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
