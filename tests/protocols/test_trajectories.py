"""Names of methods are no paths."""

import pytest
from made_flights import made_flight, verdict

from estimators.onboard_ekf import OnboardEkf
from nanobench_tools.protocols import task3
from nanobench_tools.protocols.trajectories import folder_name, score_and_write


@pytest.mark.parametrize(("name", "folder"), [
    ("../../evil <b>", ".._.._evil__b_"), ("..", "__"), (".", "_"), ("", "_"), ("/etc", "_etc"), ("a\\b", "a_b"),
    ("my-filter_2.1", "my-filter_2.1"), ("a\0b", "a_b")])
def test_folder_names(name, folder):
    assert folder_name(name) == folder


def test_nothing_is_written_outside_the_folder(tmp_path):
    class Evil(OnboardEkf):
        name = "../../evil <b>"

    flight = made_flight()
    case = task3.select([flight], {flight.name: verdict(flight)}, "clean")[0]
    folder = tmp_path / "a" / "b" / "trajectories"
    score_and_write(case, Evil(), "clean", folder)
    assert [p for p in tmp_path.rglob("*") if p.is_file()] == [folder / ".._.._evil__b_" / "made.tum"]
