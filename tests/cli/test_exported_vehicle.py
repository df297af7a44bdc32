"""What ``sysid`` says about the exported vehicle and the model that predicts best: measured figures of both."""

from types import SimpleNamespace

import pytest

from nanobench_tools.cli.sysid import SIMULATOR, trade
from nanobench_tools.steps.sentences import predicted

METRICS = ("position_mae_m", "velocity_mae_m_s", "attitude_mae_rad", "rate_mae_rad_s")


def row(model: str, error: float, answer: float | None, truth: str = "onboard"):
    roll = SimpleNamespace(after_s={"0.2": SimpleNamespace(answer=answer)})
    return SimpleNamespace(model=model, group="all", truth=truth, start="centred",
                           metrics={name: {"50": error} for name in METRICS},
                           command_response=None if answer is None else SimpleNamespace(roll=roll))


@pytest.mark.parametrize(("answer", "words"), [(0.25, "(0.04 m, 0.04 m/s, 0.04 rad, 0.04 rad/s); its response to a "
                                                      "roll command is 0.12 of the vehicle's."),
                                               (None, "(0.04 m, 0.04 m/s, 0.04 rad, 0.04 rad/s).")])
def test_both_errors_and_the_answer_to_a_command_are_those_of_the_rows(answer, words):
    said = trade([row("best", 0.04, answer), row(SIMULATOR, 0.5, 2.0), row("best", 0.7, 1.0, "mocap"),
                  row(SIMULATOR, 0.9, 1.0, "mocap")], "vehicle", "best")
    assert said.startswith("simulator.toml is a physical vehicle: off by 0.5 m,")
    assert said.endswith(words)


@pytest.mark.parametrize(("other", "words"), [
    (0.3, "best of class state: chosen, off by 0.2 m after half a second (1 flight)"),
    (0.1, "best of class state on the training flights: chosen, off by 0.2 m after half a second (1 flight); "
          "smallest error on these flights: other, 0.1 m")])
def test_a_model_is_the_best_only_of_the_flights_it_was_chosen_on(other, words):
    rows = [SimpleNamespace(**vars(row(model, error, None)), clock="as-recorded", information="state", trouble="",
                            n_flights=1)
            for model, error in (("chosen", 0.2), ("other", other))]
    assert predicted(SimpleNamespace(rows=rows, models=SimpleNamespace(best="chosen"))) == words


def test_one_model_has_nothing_to_compare_with():
    assert trade([row(SIMULATOR, 0.5, 2.0)], "vehicle", "vehicle") == ""
    assert trade([row(SIMULATOR, 0.5, 2.0)], "vehicle", "best") == ""
