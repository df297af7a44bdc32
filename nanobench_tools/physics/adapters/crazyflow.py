"""crazyflow's ``first_principles`` physics as a simulator, or the same of drone-models where only that is installed.

Both want to be imported before SciPy with SCIPY_ARRAY_API set, so that they run in a separate process. Frames,
quaternions, motors and signs are as here, rotor speeds in RPM (``export.drone_models`` has the equations). Rotors lag
as theirs do: dOmega/dt = a (cmd - Omega) + b (cmd^2 - Omega^2).
"""

import contextlib
import importlib.util
import json
import os
import subprocess
import sys
import tomllib
import weakref
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import so3
from ...errors import InputError, MissingExtraError, UsageError
from ..equations import Equations
from ..export.drone_models import section
from ..export.rotors import commands
from ..inputs import rows
from ..model import Model
from ..ops import NUMPY
from ..vehicle import Vehicle
from .given import Along
from .pwm import CURVE, stated

DRONE = "cf2x_L250"
PLACES = {"crazyflow": ("crazyflow.dynamics.first_principles", "dynamics/first_principles/params.toml"),
          "drone_models": ("drone_models.first_principles", "data/params.toml")}
"""Package -> module of its equations, and the place of its drones' parameters there."""
WORKER = """
import importlib, inspect, json, os, sys
answers = os.fdopen(os.dup(1), "wb")
os.dup2(2, 1)
dynamics = importlib.import_module(sys.argv[1]).dynamics
import numpy as np
given = json.loads(sys.argv[2])
keys = {n: np.asarray(given[n], float) for n, p in inspect.signature(dynamics).parameters.items()
        if p.kind == p.KEYWORD_ONLY}
while line := sys.stdin.buffer.readline():
    rows = np.frombuffer(sys.stdin.buffer.read(8 * 21 * int(line))).reshape(-1, 21)
    found = dynamics(*np.split(rows, [3, 7, 10, 13, 17], axis=1), **keys)
    answers.write(np.concatenate([np.asarray(a, float) for a in found[2:4]], axis=1).tobytes())
    answers.flush()
"""
"""The separate process: position, quaternion, velocity, rate, commands, rotor speeds in; accelerations out."""
STEPS = 10
"""Of the rotors' equation in a row."""


@dataclass
class CrazyflowAlong:
    """One drone along measured states: see ``given``. ``keys`` are its parameters, ``commanded`` turns PWM into
    thrust."""

    package: str
    keys: dict[str, Any]
    commanded: Model
    vehicle: Vehicle
    notes: tuple[str, ...] = ()
    _worker: subprocess.Popen[bytes] | None = None

    def __call__(self, along: Along) -> tuple[np.ndarray, np.ndarray]:
        wanted = self._rpm(along)
        spinning = self._lagged(wanted, along.row_s)
        found = self._command(np.concatenate([along.position_m, along.quaternion, along.velocity_m_s, along.rate_rad_s,
                                          wanted, spinning], axis=1))
        down = np.asarray(self.keys["gravity_vec"], float)
        return so3.rotate_inverse(along.quaternion, found[:, :3] - down), found[:, 3:]

    def _command(self, given: np.ndarray) -> np.ndarray:
        """Rows (n, 21) as WORKER wants them -> accelerations, world, and angular accelerations (n, 6)."""
        if self._worker is None:
            self._worker = subprocess.Popen(
                [sys.executable, "-c", WORKER, PLACES[self.package][0], json.dumps(self.keys)], stdin=subprocess.PIPE,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, env={**os.environ, "SCIPY_ARRAY_API": "1"})
            weakref.finalize(self, _end, self._worker)
        pipes, n = self._worker, len(given)
        assert pipes.stdin is not None  # all three are pipes
        assert pipes.stdout is not None
        assert pipes.stderr is not None
        try:
            pipes.stdin.write(b"%d\n" % n + given.tobytes())
            pipes.stdin.flush()
            answer = pipes.stdout.read(8 * 6 * n)
        except OSError:
            answer = b""
        if len(answer) < 8 * 6 * n:
            words = pipes.stderr.read().decode(errors="replace").strip().splitlines() or ["without a word"]
            raise InputError(self.package, f"its process ended: {words[-1]}", "is it installed whole?")
        return np.frombuffer(answer).reshape(n, 6)

    def _rpm(self, along: Along) -> np.ndarray:
        """Rotor speeds asked for (n, 4): the positive root of rpm2thrust at the thrust asked for."""
        model = self.commanded
        given = rows(model, along.motor[None], along.battery_V[None], row_hz=1.0 / along.row_s)[0][..., 0]
        thrust = np.stack(Equations(model, model.values.tolist(), NUMPY, along.row_s).command(list(given.T)), axis=-1)
        c0, c1, c2 = (float(c) for c in self.keys["rpm2thrust"])
        root = np.sqrt(np.maximum(c1 * c1 - 4.0 * c2 * (c0 - np.maximum(thrust, 0.0)), 0.0))
        return np.asarray((-c1 + root) / (2.0 * c2))

    def _lagged(self, wanted: np.ndarray, row_s: float) -> np.ndarray:
        """Rotor speeds (n, 4) RPM at the start of every row, settled on the first; exact where the equation is linear
        over a step."""
        up, up2, down, down2 = (float(x) for x in self.keys["rotor_dyn_coef"])
        found, now = np.empty_like(wanted), wanted[0]
        for k, goal in enumerate(wanted):
            found[k] = now
            for _ in range(STEPS):
                fast = np.where(goal > now, up + up2 * (goal + now), down + down2 * (goal + now))
                now = goal + (now - goal) * np.exp(-fast * row_s / STEPS)
        return found


def _end(worker: subprocess.Popen[bytes]) -> None:
    worker.kill()
    worker.wait()
    for pipe in (worker.stdin, worker.stdout, worker.stderr):
        with contextlib.suppress(OSError):
            pipe.close()  # type: ignore[union-attr]


def simulator(argument: str | None) -> CrazyflowAlong:
    """``crazyflow``: its cf2x_L250. ``crazyflow:DRONE``: another of its drones. ``crazyflow:FILE.toml``: a
    simulator.toml as far as its physics allows. Raises MissingExtraError without crazyflow and drone-models."""
    package = next((p for p in PLACES if importlib.util.find_spec(p) is not None), None)
    if package is None:
        raise MissingExtraError("crazyflow", "crazyflow")
    named = argument or DRONE
    if named.endswith(".toml") or os.path.sep in named:
        from ..simulator import read_simulator

        model = read_simulator(Path(named))
        keys = section(model)[0]
        about = Vehicle(float(keys["mass"]), tuple(float(keys["J"][i][i]) for i in range(3)),  # type: ignore[arg-type]
                        model.vehicle.motor_positions_m, model.vehicle.spin)
        return CrazyflowAlong(package, _whole(keys, {}), commands(model, delayed=True), about)
    spec = importlib.util.find_spec(package)
    assert spec is not None  # it was found above
    drones = tomllib.loads((Path(spec.submodule_search_locations[0]) / PLACES[package][1]).read_text())  # type: ignore[index]
    if named not in drones:
        raise UsageError(f"--simulator crazyflow:{named}: no drone of {package}; there are {', '.join(drones)}; or "
                         "give a simulator.toml")
    keys = _whole(drones[named], {"gravity_vec": [0.0, 0.0, -9.81], "prop_inertia": 0.0})
    mixing, arm = np.asarray(keys["mixing_matrix"], float), float(np.max(keys["L"]))
    about = Vehicle(float(keys["mass"]), tuple(float(keys["J"][i][i]) for i in range(3)),  # type: ignore[arg-type]
                    tuple((-arm * float(x), arm * float(y)) for y, x in mixing[:2].T),
                    tuple(float(s) for s in mixing[2]))
    if "vmotor2thrust" in keys:  # drone-models says how its motors answer a voltage
        commanded = Model(Vehicle(), {"thrust_voltage": {"c": keys["vmotor2thrust"]}})
        return CrazyflowAlong(package, keys, commanded, about)
    return CrazyflowAlong(package, keys, CURVE, about, stated(f"{package}'s {named}", about.mass_kg))


def _whole(keys: dict[str, Any], defaults: dict[str, Any]) -> dict[str, Any]:
    return {**defaults, **keys, "J_inv": np.linalg.inv(np.asarray(keys["J"], float)).tolist()}
