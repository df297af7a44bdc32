"""Folders that cannot be judged, or not wholly: a clear line or a finding, never a name without support. SYNTHETIC."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / "mismatch"))
from hover_flights import hover

from identification.prove.folders import judge
from nanobench_tools.errors import InputError
from nanobench_tools.harness import run_items

pytestmark = pytest.mark.slow

LOST = -np.log1p(-0.25) * np.eye(4)[2]
OTHER = (0.12, -0.10, 0.09, -0.11)
"""ln of gains: every motor of another vehicle differs by itself."""


def _run(items, title):
    return run_items(items)


def _log_of_requests(flight):
    """The same flight in a log that has the commands under other names, before the battery compensation."""
    motor = flight["motor"]
    return flight.with_streams(motor=dataclasses.replace(motor, columns=tuple(f"motor.m{i}req" for i in (1, 2, 3, 4))))


@pytest.fixture(scope="module")
def normal():
    rng = np.random.default_rng(8)
    return [hover(f"usual{k}", 0.01 * rng.standard_normal(4), seed=k) for k in range(4)]


@pytest.fixture(scope="module")
def verdicts(normal):
    folders = {
        "one flight": [hover("single", LOST, seed=51)],
        "never off the ground": [hover(f"low{k}", seed=60 + k, on=False) for k in range(2)],
        "other variables": [hover("a0", LOST, seed=70), hover("a1", LOST, seed=71),
                            _log_of_requests(hover("strange", LOST, seed=72))],
        "frozen battery": [hover(f"stuck{k}", LOST, seed=80 + k, battery_V=None) for k in range(3)],
        "frozen, and all motors asked for more": [hover(f"even{k}", (0.2,) * 4, seed=90 + k, battery_V=None)
                                                  for k in range(3)],
        "another vehicle": [hover(f"swap{k}", OTHER, seed=95 + k, felt=(0.5, -0.4)) for k in range(3)],
        "nothing at all": []}
    return judge(folders, normal, _run, 0, mass_kg=0.034).verdicts


def test_one_flight_names_nothing(verdicts):
    verdict = verdicts["one flight"]
    assert verdict["outcome"] == "insufficient"
    assert verdict["findings"] == []
    assert "1 flight with a trim; 2 are needed" in verdict["paragraph"]


def test_flights_that_never_left_the_ground_say_so(verdicts):
    verdict = verdicts["never off the ground"]
    assert verdict["outcome"] == "insufficient"
    assert "never left the ground" in verdict["paragraph"]
    assert {f["flight"] for f in verdict["data_faults"]} == {"low0", "low1"}


def test_a_log_of_other_variables_is_left_out_and_the_others_judged(verdicts):
    verdict = verdicts["other variables"]
    assert verdict["findings"][0]["motors"] == [3]
    (fault,) = [f for f in verdict["data_faults"] if f["flight"] == "strange"]
    assert "a log of other variables" in fault["evidence"]


def test_a_frozen_battery_leaves_shares_of_the_motors(verdicts):
    verdict = verdicts["frozen battery"]
    assert "Without a measured battery voltage only the shares of the motors count" in verdict["paragraph"]
    assert all(f["cause"] == "propeller" and f["motors"] == [3] for f in verdict["findings"])
    assert not verdicts["frozen, and all motors asked for more"]["findings"]


def test_another_vehicle_is_no_damage(verdicts):
    verdict = verdicts["another vehicle"]
    assert all(f["cause"] == "vehicle" for f in verdict["findings"])
    assert verdict["outcome"] in ("named", "unknown")


def test_an_empty_folder_is_insufficient(verdicts):
    assert verdicts["nothing at all"]["outcome"] == "insufficient"


def test_normal_flights_without_a_trim_are_one_line(normal):
    with pytest.raises(InputError, match="1 of 3 have a trim") as error:
        judge({"a": normal[:1]}, [hover("ok", seed=1), hover("g0", seed=2, on=False), hover("g1", seed=3, on=False)],
              _run, 0)
    assert "\n" not in str(error.value)
