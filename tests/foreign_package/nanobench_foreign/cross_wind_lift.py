"""A term: what blows across the body lifts it, in proportion to the speed of the air along y squared.

It declares what it is and how it acts; all that lists of ours would have to know of it follows.
"""

from nanobench_tools.physics.term import Parameter, Stage, Term


def force(body_force, p, at, ops):
    """F_b (3) N -> with the lift."""
    x, y, z = body_force
    return [x, y, z + p.k * (at.air_b[1] * at.air_b[1])]


TERM = Term(
    name="cross_wind_lift",
    sentence="Air that comes from the side lifts the body.",
    equation="F_bz <- F_bz + k v_by^2, v_b air velocity",
    parameters=(Parameter("k", "N s^2/m^2", 0.0, 1.0, 0.04, source="made up for a test"),),
    acts={Stage.BODY_FORCE: force},
    confused_with={"inflow": "the same speed along x: only inflow lifts there too"},
    left_out={"": "no other simulator lifts a body that is blown at from the side"},
)
