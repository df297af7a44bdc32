"""The firmware's test of propellers and battery (health.c of 2025.12.1), for brushed motors.

Every motor turns at full command for ON_MS while the accelerometer is read for SAMPLES ms. The variances of x and y are
sums of squares, as in the firmware. All motors turn for BATTERY_MS for the sag of the battery.
"""

from collections.abc import Callable

import numpy as np

from ...firmware.stabilizer import Stabilizer
from .log import LogVariable
from .params import Parameter

ON_MS, OFF_MS, SAMPLES, BATTERY_MS = 50, 950, 100, 50
FULL, BATTERY_RATIO = 65535, 40000
MOST_SAG_V = 0.95
"""Sag of a battery that passes (BAT_LOADING_SAG_THRESHOLD of cf2)."""
FINISHED = 1 << 7
DIRECT = 1
"""Value of ``motorPowerSet.enable`` for one command per motor."""


class Health:
    """Groups ``health`` of parameters and logs. While ``running``, ``step`` is called before and ``seen`` after every
    millisecond."""

    def __init__(self, s: Stabilizer, say: Callable[[str], None]) -> None:
        self._s, self._say = s, say
        self.motors = self.battery = False
        self.variance = np.zeros((4, 2))
        self.passed = self.count = self.battery_passed = 0
        self.sag_V = self.least = self.most = 0.0
        self._tick, self._motor, self._on_step = 0, 0, 0
        self._samples: list[np.ndarray] = []
        self._rest_V = self._least_V = 0.0

    @property
    def running(self) -> bool:
        return self.motors or self.battery

    def step(self) -> None:
        """Sets the commands of the next millisecond."""
        loop = self._s.loop[0]
        if self._tick == 0:
            self._samples.clear()
            self._rest_V = self._least_V = float(loop["vbat_V"])
            if self._motor == 0:
                self._on_step = int(loop["motor_on_step"])
        loop["override"], loop["direct"] = DIRECT, 0
        if self.motors and self._tick < ON_MS:
            loop["direct"][self._motor] = FULL
        elif not self.motors and self._tick < BATTERY_MS:
            loop["direct"] = BATTERY_RATIO

    def seen(self) -> None:
        """Reads the accelerometer after it; the end of a test stops the motors."""
        loop = self._s.loop[0]
        self._least_V = min(self._least_V, float(loop["vbat_V"]))
        if self._tick < SAMPLES:
            self._samples.append(loop["acc_g"].astype(float).copy())
        self._tick += 1
        if self.motors and self._tick >= ON_MS + OFF_MS:
            self.variance[self._motor] = SAMPLES * np.var(np.array(self._samples)[:, :2], axis=0)
            self._tick, self._motor = 0, self._motor + 1
            if self._motor == 4:
                self._evaluate()
        elif not self.motors and self._tick > BATTERY_MS:
            self.sag_V = self._rest_V - self._least_V
            self.battery_passed, self.battery = int(self.sag_V <= MOST_SAG_V), False
            self._stop()

    def _evaluate(self) -> None:
        self.passed, self.motors = FINISHED, False
        for motor, value in enumerate(self.variance.sum(axis=1)):
            if self.most:
                good = self.least <= value <= self.most
                self.passed |= int(good) << motor
                self._say(f"HEALTH: Propeller test on M{motor + 1} [{'PASS' if good else 'FAIL'}]. low: "
                          f"{self.least:.2f}, high: {self.most:.2f}, measured: {value:.2f}")
            else:
                self._say(f"HEALTH: Propeller test on M{motor + 1}. No threshold set. measured: {value:.2f}")
        self.count += 1
        self._stop()

    def _stop(self) -> None:
        loop = self._s.loop[0]
        self._tick = self._motor = 0
        loop["override"], loop["direct"] = 0, 0
        loop["motor_on_step"] = self._on_step  # the supervisor does not see the test

    def parameters(self) -> dict[str, Parameter]:
        """Of the group."""
        def most(value: float) -> None:
            self.most = value

        def least(value: float) -> None:
            self.least = value

        return {"health.startPropTest": Parameter("u1", lambda: self.motors, lambda v: self._start("motors", v)),
                "health.startBatTest": Parameter("u1", lambda: self.battery, lambda v: self._start("battery", v)),
                "health.propTestThreshold": Parameter("f4", lambda: self.most, most, True),
                "health.propTestThresholdL": Parameter("f4", lambda: self.least, least, True)}

    def _start(self, which: str, value: float) -> None:
        if value and not self.running:
            setattr(self, which, True)
            self.passed = 0 if which == "motors" else self.passed

    def variables(self) -> dict[str, LogVariable]:
        """Of the group."""
        found = {f"health.motorVar{axis}M{m + 1}": LogVariable("f4", self.variance[m:m + 1, k].item)
                 for m in range(4) for k, axis in enumerate("XY")}
        return found | {"health.motorPass": LogVariable("u1", lambda: self.passed),
                        "health.batterySag": LogVariable("f4", lambda: self.sag_V),
                        "health.batteryPass": LogVariable("u1", lambda: self.battery_passed),
                        "health.motorTestCount": LogVariable("u2", lambda: self.count)}
