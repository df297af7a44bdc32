"""gyro_bias: the gyro reads a constant rate that the vehicle does not turn with.

Found by comparison with the turning of the tracked attitude, else of the estimated attitude, over the whole recording
(``signals.gyro_offset``). Without an attitude, gravity at rest shows it. Scale and tilt of the sensor are estimated
together with the offset, so that a vehicle that spins steadily gives no wrong offset. A gyro in other axes or units is
reported as that first. MEMS gyros that were not calibrated read up to 0.09 rad/s; real flights at hand have up to 0.05
rad/s.

Size: the offset of the worst axis, rad/s. Smallest found: 0.1 rad/s and four standard deviations.
"""

from ...flight import Fault, Flight
from ...signals.context import Context
from ...signals.gyro_offset import CERTAIN, LIMIT_RAD_S, gyro_offset
from ...signals.stream_frames import IMU, stream_turns
from ...signals.unit_sign_errors import wrong_units
from ...signals.wrong_matches import wrong_matches
from .kind import FaultKind
from .making import SINCE, over_stream

KIND = "gyro_bias"
TURNING = {"gyro_x", "roll", "qx"}


def find(flight: Flight, context: Context) -> list[Fault]:
    """At most one fault."""
    found = context.once(gyro_offset)
    if found is None or not found.wrong or _misread(context):
        return []
    names = [IMU[0][i] for i in found.wrong]
    worst = max(found.wrong, key=lambda i: abs(found.offset_rad_s[i]))
    read = ", ".join(f"{IMU[0][i]} {found.offset_rad_s[i]:+.3f}" for i in found.wrong)
    mend = ", ".join(f"{-found.offset_rad_s[i]:+.3f}" for i in found.wrong)
    return [over_stream(KIND, flight, "imu", names, float(found.offset_rad_s[worst]), "rad/s",
                        f"the gyro has a constant offset ({read} rad/s): write offset = {mend} into the column map"
                        f"{SINCE}it reads this beyond what {found.by} (within {found.sd_rad_s[worst]:.2g} rad/s)",
                        LIMIT_RAD_S + CERTAIN * float(found.sd_rad_s[worst]))]


def _misread(context: Context) -> bool:
    """Whether gyro or attitude are in other axes or units, which explains a constant rate."""
    wrong = any(TURNING & set(m.quantities) for m in context.once(wrong_matches))
    turned = any(turn.stream in ("imu", "mocap") for turn in context.once(stream_turns))
    return wrong or turned or any(TURNING & set(w.quantities) for w in context.once(wrong_units))


FAULT = FaultKind(KIND, find, __doc__,
                  told="{evidence}",
                  advice="calibrate the gyro at rest before a flight",
                  cuts=True, cuts_trim=False, whole=True)
