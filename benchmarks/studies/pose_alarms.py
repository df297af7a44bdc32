"""False alarms of the checks of poses in flight, over recordings: ``python benchmarks/studies/pose_alarms.py FOLDER``.

Gate and physics see the poses and the IMU of every recording as they would see them live, 100 times a second.
"""

import sys
from pathlib import Path

import numpy as np

from nanobench_tools.radio.fly.pose_gate import AIR_M, PoseGate
from nanobench_tools.radio.fly.pose_physics import IMU, PosePhysics
from nanobench_tools.radio.fly.pose_tracker import PoseTrack
from nanobench_tools.radio.mocap.pose_datagram import Pose
from nanobench_tools.sources.discover import load_recordings
from nanobench_tools.units import GRAVITY_M_S2


def alarm(flight) -> str:
    """The first reason in the air, "" without."""
    mocap, imu = flight["mocap"], flight["imu"]
    place = np.column_stack([mocap[n] for n in ("px", "py", "pz")])
    turn = np.column_stack([mocap[n] for n in ("qx", "qy", "qz", "qw")])
    acc = np.column_stack([np.interp(mocap.time_s, imu.time_s, imu[f"acc_{a}"]) for a in "xyz"]) / GRAVITY_M_S2
    gyro = np.degrees(np.column_stack([np.interp(mocap.time_s, imu.time_s, imu[f"gyro_{a}"]) for a in "xyz"]))
    ground = float(np.median(place[:20, 2]))
    gate, physics, track = PoseGate(ground), PosePhysics(), PoseTrack()
    for k, time_s in enumerate(mocap.time_s):
        pose = Pose(float(time_s), place[k], turn[k])
        if gate.admits(pose):
            track.add(pose)
        values = dict(zip(IMU, (*acc[k], *gyro[k]), strict=True))
        why = gate.why or physics.check(track.at(pose.time_s), values, dict.fromkeys(IMU, pose.time_s), pose.time_s)
        if why and place[k, 2] > ground + AIR_M:
            return f"{time_s:.2f} s: {why}"
    return ""


def main() -> None:
    flights = [f for path in sorted(Path(sys.argv[1]).rglob("*.csv*")) for f in load_recordings([path]).flights
               if "mocap" in f.streams and "imu" in f.streams and len(f["mocap"]) > 300]
    found = {f.name: why for f in flights if (why := alarm(f))}
    for name, why in found.items():
        print(f"{name}: {why}")
    print(f"{len(found)} of {len(flights)} recordings with an alarm")


if __name__ == "__main__":
    main()
