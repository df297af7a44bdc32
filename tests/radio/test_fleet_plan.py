"""Plans of fleets: their distances, and mistakes in them in one line. No vehicle flies."""

import numpy as np
import pytest
from fleet_plans import TWO, fleet

from nanobench_tools.cli import simulate_serve
from nanobench_tools.cli.main import main
from nanobench_tools.errors import InputError
from nanobench_tools.radio.fleet import separation
from nanobench_tools.radio.fleet.fleet_plan import read_fleet
from nanobench_tools.radio.fleet.separation import Separation, check_plans, timeline


def plans(path):
    return {v.name: (v.plan(), v.delay_s) for v in read_fleet(path).vehicles}


def test_paths_lie_where_the_vehicles_are(tmp_path):
    left, right = read_fleet(fleet(tmp_path)).vehicles
    for vehicle, y in ((left, -0.8), (right, 0.8)):
        points = vehicle.path.at(np.linspace(0.0, 4.0, 401)).position_m
        assert np.linalg.norm(points[:, :2] - [0.0, y], axis=1) == pytest.approx(np.full(401, 0.4), abs=1e-6)
    high = read_fleet(fleet(tmp_path, ("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.1, 0.8, 0.3]"))).vehicles
    assert high[1].plan().height_m == pytest.approx(right.plan().height_m + 0.3)


def test_two_circles_side_by_side_keep_their_distance(tmp_path):
    """Centres 1.6 m apart, radii of 0.4 m: at least 0.8 m; on the ground and in phase 1.6 m."""
    (one, other, least), = check_plans(plans(fleet(tmp_path)), Separation())
    assert (one, other) == ("left", "right")
    assert 0.8 <= least <= 1.6


@pytest.mark.parametrize("change", [
    ("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.0, -0.5, 0.0]"),   # the paths cross
    ("place = [0.0, 0.8]", "place = [0.0, 0.8]\ncentre = [0.0, -0.8, 0.9]"),   # one above the other: landing
    ("place = [0.0, 0.8]", "place = [0.0, -0.7]\ncentre = [0.0, 0.8, 0.0]"),   # they take off next to each other
])
def test_plans_that_come_too_close_are_refused_before_a_link_is_opened(change, tmp_path, capsys):
    assert main(["fly", "--fleet", str(fleet(tmp_path, change)), "--mocap", "simulated"]) == 2
    err = capsys.readouterr().err
    assert "left and right: their plans come too close" in err
    assert "not armed" in err
    assert len(err.splitlines()) == 1


def test_a_vehicle_that_takes_off_late_is_checked_too(tmp_path, monkeypatch):
    """Two circles 0.7 m apart, flown in phase: always 0.7 m. At 0.5 m/s, 0.8 s late is another 0.4 m."""
    path = fleet(tmp_path, ("place = [0.0, 0.8]", "place = [0.0, -0.1]"), ("delay_s = 1.0", "delay_s = 0.0"))
    with pytest.raises(InputError, match="too close"):
        check_plans(plans(path), Separation())
    monkeypatch.setattr(separation, "LATE_S", 0.0)
    (*_, least), = check_plans(plans(path), Separation())
    assert least == pytest.approx(0.7, abs=0.001)


def test_heights_count_only_where_they_are_certain(tmp_path):
    plan, _ = plans(fleet(tmp_path))["left"]
    line = timeline(plan, 2.0, np.array([0.0, 3.0, 8.0, 100.0]))
    assert line.flies.tolist() == [False, True, True, False]
    assert line.low_m == pytest.approx([0.0, 0.0, 1.0, 0.0])
    assert line.high_m == pytest.approx([0.0, 1.0, 1.0, 0.0])


VEHICLE = TWO.split("[[vehicle]]")[1]


@pytest.mark.parametrize(("path_of", "said"), [
    (lambda p: fleet(p, ("19851", "19850")), "two vehicles have the uri 'udp://127.0.0.1:19850'"),
    (lambda p: fleet(p, ('"right"', '"left"')), "two vehicles have the name 'left'"),
    (lambda p: fleet(p, text="[[vehicle]]" + VEHICLE), "has 1 [[vehicle]]; a fleet has 2 to 8"),
    (lambda p: fleet(p, text="".join(f"[[vehicle]]\nname = '{i}'\nuri = 'udp://127.0.0.1:{19850 + i}'\n"
                                     f"place = [{i}.0, 0.0]\ncontroller = 'lqr'\n" for i in range(9))), "has 9"),
    (lambda p: fleet(p, ("delay_s", "delay")), "did you mean 'delay_s'?"),
    (lambda p: fleet(p, ("delay_s = 1.0", "delay_s = 60.0")), "give a number from 0 to 20"),
    (lambda p: fleet(p, ("place = [0.0, 0.8]", "place = [0.0]")), "give 2 numbers"),
    (lambda p: fleet(p, ("place = [0.0, 0.8]", "")), "vehicle 2: place is missing"),
    (lambda p: fleet(p, ('controller = "geometric"', 'controller = "mpc_daqp"\nsimulator = "no.toml"')),
     "simulator = 'no.toml': there is no such file"),
    (lambda p: fleet(p, ('"udp://127.0.0.1:19851"', '"http://x"')), "uri = 'http://x': no URI of a Crazyflie"),
    (lambda p: fleet(p, ('"geometric"', '"geometrik"')), "did you mean 'geometric'?"),
    (lambda p: fleet(p, ("size = 0.4", "size = 4.0")), "beyond the fence"),
    (lambda p: fleet(p, text=TWO + "[separation]\nhorizontal = 1.0\n"), "did you mean 'horizontal_m'?"),
    (lambda p: fleet(p, text=TWO + "[separation]\nhorizontal_m = 1.0\n"), "vertical_m = 0.8 is below horizontal_m"),
    (lambda p: fleet(p, text=TWO + "[vehicles]\n"), "unknown key 'vehicles'"),
    (lambda p: p / "none.toml", "cannot be read"),
])
def test_a_mistake_in_the_plan_is_one_line(path_of, said, tmp_path, capsys):
    assert main(["fly", "--fleet", str(path_of(tmp_path)), "--mocap", "simulated"]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert len(err.splitlines()) == 1


def test_options_of_one_vehicle_do_not_go_with_a_fleet(tmp_path, capsys):
    for more in (["--controller", "lqr"], ["--uri", "udp://127.0.0.1:1"], ["--yaw", "3"]):
        assert main(["fly", "--fleet", str(fleet(tmp_path)), *more]) == 2
        assert f"{more[0]} does not go with --fleet" in capsys.readouterr().err
    assert main(["fly", "--fleet", str(fleet(tmp_path))]) == 2
    assert "left has no mocap" in capsys.readouterr().err


def test_a_dry_run_shows_the_distances_and_sends_nothing(tmp_path, capsys):
    assert main(["fly", "--fleet", str(fleet(tmp_path)), "--dry-run"]) == 0
    out = capsys.readouterr().out
    assert "2 plans keep their distances; nothing was sent" in out


def test_the_vehicles_of_a_plan_are_served_at_their_addresses_and_places(tmp_path, capsys):
    given = dict.fromkeys(simulate_serve.SERVE_OPTIONS)
    found = simulate_serve._spots(None, {**given, "fleet": fleet(tmp_path, ("delay_s = 1.0", "yaw_deg = 30"))})
    assert [(spot.host, spot.port, spot.start) for spot in found] == [
        ("127.0.0.1", 19850, (0.0, -0.8, 0.0, 0.0)), ("127.0.0.1", 19851, (0.0, 0.8, 0.0, 30.0))]
    assert main(["simulate", "--fleet", str(fleet(tmp_path)), "--vehicles", "2"]) == 2
    assert "--fleet FILE has the addresses" in capsys.readouterr().err
    assert main(["simulate", "--fleet", str(fleet(tmp_path, ("127.0.0.1:19851", "10.0.0.1:19851")))]) == 2
    assert "others could reach it" in capsys.readouterr().err
