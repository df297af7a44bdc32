"""``import nanobench_tools as nb``: every public name has an example that runs; bad input gets one line."""

import doctest
import importlib
import json
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import nanobench_tools as nb
from nanobench_tools import Flight, Flights, InputError, UsageError
from nanobench_tools.api.quiet_options import in_python
from nanobench_tools.steps.sentences import estimated

EXAMPLES = ("loading", "audited", "controlled", "practised", "reported")
LONG_EXAMPLES = ("estimated", "fitted", "diagnosed")


@pytest.fixture(scope="module")
def flights():
    """Those of the examples."""
    return nb.simulate(2, seed=1, seconds=12.0)


@pytest.fixture
def throwaway(tmp_path, monkeypatch):
    """Examples make temporary folders and leave them to the system."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


def run_examples(name):
    module = importlib.import_module(f"nanobench_tools.api.{name}")
    found = doctest.testmod(module)
    assert found.attempted > 1
    assert found.failed == 0


@pytest.mark.usefixtures("throwaway")
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples(name):
    run_examples(name)


@pytest.mark.slow
@pytest.mark.usefixtures("throwaway")
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
    assert found[flights.names[1]] is found[1]
    assert found[:1].table.index.tolist() == flights.names[:1]
    with pytest.raises(KeyError, match="did you mean"):
        found[flights.names[1][:-1]]
    assert found.table.shape == (2, 5)
    assert found[0].verdict in repr(found[0])
    assert set(found[0].faults.columns) >= {"kind", "what", "advice"}
    assert found[0].flight.name in found[0]._repr_html_()


@pytest.mark.parametrize("names", [["f"], ["x" * 255], [f"{'long_' * 40}{i}" for i in range(102)]])
def test_what_a_prompt_shows_is_short(flights, names):
    many = Flights([replace(flights[0], name=name) for name in names])
    assert len(repr(many)) < 2500
    assert len(repr(many[0])) < 400
    assert max(len(repr(stream)) for stream in flights[0].streams.values()) < 400


def test_a_flight_is_cut_by_time_and_gives_its_streams(flights):
    flight = flights[0]
    cut = flight[2.0:6.0]
    assert (cut["imu"].time_s[0] >= 2.0, cut["imu"].time_s[-1] <= 6.0) == (True, True)
    assert cut.duration_s == pytest.approx(4.0, abs=0.05)
    assert flight[5.0:].keys() == flight.keys() == tuple(flight.streams)
    assert flight[:].duration_s == flight.duration_s
    with pytest.raises(TypeError, match="without a step"):
        flight[::2]
    with pytest.raises(ValueError, match="ends before it starts"):
        flight[6.0:2.0]


def written(figure):
    return " ".join(a.text for a in figure.layout.annotations)


def test_plots_say_what_is_missing(flights):
    flight = flights[0].without_streams("imu", "battery")
    figure = flight.plot()
    assert "no imu stream" in written(figure)
    assert "no battery stream" in written(figure)
    assert len(figure.data) == len(flights[0].plot().data) - 4
    blind = flights[0].without_streams("mocap", "estimator")
    assert "no height" in written(nb.audit(blind).plot())


def test_a_blackout_is_drawn_over_the_time_since_the_last_pose(flights):
    found = nb.estimate(flights, ["strapdown"], "blackout")
    (line,) = found.plot().data
    assert list(line.x) == [1, 5, 10, 20]
    assert line.y[0] == found.metrics["end_error_1s_m"]["strapdown"]


@pytest.mark.parametrize(("text", "python"), [
    ("try --clock retimed", 'try clock="retimed"'),
    ("draft a map (nanobench columns FILE --out MAP.toml) and read it with --columns MAP.toml",
     'draft a map (nanobench columns FILE --out MAP.toml) and read it with columns="MAP.toml"'),
    ("nanobench audit shows it; give --train and --test", "nb.audit shows it; give train and test"),
    ("a -- b, x--data", "a -- b, x--data")])
def test_advice_speaks_python(text, python):
    assert in_python(text) == python


def test_errors_of_reading_name_arguments(tmp_path):
    (tmp_path / "strange.csv").write_text("t,foo\n0,1\n1,2\n")
    (tmp_path / "stand.csv").write_text("pwm,thrust [N],voltage [V]\n" + "".join(
        f"{3000 * k},{0.01 * k},4.0\n" for k in range(20)))
    with pytest.raises(UsageError, match=r'read it with columns="MAP\.toml"'):
        nb.load(tmp_path / "strange.csv")
    read = nb.load(tmp_path)
    assert 'columns="MAP.toml"' in read.failed[0]["error"]
    assert "--columns" not in read.failed[0]["error"]


@pytest.mark.parametrize("function", [nb.thrust, nb.fit])
def test_a_mass_in_grams_is_named_as_the_argument(function):
    with pytest.raises(UsageError) as found:
        function(nb.sample()[0], mass_kg=40.0)
    assert "--" not in str(found.value)



@pytest.mark.slow
def test_an_error_names_the_argument_of_python(flights):
    with pytest.raises(UsageError, match='clock="joint" cannot judge') as told:
        nb.estimate(flights, "onboard_ekf", "clean", clock="joint")
    assert "--clock" not in str(told.value)


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
    assert list(found.metrics.index) == ["still", "drag_ekf"]
    assert found.metrics["ate_rmse_m"]["drag_ekf"] < found.metrics["ate_rmse_m"]["still"]
    long = found.table.query("metric == 'ate_rmse_m' and group == 'all'").set_index("method")["mean"]
    assert (long == found.metrics["ate_rmse_m"]).all()
    truth = found[flights[0].name]["truth"]
    assert 0.0 <= truth.index[0] < truth.index[-1] <= flights[0].duration_s  # seconds of the flight
    assert len(found.plot(flights[1].name).data) == 3
    assert "drag_ekf: ate_rmse_m" in repr(found)


@pytest.mark.parametrize(("call", "error", "words"), [
    (lambda f: nb.audit([]), UsageError, "no flight given"),
    (lambda f: nb.audit("flights/"), UsageError, "nb.load"),
    (lambda f: nb.audit([1]), UsageError, "a int is no Flight"),
    (lambda f: nb.thrust(Path("a.csv")), UsageError, "is no Flight; nb.load"),
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


def test_a_sentence_has_the_unit_of_its_table():
    row = SimpleNamespace(protocol="aided", clock="as-recorded", group="all", inputs="poses", method="mine", n=2,
                          metrics={"ate_rmse_m": SimpleNamespace(mean=0.0274, ci95=(0.02, 0.031))})
    assert estimated([row]) == "aided: ATE 27.4 mm [20.0, 31.0] by mine (2 flights)"


def test_the_sentence_leaves_the_published_protocol_to_the_tables_and_hides_none_of_its_groups():
    def row(protocol, group, error, clock="as-recorded"):
        return SimpleNamespace(protocol=protocol, clock=clock, group=group, inputs="poses", method="mine", n=1,
                               metrics={"ate_rmse_m": SimpleNamespace(mean=error, ci95=None)})

    published = [row("as-published", "Medium", 0.02), row("as-published", "Fast", 6.8)]
    assert estimated(published) == ("as-published Medium: ATE 20.0 mm by mine (1 flight). "
                                    "as-published Fast: ATE 6800.0 mm by mine (1 flight)")
    assert estimated([*published, row("clean", "all", 0.03), row("clean", "all", 0.01, "retimed")]) == (
        "clean: ATE 30.0 mm by mine (1 flight)")
