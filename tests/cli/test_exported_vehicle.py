"""What ``sysid`` says about the exported vehicle and the model that predicts best: measured figures of both."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from nanobench_tools.cli.sysid import SIMULATOR, trade

METRICS = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")


def row(model: str, error: float, answer: float | None, truth: str = "onboard"):
    roll = SimpleNamespace(after_s={"0.2": SimpleNamespace(answer=answer)})
    return SimpleNamespace(model=model, group="all", truth=truth, start="centred",
                           metrics={name: {"50": error} for name in METRICS},
                           command_response=None if answer is None else SimpleNamespace(roll=roll))


@pytest.mark.parametrize(("answer", "words"), [(0.25, "(0.04 m, 0.04 m/s, 0.04 rad, 0.04 rad/s), and answers a roll "
                                                      "command with 0.12 of what the vehicle does."),
                                               (None, "(0.04 m, 0.04 m/s, 0.04 rad, 0.04 rad/s).")])
def test_both_errors_and_the_answer_to_a_command_are_those_of_the_rows(answer, words):
    said = trade([row("best", 0.04, answer), row(SIMULATOR, 0.5, 2.0), row("best", 0.7, 1.0, "mocap"),
                  row(SIMULATOR, 0.9, 1.0, "mocap")], "vehicle", "best")
    assert said.startswith("Exported is vehicle, a physical vehicle: off by 0.5 m,")
    assert said.endswith(words)


def test_one_model_has_nothing_to_compare_with():
    assert trade([row(SIMULATOR, 0.5, 2.0)], "vehicle", "vehicle") == ""
    assert trade([row(SIMULATOR, 0.5, 2.0)], "vehicle", "best") == ""
