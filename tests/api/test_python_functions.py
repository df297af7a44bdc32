"""``import nanobench_tools as nb``: every public name has an example that runs; bad input gets one line."""

import doctest
import importlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

import nanobench_tools as nb
from nanobench_tools import Flight, InputError, UsageError

EXAMPLES = ("loading", "audited", "practised", "reported")
LONG_EXAMPLES = ("estimated", "fitted", "diagnosed")


@pytest.fixture(scope="module")
def flights():
    """Those of the examples."""
    return nb.simulate(2, seed=1, seconds=12.0)


def run_examples(name):
    module = importlib.import_module(f"nanobench_tools.api.{name}")
    found = doctest.testmod(module)
    assert found.attempted > 1
    assert found.failed == 0


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples(name):
    run_examples(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG_EXAMPLES)
def test_long_examples(name):
    run_examples(name)


def test_every_public_function_has_an_example():
    for name in nb.__all__:
        found = getattr(nb, name)
        if callable(found) and not isinstance(found, type) and found.__module__.startswith("nanobench_tools.api"):
            assert f"nb.{name}(" in (found.__doc__ or "").partition(">>> ")[2], name


def test_the_stub_and_the_package_hold_the_same_names():
    text = Path(nb.__file__).with_suffix(".pyi").read_text()
    assert {name for name in nb.__all__ if f" as {name}" not in text} == set()
    assert set(nb.__all__) <= set(dir(nb))


def test_nothing_heavy_is_imported_with_the_package():
    code = "import sys, json, nanobench_tools; print(json.dumps(sorted(sys.modules)))"
    loaded = json.loads(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout)
    assert not {"numpy", "scipy", "pandas", "plotly", "casadi", "numba", "rich"} & set(loaded)


def test_flights_are_a_list_with_names_and_a_table(flights):
    assert len(flights) == 2
    assert flights[flights.names[1]] is flights[1]
    assert flights[1:].names == flights.names[1:]
    assert (flights.table["data"] == "SYNTHETIC").all()
    assert len(repr(flights)) < 1000
    assert flights.names[1] in flights._repr_html_()
    with pytest.raises(KeyError, match="no flight 'x'"):
        flights["x"]


def test_several_audits_are_a_table(flights):
    found = nb.audit(flights)
    assert found.table.shape == (2, 5)
    assert found[0].verdict in repr(found[0])
    assert set(found[0].faults.columns) >= {"kind", "what", "advice"}
    assert found[0].flight.name in found[0]._repr_html_()


def test_a_name_is_escaped_where_it_becomes_html(flights):
    assert "<script>" not in nb.audit(replace(flights[0], name="<script>x"))._repr_html_()


class Still:
    """Says that it is where it was told last."""

    name, causal = "still", True

    def estimate(self, flight: Flight) -> nb.Estimate:
        mocap = flight["mocap"]
        return nb.Estimate(mocap.time_s, mocap["px", "py", "pz"], mocap["qx", "qy", "qz", "qw"])


def test_estimates_of_ones_own_object_beside_a_name(flights):
    found = nb.estimate(flights, [Still(), "drag_ekf"])
    assert {"still", "drag_ekf", "truth"} == set(found.trajectories)
    mean = found.metrics.query("metric == 'ate_rmse_m' and group == 'all'").set_index("method")["mean"]
    assert mean["drag_ekf"] < mean["still"]
    assert "drag_ekf: ate_rmse_m" in repr(found)


@pytest.mark.parametrize(("call", "error", "words"), [
    (lambda f: nb.audit([]), UsageError, "no flight given"),
    (lambda f: nb.audit("flights/"), UsageError, "nb.load"),
    (lambda f: nb.audit([1]), UsageError, "a int is no Flight"),
    (lambda f: nb.load("/nonexistent"), InputError, "does not exist"),
    (lambda f: nb.simulate(0), UsageError, "at least one"),
    (lambda f: nb.simulate(1, family="figure9"), UsageError, "figure9"),
    (lambda f: nb.compare(f, ["drag_ekf"]), UsageError, "two methods"),
    (lambda f: nb.estimate(f, "drag_efk"), UsageError, "drag_efk"),
    (lambda f: nb.estimate(f, object()), UsageError, "none of the estimators"),
    (lambda f: nb.estimate(f, protocol="x"), UsageError, "x"),
    (lambda f: nb.fit(f, mass_kg=41.0), UsageError, "grams"),
    (lambda f: nb.diagnose(f, "/nonexistent.toml"), InputError, "nonexistent"),
    (lambda f: nb.nothing, AttributeError, "nothing"),
])
def test_bad_input_gets_one_line(flights, call, error, words):
    with pytest.raises(error) as told:
        call(flights)
    assert words in str(told.value), str(told.value)
    assert "\n" not in str(told.value)


def test_two_flights_of_one_name_are_refused(flights):
    with pytest.raises(UsageError, match="two flights are called"):
        nb.audit([flights[0], flights[0]])
