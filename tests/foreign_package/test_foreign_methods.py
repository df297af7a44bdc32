"""A term, an estimator, a controller and a source of the foreign package go through their verbs. All data SYNTHETIC."""

import json

import pytest
from foreign_install import nanobench, python

pytestmark = pytest.mark.slow

TERM = "cross_wind_lift"
SENTENCE = "Air that comes from the side lifts the body."
NOTE = "no other simulator lifts a body that is blown at from the side"

CONCEALED = """
import json
import sys
from dataclasses import replace
from pathlib import Path
from identification.prove.make import make_case
from identification.prove.plan import TWINS, plan_cases
from identification.prove.seal import text_of
from nanobench_tools.physics.simulator import write_simulator
from nanobench_tools.sources.nanobench import write_nanobench

def hides(spec):
    return [(h.effect, h.size) for h in spec.concealed] == [({TERM!r}, "large")]

assert any({TERM!r} in group and "inflow" in group for group in TWINS)
def short(path):
    return {**path.params, "duration_s": 9.0}

spec = next(s for s in plan_cases(400, 2) if s.kind == "single" and hides(s))
spec = replace(spec, flights=tuple(replace(f, path=replace(f.path, params=short(f.path)))
                                     for f in spec.flights[:3]))
case = make_case(spec)
(effect,) = case.truth.effects
(name, entry), = effect.parameters.items()
assert (effect.term, name, entry.unit) == ({TERM!r}, {TERM!r} + ".k", "N s^2/m^2")
assert 0.07 < entry.value < 0.09 and {TERM!r} not in case.simulator
folder = Path(sys.argv[1])
for flight in case.flights:
    write_nanobench(flight, folder / "flights" / (flight.name + ".csv"))
write_simulator(case.simulator, folder / "simulator.toml")
Path(folder, "truth.json").write_bytes(text_of([case.truth]))
"""

FITTED = """
import sys
from identification.greybox.fit import GreyBox
from identification.greybox.ladder import FULL, LADDER
from identification.mismatch.size import usual
from identification.mismatch.space import space_around
from nanobench_tools.physics.simulator import read_simulator
from nanobench_tools.sources.discover import load_recordings

rung = LADDER[-1]
assert rung.name == "fit_" + {TERM!r} and set(rung.terms) == {*FULL, {TERM!r}}
assert len(LADDER) == 10
flights = load_recordings([sys.argv[1] + "/flights"]).flights
vehicle = read_simulator(sys.argv[1] + "/simulator.toml").vehicle
made = GreyBox(rung.terms, vehicle=vehicle).fit(flights)
print(made.parameters_[{TERM!r} + ".k"].value)
"""


def value_in(case) -> float:
    """Of the parameter that was concealed."""
    return json.loads((case / "truth.json").read_text())[0]["effects"][0]["parameters"][f"{TERM}.k"]["value"]


def about(script: str) -> str:
    return script.replace("{TERM!r}", repr(TERM))


@pytest.fixture(scope="module")
def case(installed, tmp_path_factory):
    """Flights and simulator.toml of a blind case that conceals the term, and what was concealed."""
    folder = tmp_path_factory.mktemp("case")
    python(folder, installed, "-c", about(CONCEALED), folder)
    return folder


@pytest.fixture(scope="module")
def diagnosed(installed, case):
    nanobench(case, installed, "diagnose", "--data", case / "flights", "--simulator", case / "simulator.toml", "--out",
              case / "out", "--jobs", 1)
    return case / "out"


def test_diagnose_names_the_term_and_the_report_says_it(case, diagnosed):
    verdict = json.loads((diagnosed / "verdict.json").read_text())
    finding = next(f for f in verdict["findings"] if TERM in (f["term"], *f["equivalent"]))
    assert finding["term"] == TERM
    low, high = finding["parameters"][f"{TERM}.k"]["ci95"]
    assert low < value_in(case) < high
    assert verdict["power"][TERM]["minimum_detectable"] > 0.0
    assert SENTENCE in verdict["paragraph"]
    assert "cross wind lift" in (diagnosed / "report.html").read_text()


def test_the_corrected_simulator_holds_the_term_and_exports_say_what_becomes_of_it(installed, diagnosed, tmp_path):
    corrected = diagnosed / "simulator_corrected.toml"
    assert f'name = "{TERM}"' in corrected.read_text()
    said = nanobench(tmp_path, installed, "convert", corrected, "--to", "all-simulators", "--out", tmp_path,
                     "--verbose")
    assert NOTE in " ".join(said.split())
    assert f"{TERM}.k" in (tmp_path / "model.c").read_text()


def test_without_the_package_the_simulator_is_refused_by_the_terms_name(diagnosed, tmp_path):
    script = ("from nanobench_tools.physics.simulator import read_simulator\n"
              "from nanobench_tools.errors import NanobenchError\n"
              f"try:\n    read_simulator({str(diagnosed / 'simulator_corrected.toml')!r})\n"
              "except NanobenchError as error:\n    print(error)\n")
    assert TERM in python(tmp_path, None, "-c", script)


def test_prove_scores_what_was_concealed(installed, case, diagnosed):
    """Dealt, flown, diagnosed and scored as ``nanobench prove`` does it, which flies longer."""
    script = ("import json, sys\nfrom identification.prove.score import score_case\n"
              "from identification.prove.truth import Truth\n"
              "from nanobench_tools.results.result import from_json, to_json\n"
              "(truth,), verdict = (json.load(open(name)) for name in sys.argv[1:])\n"
              "print(json.dumps(to_json(score_case(from_json(Truth, truth), verdict))))")
    scored = json.loads(python(case, installed, "-c", script, case / "truth.json", diagnosed / "verdict.json"))
    assert (scored["truth"], scored["named"], scored["right"], scored["false_name"]) == ([TERM], [TERM], True, False)
    assert [entry["covered"] for entry in scored["intervals"]] == [True]


def test_the_term_is_fitted_beside_others(installed, case):
    found = float(python(case, installed, "-c", about(FITTED), case).split()[-1])
    assert found == pytest.approx(value_in(case), rel=0.2)


def test_sysid_fits_the_term_and_gives_its_row(installed, case, tmp_path):
    """The verb on the flights that conceal the term, with two of all fits: its row beside ours, and nearer to them."""
    one, two, three = (case / "flights" / f"flight_{k}.csv" for k in (1, 2, 3))
    script = ("import sys; from identification.greybox import ablation_study; "
              f"ablation_study.SHORT = ('fit_full', 'fit_{TERM}'); "
              "from nanobench_tools.cli.main import main; sys.exit(main(sys.argv[1:]))")
    python(tmp_path, installed, "-c", script, "sysid", "--fit", "short", "--train", one, "--train", two, "--test",
           three, "--json", "s.json", "--jobs", 1)
    body = json.loads((tmp_path / "s.json").read_text())
    assert {"fit_full", f"fit_{TERM}"} <= {row["model"] for row in body["rows"]}
    sums = {row["model"]: row["metrics"]["velocity_mae_m_s"]["sum"] for row in body["rows"]
            if (row["truth"], row["group"]) == ("mocap", "all")}
    assert sums[f"fit_{TERM}"] < 0.8 * sums["fit_full"]


def test_its_estimator_is_scored(installed, case, tmp_path):
    nanobench(tmp_path, installed, "estimate", "--protocol", "clean", "--only", "--method", "walks_on", "--data",
              case / "flights" / "flight_1.csv", "--json", "e.json", "--jobs", 1)
    rows = json.loads((tmp_path / "e.json").read_text())["rows"]
    assert {row["method"] for row in rows} == {"walks_on"}
    whole = next(row for row in rows if row["group"] == "all")
    assert (whole["n"], whole["causal"]) == (1, True)
    assert 0.01 < whole["metrics"]["ate_rmse_m"]["mean"] < 2.0  # no poses after the start: it stands still


def test_its_controller_flies(installed, tmp_path):
    nanobench(tmp_path, installed, "control", "--plant", "simulated", "--controller", "gentle_pid", "--trajectory",
              "figure_eight", "--speed", 0.5, "--seconds", 7, "--plants", 1, "--json", "c.json", "--jobs", 1)
    rows = json.loads((tmp_path / "c.json").read_text())["rows"]
    assert {row["controller"] for row in rows} == {"gentle_pid"}
    assert all(row["metrics"]["divergence_percent"] == 0.0 for row in rows)


def test_its_recordings_are_converted_and_audited(installed, tmp_path):
    lines = [f"{1e9 + 0.01 * k:.3f} {0.001 * k:.4f} 0 1 0 0 0 1 0 0 {(7 * k * k % 101) / 100.0:.3f}"
             for k in range(1200)]
    (tmp_path / "in.log").write_text("plain log\n" + "\n".join(lines) + "\n")
    nanobench(tmp_path, installed, "convert", "--data", "in.log", "--to", "tum", "--out", "tum")
    (written,) = (tmp_path / "tum").rglob("*.tum")
    last = written.read_text().splitlines()[-1].split()
    assert [float(x) for x in last[1:4]] == [1.199, 0.0, 1.0]
    nanobench(tmp_path, installed, "audit", "--data", "in.log", "--json", "a.json", "--jobs", 1)
    (flight,) = json.loads((tmp_path / "a.json").read_text())["flights"]
    assert flight["rates"]["imu"]["samples"] == 1200
