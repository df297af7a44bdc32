"""The simulated Crazyflie without a radio: packets in, packets out, on the vehicle's own millisecond tick."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from ...firmware.records import ABSOLUTE, SETPOINT, VELOCITY
from ..crtp import Packet, Port
from . import commander, supervisor
from .commander import Commander
from .console import Console
from .health import Health
from .high_level import HighLevel
from .link import PROTOCOL_VERSION, answer_link, answer_platform
from .localization import Localization
from .log import SILENCE_MS, Log, LogVariable
from .log_table import stabilizer_variables
from .mem import Memory
from .param_table import Selection, attribute, constant, stabilizer_parameters
from .params import Parameter, Parameters
from .setpoints import RollPitchYawThrust, generic
from .supervisor import Seen, State, Supervisor
from .vehicle_protocol import Vehicle

SLICE_MS = 10
"""The firmware's slow work (high-level commander, and every fourth time the supervisor) is done so often."""
_META_NOTIFY_STOP = 0
LAMPS = ("ring.effect", "led.bitmask", "sound.effect")
"""Parameters that programs set, but that have no effect on what this simulated vehicle sends."""


class Sent(NamedTuple):
    """A packet that leaves the vehicle at a tick."""

    tick_ms: int
    packet: Packet


@dataclass(frozen=True)
class Build:
    """Options of the firmware. ``positioning``: a deck gives the filter its position 100 times a second (else poses
    must come over the radio). ``protocol_version``: the reported one. ``without``: missing log variables, or whole
    groups."""

    positioning: bool = False
    protocol_version: int = PROTOCOL_VERSION
    without: tuple[str, ...] = ()


class Onboard:
    """Services, commander and supervisor around a vehicle; ``tick_ms`` is the vehicle's clock."""

    def __init__(self, vehicle: Vehicle, build: Build | None = None) -> None:
        self.vehicle, self.build = vehicle, build or Build()
        s = vehicle.stabilizer
        self.console, self.memory, self.commander = Console(), Memory(), Commander()
        self.supervisor = Supervisor(self.console.say)
        self.high_level = HighLevel(self.memory.trajectory)
        self.rpyt = RollPitchYawThrust()
        self.lamps = SimpleNamespace(**{name.replace(".", "_"): 0 for name in LAMPS})
        self.localization = Localization(s, self.supervisor.stop, self._feed_watchdog)
        self.selection = Selection(s, self.console.say, self.supervisor.stop)
        self.health = Health(s, self.console.say)
        self.log, self.params = Log(self._log_variables()), Parameters(self._parameters())
        self._held = np.zeros(1, SETPOINT)
        self._heard_ms = self.tick_ms
        self._answers: dict[Port, Callable[[Packet], list[Packet]]] = {
            Port.LINK: answer_link, Port.PARAM: self.params.answer, Port.MEMORY: self.memory.answer,
            Port.LOG: lambda p: self.log.answer(p, self.tick_ms),
            Port.HIGH_LEVEL: lambda p: self.high_level.answer(p, self.tick_ms),
            Port.PLATFORM: lambda p: answer_platform(p, self.supervisor.arm, self.supervisor.recover,
                                                     self.build.protocol_version),
        }

    @property
    def tick_ms(self) -> int:
        """Milliseconds since the vehicle was switched on."""
        return int(self.vehicle.stabilizer.run["t_ms"][0])

    def receive(self, packet: Packet) -> list[Packet]:
        """Receive one packet at the present tick; returns the immediate answers."""
        self._heard_ms = self.tick_ms
        if packet.port in self._answers:
            return self._answers[Port(packet.port)](packet)
        if packet.port == Port.RPYT and packet.channel == 0:
            self._offer(self.rpyt.read(packet.data))
        elif packet.port == Port.GENERIC and packet.channel == 0:
            self._offer(generic(packet.data))
        elif packet.port == Port.GENERIC and packet.channel == 1 and packet.data[:1] == bytes([_META_NOTIFY_STOP]):
            e = self.vehicle.stabilizer.loop["estimate"][0]
            self.high_level.tell(e["position_m"], e["velocity_m_s"], math.radians(e["attitude_deg"][2]))
            self.commander.relax()
        elif packet.port == Port.LOCALIZATION:
            self.localization.take(packet)
        return []

    def advance(self, until_ms: int) -> list[Sent]:
        """Runs the vehicle up to a tick; the packets that leave it on the way."""
        found: list[Sent] = []
        now = self.tick_ms
        while now < until_ms:
            if now % SLICE_MS == 0:
                self._slow(now)
            due = self.log.due_ms()
            end = min(until_ms, now - now % SLICE_MS + SLICE_MS, until_ms if due is None else max(due, now + 1))
            self._apply()
            if self.health.running:
                end = now + 1
                self.health.step()
            self.vehicle.advance(end - now)
            if self.health.running:
                self.health.seen()
            now = end
            if now - self._heard_ms > SILENCE_MS:
                self.log.stop()
            found += [Sent(now, p) for p in self.console.take()]
            found += [Sent(now, p) for p in self.log.due(now)]
        return found

    def _offer(self, setpoint: np.ndarray | None) -> None:
        """A set-point from the radio; it ends what the high-level commander was doing."""
        if setpoint is not None and self.commander.offer(setpoint, commander.RADIO, self.tick_ms):
            self.high_level.stop()

    def _feed_watchdog(self) -> None:
        self.supervisor.feed_watchdog(self.tick_ms)

    def _slow(self, now: int) -> None:
        loop = self.vehicle.stabilizer.loop[0]
        self.high_level.blocked = not self.supervisor.motors_allowed
        if self.high_level.blocked and self.high_level.status[0]:
            self.high_level.stop()
        planned = self.high_level.update(now, loop["estimate"])
        if planned is not None:
            self.commander.offer(planned, commander.HIGH_LEVEL, now)
        if now % supervisor.EVERY_MS == 0 and not self.health.running:
            seen = Seen(loop["acc_g"], self.commander.age_ms(now), int(loop["step"] - loop["motor_on_step"]))
            self.supervisor.update(seen, now)
        if self.build.positioning:
            position, _, quaternion = self.vehicle.true_pose()
            self.vehicle.stabilizer.measure(position, quaternion, self.localization.position_sd_m,
                                            self.localization.attitude_sd_rad)

    def _apply(self) -> None:
        """The set-point that the controller is given: the commander's, or what the supervisor makes of it."""
        s, state = self.vehicle.stabilizer, self.supervisor.state
        s.setpoint[:] = self.commander.setpoint if self.supervisor.motors_allowed else 0
        if state == State.WARNING_LEVEL_OUT:
            one = s.setpoint[0]
            one["mode_x"] = one["mode_y"] = one["mode_quat"] = 0
            one["mode_roll"] = one["mode_pitch"] = ABSOLUTE
            one["mode_yaw"] = VELOCITY
            one["attitude_deg"][:2], one["rate_deg_s"] = 0.0, 0.0
        s.loop["allowed"], s.run["flying"] = self.supervisor.motors_allowed, self.supervisor.airborne

    def _log_variables(self) -> dict[str, LogVariable]:
        where = self.localization
        found = stabilizer_variables(self.vehicle.stabilizer)
        found |= {f"locSrv.{name}": LogVariable("f4", where.last[i:i + 1].item)
                  for i, name in enumerate(("x", "y", "z", "qx", "qy", "qz", "qw"))}
        found["supervisor.info"] = LogVariable("u2", lambda: self.supervisor.info(self.high_level.status))
        found |= self.health.variables()
        found["sys.canfly"] = LogVariable("u1", lambda: self.supervisor.motors_allowed)
        found["sys.isFlying"] = LogVariable("u1", lambda: self.supervisor.flying)
        found["sys.isTumbled"] = LogVariable("u1", lambda: self.supervisor.tumbled)
        found["radio.rssi"] = LogVariable("u1", lambda: 45)
        found["radio.isConnected"] = LogVariable("u1", lambda: self.tick_ms - self._heard_ms < SILENCE_MS)
        hidden = self.build.without
        return {name: v for name, v in sorted(found.items()) if name not in hidden and name.split(".")[0] not in hidden}

    def _parameters(self) -> dict[str, Parameter]:
        where, mode = self.localization, self.rpyt.mode
        found = stabilizer_parameters(self.vehicle.stabilizer) | self.selection.parameters()
        found |= self.health.parameters()
        found |= {f"flightmode.{name}": attribute(mode, name, "u1") for name in vars(mode)}
        found["locSrv.extPosStdDev"] = attribute(where, "position_sd_m", "f4")
        found["locSrv.extQuatStdDev"] = attribute(where, "attitude_sd_rad", "f4")
        found["supervisor.tmblChckEn"] = attribute(self.supervisor, "checks_tumbling", "u1")
        found["commander.enHighLevel"] = attribute(self.high_level, "enabled", "u1")
        found["firmware.revision0"], found["firmware.revision1"] = constant(0x252B4134, "u4"), constant(0x1A07, "u2")
        found["firmware.modified"] = constant(0, "u1")
        for i in range(3):
            found[f"cpu.id{i}"] = constant(0x4E42 + i, "u4")
        found["deck.bcLighthouse4"] = constant(int(self.build.positioning), "u1")
        found |= {name: attribute(self.lamps, name.replace(".", "_"), "u1", True) for name in LAMPS}
        for deck in ("bcFlow2", "bcDWM1000", "bcUSD", "bcMultiranger", "bcLoco"):
            found[f"deck.{deck}"] = constant(0, "u1")
        return dict(sorted(found.items()))
