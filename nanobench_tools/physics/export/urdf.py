"""A model as URDF of gym-pybullet-drones: the elements and attributes its ``BaseAviary`` reads from assets/cf2x.urdf.

Rotor speeds there are in RPM. T = kf RPM^2, yaw torque km RPM^2 with signs -, +, -, + of propellers 0..3, which are
motors 1..4. ``Physics.PYB`` and those that add to it push at the propellers' links; ``Physics.DYN`` uses ``arm`` and a
square frame. Ground effect is T gnd_eff_coeff (prop_radius / (4 z))^2. Drag is -drag_coeff sum(Omega) v with Omega in
rad/s and v in the world. Gravity is 9.8 m/s^2. Thrust follows at once.
"""

import math
import xml.etree.ElementTree as ET
from pathlib import Path

from ...errors import InputError
from ...results.result_files import write_bytes
from ..model import Model
from .account import Account, Exported, account
from .rotors import RAD_S_PER_RPM, Assumed, command_lines, get, rotors

GRAVITY_M_S2 = 9.8
"""Fixed in gym-pybullet-drones."""
SPIN = (-1.0, 1.0, -1.0, 1.0)
"""Signs of the yaw torque of its propellers 0..3."""
RADIUS_M = 0.0231348
COLLISION_M = (0.06, 0.025)
MAX_SPEED_KMH = 30.0
"""Propeller, cylinder (radius, height) and greatest speed of the original cf2x.urdf, for models without them."""

EXACT = {"mass": "", "inertia": "", "thrust_rpm": "kf", "yaw_torque": "km",
         "com_offset": "propellers placed about the centre of mass"}
APPROXIMATED = {
    "com_offset": "propellers placed about the centre of mass; drag has no moment about it",
    "drag_linear": "equal at the summed rotor speed of hover, along world axes, x and y by their mean",
    "drag_rotor": "along world axes, x and y by their mean", "ground_effect": "first order in (R / (4 z))^2",
}


def robot(model: Model, assumed: Assumed | None = None) -> tuple[ET.Element, Account]:
    """(the robot, what it expresses). Raises InputError for other spins and models without hover."""
    about = rotors(model, assumed or Assumed())
    if tuple(about.spin) not in (SPIN, tuple(-s for s in SPIN)):
        raise InputError("model", f"spin {list(about.spin)}", f"gym-pybullet-drones knows only {list(SPIN)}")
    order = range(4) if tuple(about.spin) == SPIN else (1, 2, 3, 0)
    motors = [about.motors_m[i] for i in order]
    linear, rotor = get(model, "drag_linear", "d", (0.0,) * 3), get(model, "drag_rotor", "d", (0.0,) * 3)
    drag = [d / about.sum_rad_s + r for d, r in zip(linear, rotor, strict=True)]
    used = {**about.assumed, "g": f"{GRAVITY_M_S2:g} m/s^2 is fixed there; the model has {about.gravity_m_s2:g}",
            "collision": "cylinder of radius {:g} m and height {:g} m".format(*COLLISION_M),
            "max_speed_kmh": f"{MAX_SPEED_KMH:g}", "dw_coeff": "no downwash on other vehicles"}
    if "ground_effect" not in model:
        used["prop_radius"] = f"{RADIUS_M:g} m"
    if tuple(about.spin) != SPIN:
        used["order"] = "propellers 0..3 are motors 2, 3, 4, 1, whose spins fit; Physics.DYN does not"
    root = ET.Element("robot", name="cf2")
    ET.SubElement(root, "properties", {key: repr(float(value)) for key, value in {
        "arm": sum(math.hypot(x, y) for x, y, _ in about.motors_m) / 4.0,
        "kf": about.k_f * RAD_S_PER_RPM**2, "km": about.k_m * RAD_S_PER_RPM**2,
        "thrust2weight": 4.0 * about.thrust_max_N / (about.mass_kg * GRAVITY_M_S2), "max_speed_kmh": MAX_SPEED_KMH,
        "gnd_eff_coeff": get(model, "ground_effect", "rho", 0.0),
        "prop_radius": get(model, "ground_effect", "R", RADIUS_M),
        "drag_coeff_xy": 0.5 * (drag[0] + drag[1]), "drag_coeff_z": drag[2],
        "dw_coeff_1": 0.0, "dw_coeff_2": 0.0, "dw_coeff_3": 1.0}.items()})
    base = _link(root, "base_link", (0.0, 0.0, 0.0), about.mass_kg, about.inertia_kg_m2)
    for part in ("visual", "collision"):  # the order of the children is how they are found there
        place = ET.SubElement(base, part)
        ET.SubElement(place, "origin", rpy="0 0 0", xyz="0 0 0")
        shape = ET.SubElement(place, "geometry")
        ET.SubElement(shape, "cylinder", radius=repr(COLLISION_M[0]), length=repr(COLLISION_M[1]))
    for name, where in [*((f"prop{i}", motor) for i, motor in enumerate(motors)), ("center_of_mass", (0.0, 0.0, 0.0))]:
        _link(root, f"{name}_link", where, 0.0, (0.0, 0.0, 0.0))
        joint = ET.SubElement(root, "joint", name=f"{name}_joint", type="fixed")
        ET.SubElement(joint, "parent", link="base_link")
        ET.SubElement(joint, "child", link=f"{name}_link")
    dragged = any(term.name.startswith("drag_") for term in model.terms)
    exact = {name: text for name, text in EXACT.items() if not (dragged and name == "com_offset")}
    return root, account(model, "gym-pybullet-drones", exact, APPROXIMATED, used)


def _link(root: ET.Element, name: str, where: tuple[float, ...], mass: float, inertia: tuple[float, ...]) -> ET.Element:
    link = ET.SubElement(root, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", rpy="0 0 0", xyz=" ".join(map(repr, where)))
    ET.SubElement(inertial, "mass", value=repr(mass))
    moments = dict(zip(("ixx", "iyy", "izz"), map(repr, inertia), strict=True))
    ET.SubElement(inertial, "inertia", {"ixy": "0.0", "ixz": "0.0", "iyz": "0.0", **moments})
    return link


def write_urdf(model: Model, folder: Path, assumed: Assumed | None = None) -> Exported:
    """cf2x.urdf, to lie in the place of gym_pybullet_drones/assets/cf2x.urdf."""
    root, about = robot(model, assumed)
    k_f = float(root[0].attrib["kf"]) / RAD_S_PER_RPM**2
    lines = ["For gym-pybullet-drones, in the place of assets/cf2x.urdf; propellers 0..3 are motors 1..4.",
             *command_lines(model, k_f), "  RPM = Omega 30 / pi", *about.lines()]
    comment = "\n".join(f"  {line}" for line in lines).replace("--", "- -")
    ET.indent(root)
    text = f'<?xml version="1.0" ?>\n<!--\n{comment}\n-->\n{ET.tostring(root, encoding="unicode")}\n'
    path = Path(folder) / "cf2x.urdf"
    write_bytes(path, text.encode())
    return Exported((path,), about)
