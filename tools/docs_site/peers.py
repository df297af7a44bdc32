"""The page that compares with other tools: agreement, accuracy and speed, each with what measures it."""

import csv
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
KEPT = ROOT / "benchmarks/speed/results.csv"

AGREEMENT = (
    ("evo", "ATE, relative errors and attitude errors of the same trajectories agree", "1e-7 or better",
     "tests/metrics/test_trajectory_metrics.py"),
    ("allantools", "overlapping Allan deviation of the same samples agrees", "1e-9, relative",
     "tests/noise/test_imu_noise.py"),
    ("RotorPy", "the same commands flown in both give the same states, for the terms that both have",
     "[the table of exports](exports.md)", "tests/physics/test_export_rotorpy.py"),
    ("drone-models", "its own equations give our accelerations, for the terms that both have, without the gyroscopic "
                     "moment", "1e-9 or better", "tests/physics/test_export_files.py"),
    ("cflib", "the unmodified library connects to the simulated vehicle, logs and flies", "it runs",
     "tests/radio/test_simulated_cflib.py"),
)
"""Tool, what is compared, how near, and the test that shows it."""
SPEED = {
    ("metrics_speed", "evo / nanobench, ATE and RTE"): ("evo", "ATE and RTE of a flight of 42 s; evo gets about a "
                                                               "tenth of the pairs"),
    ("filters_speed", "GTSAM NavStateImuEKF, 9 states, from Python / compiled core"): (
        "GTSAM `NavStateImuEKF`", "an inertial filter; theirs has 9 states and is called row by row, ours has 23"),
    ("smoothers_speed", "plain GTSAM / gtsam_batch"): ("GTSAM, plain", "a batch smoother of one flight; theirs as in "
                                                                          "its examples"),
    ("fit_speed", "scipy least_squares, our compiled rollout / ours"): (
        "SciPy `least_squares`", "a fit of physical terms; theirs with finite differences of our rollout"),
    ("model_speed", "every term: CasADi map / ours"): ("CasADi `map`", "prediction of half a second with every term"),
    ("tinympc_speed", "TinyMPC / DAQP, condensed"): ("TinyMPC", "one steady program about hover, 12 states, 20 stages"),
    ("read_speed", "numpy.loadtxt / cold"): ("NumPy `loadtxt`", "reading 102 recordings for the first time; theirs has "
                                                                   "no units and no checks"),
}
"""(Script, name) of a row of the kept table -> peer and condition."""


def ratios() -> dict[tuple[str, str], dict[str, str]]:
    """The last kept row of each name."""
    with KEPT.open(encoding="utf-8", newline="") as file:
        return {(row["script"], row["name"]): row for row in csv.DictReader(file)}


def diagnosis() -> str:
    """The table of the diagnosis against sparse regression, from its page."""
    text = (ROOT / "docs/mismatch.md").read_text(encoding="utf-8")
    found = re.search(r"<!-- table: against_pysindy/right -->\s*(.*?)\s*<!-- /table -->", text, re.S)
    assert found is not None
    return found[1]


def page() -> str:
    """Return the page."""
    kept = ratios()
    agree = [f"| {tool} | {what} | {near} | `{test}` |" for tool, what, near, test in AGREEMENT]
    speed = [f"| {peer} | {what} | {float(kept[key]['ratio']):.3g} | {kept[key]['n']} | `{key[0]}.py`, "
             f"{kept[key]['date']} |" for key, (peer, what) in SPEED.items()]
    return "\n\n".join([
        "# Compared with other tools",
        "This page has the comparisons with other tools that a test or a script of the repository measures.",
        "## Same numbers",
        "\n".join(["| tool | result | how near | test |", "| --- | --- | --- | --- |", *agree]),
        "`nanobench convert` writes files for evo, rpg_trajectory_evaluation, RotorPy, crazyflow and URDF: "
        "[Score trajectory files](howto/score_trajectory_files.md), [Export a simulator](exports.md).",
        "## Better answers",
        "pysindy (sparse regression) gets the same residuals and candidate functions as the diagnosis, on blind cases:",
        diagnosis(),
        "The published baselines of prediction and tracking are rows of [Identification](sysid.md) and "
        "[Control](control.md). Estimators of GTSAM are rows of [Estimation](estimation.md).",
        "## Speed",
        "The ratio is how many times as long the other tool takes in the same run, on one kind of machine. Scripts are "
        "in `benchmarks/speed/`; each states what both sides do.",
        "\n".join(["| tool | task | ratio | n | script, date |", "| --- | --- | --- | --- | --- |", *speed]),
    ]) + "\n"
