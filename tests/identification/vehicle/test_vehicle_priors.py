"""Priors: what is shipped is whole, what a user gives replaces it, and a mistake is one line that names the place."""

import numpy as np
import pytest

from identification.vehicle.vehicle_priors import PriorsFile, priors_of
from nanobench_tools.errors import InputError
from nanobench_tools.firmware.thrust_curve import COEFFICIENTS
from nanobench_tools.physics import Vehicle
from nanobench_tools.physics.model import find_term

HEAD = 'schema = "nanobench-priors/1"\n'
ENTRY = 'mean = 0.005\nsd = 0.001\nunit = "m"\nsource = "a torque cell"\n'


def test_every_prior_has_a_source_and_lies_inside_the_bounds_of_its_term():
    for name, belief in priors_of(Vehicle()).believed.items():
        term, _, rest = name.partition(".")
        parameter = next(p for p in find_term(term).parameters if p.name == rest.partition("[")[0])
        assert parameter.lower <= belief.mean <= parameter.upper, name
        assert belief.sd > 0.0, name
        assert len(belief.source) > 10, name


def test_the_firmware_is_one_of_the_curves_and_all_rise():
    known = priors_of(Vehicle())
    volts = np.linspace(1.0, 4.2, 50)
    assert (np.diff(np.polynomial.polynomial.polyval(volts, known.curve)) > 0.0).all()
    hover, firmware = (np.polynomial.polynomial.polyval(2.9, np.array(c)) for c in (known.curve, COEFFICIENTS))
    assert hover == pytest.approx(firmware, rel=0.1)


def test_a_users_file_replaces_what_it_lists_and_nothing_else():
    given = PriorsFile("mine.toml", HEAD + "[yaw_torque.k_m]\n" + ENTRY)
    known, shipped = priors_of(Vehicle(), given), priors_of(Vehicle())
    assert known.believed["yaw_torque.k_m"].mean == 0.005
    assert known.believed["yaw_torque.k_m"].source == "a torque cell"
    rest = {name for name in shipped.believed if shipped.believed[name] != known.believed[name]}
    assert rest == {"yaw_torque.k_m"}


def test_a_larger_vehicle_gets_scaled_and_wider_priors():
    """All mass at the motors is the most inertia there can be; a tenth of it is the least of any quadrotor."""
    large = Vehicle(mass_kg=1.0, motor_positions_m=((0.15, -0.15), (-0.15, -0.15), (-0.15, 0.15), (0.15, 0.15)))
    known = priors_of(large)
    inertia = known.believed["inertia.inertia_kg_m2[0]"]
    assert 0.1 * 1.0 * 0.15**2 < inertia.mean < 1.0 * 0.15**2
    assert inertia.sd >= 0.5 * inertia.mean
    assert "scaled from" in known.note
    hover = known.scaled_to(11.0, 9.81 / 4.0)
    assert np.polynomial.polynomial.polyval(11.0, hover.curve) == pytest.approx(9.81 / 4.0, rel=1e-3)


@pytest.mark.parametrize(("text", "words"), [
    ("x = ", "no TOML"),
    ("schema = 1\n", "schema"),
    (HEAD + "[no_such_term.x]\n" + ENTRY, "no_such_term"),
    (HEAD + "[yaw_torque.k]\n" + ENTRY, "yaw_torque.k"),
    (HEAD + "[yaw_torque.k_m]\nmean = 1.0\n", "whole entry"),
    (HEAD + "[yaw_torque.k_m]\n" + ENTRY.replace("0.001", "-1.0"), "positive"),
    (HEAD + "[yaw_torque.k_m]\n" + ENTRY.replace('"m"', '"mm"'), "numbers in m"),
    (HEAD + "[yaw_torque.k_m]\n" + ENTRY.replace("0.005", "[1.0, 2.0]"), "give 1 of each"),
    (HEAD + "[yaw_torque.k_m]\n" + ENTRY.replace("0.005", '"much"'), "numbers"),
    (HEAD + "[[thrust_curves]]\nc = [1.0]\n", "thrust_curves"),
    (HEAD + "yaw_torque = 3\n", "yaw_torque"),
])
def test_a_mistake_is_one_line_that_names_the_place(text, words):
    with pytest.raises(InputError) as told:
        priors_of(Vehicle(), PriorsFile("mine.toml", text))
    assert words in str(told.value)
    assert "mine.toml" in str(told.value)
    assert "\n" not in str(told.value)


def test_a_file_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml"):
        PriorsFile.read(tmp_path / "none.toml")
