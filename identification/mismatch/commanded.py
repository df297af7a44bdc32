"""Recordings without motor commands: a collective thrust set-point and the measured attitude determine the translation,
but not the rotation.

The set-point is spread evenly over the rotors. As a fraction of full (unit ``1``) each gets the fraction, and the
simulator's thrust map acts as on any PWM ratio. In N each gets its part of the force without a map: the simulator's
input is then ``thrust``. Only forces are compared; terms that only turn the vehicle are excluded.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from nanobench_tools import so3
from nanobench_tools.errors import InputError
from nanobench_tools.flight import Flight, make_stream
from nanobench_tools.physics import Model
from nanobench_tools.physics.vocabulary import terms_that
from nanobench_tools.settings import number

from .space import PWM_MAPS

UNITS = ("1", "N")
UNASKED = terms_that(lambda term: term.only_turns)
"""Terms that only turn the vehicle."""
WHY = "not tested: no motor commands"
WHY_STILL = "not tested: the simulator gives no angular acceleration"
QUATERNION = ("qx", "qy", "qz", "qw")
TURNING_S = number("mismatch.commanded.turning_s")


def unit_of(flight: Flight) -> str:
    """``1`` or ``N`` of a recording that has a collective command and no motors; else empty."""
    if "motor" in flight or "command" not in flight or "thrust" not in flight["command"]:
        return ""
    stream = flight["command"]
    return stream.unit[stream.index("thrust")]


def with_attitude(flight: Flight) -> Flight:
    """Adds the attitude to the position of the motion capture, from a separately logged ``attitude_qw`` or
    ``attitude``; unchanged without one."""
    mocap = flight.streams.get("mocap")
    if mocap is None or all(q in mocap for q in QUATERNION) or any(q not in mocap for q in ("px", "py", "pz")):
        return flight
    if "attitude_qw" in flight and all(q in flight["attitude_qw"] for q in QUATERNION):
        source = flight["attitude_qw"]
        turned = source[QUATERNION]
    elif "attitude" in flight and all(q in flight["attitude"] for q in ("roll", "pitch", "yaw")):
        source = flight["attitude"]
        turned = so3.from_euler_zyx(*source["roll", "pitch", "yaw"].T)
    else:
        return flight
    fine = np.isfinite(turned).all(axis=1) & np.concatenate([np.diff(source.time_s) > 0.0, [True]])
    if fine.sum() < 2:
        return flight
    stamps = source.time_s[fine]
    inside = (mocap.time_s >= stamps[0]) & (mocap.time_s <= stamps[-1])
    pose = np.concatenate([mocap["px", "py", "pz"][inside],
                           so3.interpolate(stamps, turned[fine], mocap.time_s[inside])], axis=1)
    return flight.with_streams(mocap=make_stream("mocap", mocap.time_s[inside], pose, ("px", "py", "pz", *QUATERNION),
                                                 rate_hz=mocap.rate_hz))


def believed(simulator: Model, unit: str) -> Model:
    """The simulator as it takes the recordings' commands. InputError for one that cannot."""
    kind = simulator.vehicle.input
    if unit == "N" and kind != "thrust":
        terms = {name: dict(values) for name, values in simulator.as_dict().items() if name not in PWM_MAPS}
        for term in simulator.terms:
            pwm_only = [p for p in term.parameters if p.only_input == kind and p.name in terms.get(term.name, ())]
            for parameter in pwm_only:
                del terms[term.name][parameter.name]
                if not terms[term.name]:
                    del terms[term.name]
        return Model(replace(simulator.vehicle, input="thrust"), terms)
    if unit == "1" and kind != "pwm":
        raise InputError("simulator", f"takes {'N' if kind == 'thrust' else 'rotor speeds'}, and the recordings hold a "
                         "collective command as a share of full", "give a simulator with thrust_pwm or thrust_voltage")
    if not unit and kind == "thrust":
        raise InputError("simulator", "takes thrusts in N, and the recordings hold motor commands",
                         "give a simulator with thrust_pwm or thrust_voltage")
    return simulator


def turning(quaternion: np.ndarray, row_s: float) -> np.ndarray:
    """(n, 3) rad/s, body: how fast an attitude (n, 4) turns."""
    steps = so3.log(so3.multiply(so3.conjugate(quaternion[:-1]), quaternion[1:])) / row_s
    rate = np.concatenate([steps[:1], 0.5 * (steps[:-1] + steps[1:]), steps[-1:]])
    return np.asarray(gaussian_filter1d(rate, TURNING_S / row_s, axis=0, mode="nearest"))
