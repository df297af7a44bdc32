"""What each verb needs of a recording: streams and quantities it cannot do without, in one place."""

from ..flight import Flight, intersect_spans
from .recording_audit import Audit
from .usable import MOCAP, MOTORS, POSE, SHORTEST_S, Needed, flown, missing

TRUTH: Needed = {"mocap": POSE}
"""Of an estimate from elsewhere: poses to score it against."""
LOGGED: Needed = {"mocap": POSE, "estimator": ("x", "y", "z"), "attitude_qw|attitude": ()}
"""Of the onboard estimate as logged."""
INERTIAL: Needed = {"mocap": POSE, "imu": ("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z")}
"""Of dead reckoning."""
STAMPED: Needed = {"mocap": POSE, "imu|estimator|attitude_qw|attitude|motor": ()}
"""Of a method that only extends the last pose: timestamps of the vehicle to report at."""
ESTIMATE: Needed = {"mocap": MOCAP, "estimator": ("x", "y", "z"), "motor": ("m1",), "attitude_qw|attitude": ()}
"""Of the published protocol."""
SYSID: Needed = {"mocap": MOCAP, "imu": ("gyro_x", "gyro_y", "gyro_z"), "motor": MOTORS, "battery": ("vbat",),
                 "attitude_qw": ("qx", "qy", "qz", "qw")}
SYSID_RECORDED: Needed = {
    "mocap": POSE, **{name: quantities for name, quantities in SYSID.items() if name in ("imu", "motor")}}
"""What has to be recorded for ``SYSID``: poses give velocity and attitude, and a battery voltage may be assumed."""
CONTROL: Needed = {"mocap": MOCAP, "setpoint": ("x", "y", "z"), "motor": MOTORS}
THRUST: Needed = {"imu": ("acc_z",), "motor": MOTORS, "battery": ("vbat",)}
MOTOR_LAG: Needed = {"rpm": MOTORS, "motor": MOTORS, "battery": ("vbat",),
                     "imu": ("acc_z", "gyro_x", "gyro_y", "gyro_z")}
WRENCH: Needed = {"mocap": POSE, "imu": ("gyro_x", "gyro_y", "gyro_z"), "motor": ("m1",), "battery": ("vbat",)}
"""Of a diagnosis of forces and moments; motors as many as there are rotors."""
FORCE: Needed = {"mocap": POSE, "command": ("thrust",), "battery": ("vbat",)}
"""Of a diagnosis of forces alone, from a collective command."""
STAND: Needed = {"stand": ("thrust",), "motor": ()}
VERBS: dict[str, tuple[Needed, ...]] = {
    "estimate": (TRUTH,), "sysid": (SYSID_RECORDED,), "control": (CONTROL,), "thrust": (THRUST, STAND),
    "motors": (MOTOR_LAG,), "diagnose": (WRENCH, FORCE)}
"""Verb -> any one of these is enough; verbs that are not here take every recording."""


def can(flight: Flight, audit: Audit) -> dict[str, str]:
    """Verb -> why this recording is none for it, in words; empty for one that is. Pure.

    Says what is missing, or that no stretch of it is clean in all the streams the verb needs.
    """
    return {verb: next((lack for lack in found if not lack), found[0]) for verb, ways in VERBS.items()
            for found in [[_lacks(flight, audit, needed) for needed in ways]]}


def _lacks(flight: Flight, audit: Audit, needed: Needed) -> str:
    lack = missing(flight, needed)
    if lack is not None:
        return lack
    streams = {part for names in needed for part in names.split("|") if part in flight}
    air = (audit.span,) if "stand" in needed else flown(flight, audit)
    if not air:
        return "no flight in it"
    clean = intersect_spans(air, audit.clean_for(streams))
    return "" if any(s.duration_s > SHORTEST_S for s in clean) else f"no clean stretch of {', '.join(sorted(streams))}"
