"""Controllers, states, references and a world that the tests of predictive control share."""

import functools

import numpy as np

from controllers.mpc.disturbance import Tuning
from controllers.mpc.linear_mpc import MpcDaqp, MpcOsqp
from controllers.mpc.nmpc import Nmpc
from controllers.mpc.prediction_model import practice_model
from nanobench_tools.methods import Reference, VehicleState
from nanobench_tools.practice.rigid_bodies import QUATERNION, RATE, THRUST, VELOCITY, Plant
from nanobench_tools.practice.vehicle_parameters import draw_vehicles

KINDS = {"mpc_daqp": MpcDaqp, "mpc_osqp": MpcOsqp, "nmpc": Nmpc}
FRESH = Tuning(ages_s=(0.0, 0.0, 0.0, 0.0))
"""Of measurements that are as old as the call."""


make = functools.cache(lambda name, **keywords: KINDS[name](practice_model(), tuning=FRESH, **keywords))


def fresh(name, n=1, **keywords):
    controller = make(name, **keywords)
    controller.reset(n)
    return controller


def resting(n=1, **changes):
    """At the origin, level, and asked to be there; names beginning with r_ are of the reference."""
    zero = np.zeros((n, 3))
    state = {"position_m": zero, "velocity_m_s": zero, "quaternion": np.tile([0.0, 0.0, 0.0, 1.0], (n, 1)),
             "rate_rad_s": zero, "battery_V": np.full(n, 3.6)}
    reference = {"position_m": zero, "yaw_rad": np.zeros(n), "velocity_m_s": zero, "acceleration_m_s2": zero,
                 "jerk_m_s3": zero, "yaw_rate_rad_s": np.zeros(n)}
    for name, value in changes.items():
        (reference if name.startswith("r_") else state)[name.removeprefix("r_")] = value
    return VehicleState(**state), Reference(**reference)


def with_future(spec, t, **changes):
    """What a path asks for at t s, and after."""
    def ahead(seconds):
        r = spec.reference(t + seconds)
        return Reference(*(x[:, None] for x in (r.position_m, r.yaw_rad, r.velocity_m_s, r.acceleration_m_s2,
                                                r.jerk_m_s3, r.yaw_rate_rad_s)))
    now = spec.reference(np.array([t]))
    return Reference(**{**vars(now), "ahead": ahead, **changes})


class World:
    """One nominal practice vehicle in the air, with perfect measurements."""

    def __init__(self, reference, seed=0, spread=0.0, **fixed):
        self.plant = Plant(draw_vehicles([np.random.default_rng(seed)], spread, **fixed), np.zeros((1, 3)), np.zeros(1))
        self.plant.state[:3] = reference.position_m.T
        self.plant.state[VELOCITY] = reference.velocity_m_s.T
        self.plant.state[THRUST] = 0.1
        self.plant.ground_z = np.full(1, -1e9)

    def seen(self):
        s = self.plant.state
        return VehicleState(s[:3].T.copy(), s[VELOCITY].T.copy(), s[QUATERNION].T.copy(), s[RATE].T.copy(),
                            self.plant.battery_V.copy())

    def fly(self, command, seconds):
        self.plant.apply(command)
        for _ in range(round(seconds / 0.002)):
            self.plant.step(0.002)


def flight(controller, spec, seconds, told=with_future, seen=lambda t, state: state, late=0, **vehicle):
    """RMS distance [m] to the path after 1 s, and the largest; ``seen`` bends measurements, a command acts ``late``
    periods after it was given."""
    world = World(spec.reference(np.zeros(1)), **vehicle)
    controller.reset(1)
    gaps, waiting = [], [np.full((1, 4), 0.78)] * late
    for k in range(round(seconds / controller.period_s)):
        t = controller.period_s * k
        reference = told(spec, t)
        waiting.append(controller.command(t, seen(t, world.seen()), reference))
        gaps.append(np.linalg.norm(world.plant.state[:3, 0] - spec.reference(np.array([t])).position_m[0]))
        world.fly(waiting.pop(0), controller.period_s)
    settled = np.array(gaps[round(1.0 / controller.period_s):])
    return float(np.sqrt(np.mean(settled**2))), float(max(gaps))
