"""Definitions of message types that bags of ROS 2 before Iron do not hold (``.db3`` without them). They are text of
``.msg``.

Only types whose layout never changed since they were first released; any other one has to come with the bag.
"""

from __future__ import annotations

DEFINITIONS = {
    "crazyflie_interfaces/msg/LogDataGeneric": "std_msgs/Header header\nuint32 timestamp\nfloat32[] values\n",
    "motion_capture_tracking_interfaces/msg/NamedPose": "string name\ngeometry_msgs/Pose pose\n",
    "motion_capture_tracking_interfaces/msg/NamedPoseArray":
        "std_msgs/Header header\nmotion_capture_tracking_interfaces/NamedPose[] poses\n",
}
"""Type -> text, a type after those that it holds."""
