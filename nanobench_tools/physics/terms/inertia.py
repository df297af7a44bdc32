"""Another moment of inertia than the vehicle's table says."""

from ..term import Parameter, Stage, Term


def inertia(value, p, at, ops):
    return list(p.inertia_kg_m2)


TERM = Term(
    name="inertia",
    sentence="The moments of inertia about body x, y and z, off-diagonal ones zero.",
    equation="J = diag(inertia)",
    parameters=(Parameter("inertia_kg_m2", "kg m^2", 1e-8, 5.0, (1.8e-5, 1.8e-5, 3.1e-5), neutral="inertia_kg_m2",
                          length=3, source="firmware controller_lee.c 1.66e-5, 1.67e-5, 2.93e-5, scaled for load"),),
    acts={Stage.INERTIA: inertia},
    confused_with={"thrust_scale": "climbs: thrust acts on the motion too, inertia only on rotation",
                   "yaw_torque": "only k_m / J_z is seen: a pendulum measurement"},
)
