"""Thrust axis tilted against the tracked body.

Parameters
----------
roll_rad : float, rad
    Rotation about body x from the tracked body to the body that thrust acts along.
pitch_rad : float, rad
    The same about body y, positive with the nose down, after the roll.
"""

from types import SimpleNamespace
from typing import Any

from ...settings import number
from ..ops import Ops
from ..systematic import Systematic
from ..term import Parameter, Situation, Stage, Term
from ..vector import Components

SYSTEMATIC_RAD = number("physics.frame_tilt.systematic")
DIFFERS_RAD = number("physics.frame_tilt.differs")
"""Flights that differ by less need not differ in this."""


def turned(force: Components, p: SimpleNamespace, at: Situation, ops: Ops) -> list[Any]:
    """Rot_x(roll) Rot_y(pitch) F."""
    x, y, z = force
    sin_y, cos_y, sin_x, cos_x = ops.sin(p.pitch_rad), ops.cos(p.pitch_rad), ops.sin(p.roll_rad), ops.cos(p.roll_rad)
    x, z = cos_y * x + sin_y * z, cos_y * z - sin_y * x
    return [x, cos_x * y - sin_x * z, sin_x * y + cos_x * z]


_SOURCE = "80 NanoBench flights, test flights among them: frame of the mocap against the IMU 0.1 to 2.3 deg"

TERM = Term(
    name="frame_tilt",
    sentence="The tracked body is rolled and pitched against the one that thrust acts along. Drag is taken along the "
             "tracked axes and the whole body force is turned.",
    equation="R <- R Rot_x(roll) Rot_y(pitch) for the body force",
    parameters=(Parameter("roll_rad", "rad", -0.5, 0.5, 0.0, source=_SOURCE, unidentifiable=(0,),
                          systematic=Systematic(SYSTEMATIC_RAD),
                          differs=DIFFERS_RAD),
                Parameter("pitch_rad", "rad", -0.5, 0.5, 0.0, source=_SOURCE, unidentifiable=(0,),
                          systematic=Systematic(SYSTEMATIC_RAD),
                          differs=DIFFERS_RAD)),
    acts={Stage.TILT: turned},
    confused_with={"force_world": "two headings: a force in the world does not turn with the vehicle",
                   "wind": "two headings"},
    changes=True, scatters=("roll_rad", "pitch_rad"), frame="mocap",
)
