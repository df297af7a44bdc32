"""Whether a change of the code leaves every number of the modelling verbs as it was, to the last digit.

Write the numbers of two checkouts and compare them; times are left out of the comparison::

    PYTHONPATH=BEFORE python tools/same_models.py write before.json --data data/nanobench
    PYTHONPATH=AFTER python tools/same_models.py write after.json --data data/nanobench
    python tools/same_models.py compare before.json after.json

``write`` holds: simulator.toml of a model with every term and its export to every target; grey-box fits of five
flights scored on five others; a diagnosis of three flights; six blind cases, SYNTHETIC, with their scores; what is
believed from such flights; a callable stood for by terms. Without ``--data`` the real ones are left out.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

TIMES = ("elapsed_s", "seconds")
SEED = 3
CASES = 6


def every_term() -> Any:
    """A model with every registered term of ours that goes with PWM, none of them at rest."""
    from nanobench_tools.physics import Model, Vehicle

    return Model(Vehicle(), {
        "thrust_voltage": {"c": (-0.0248, 0.0652, -0.0268, 0.00678)}, "thrust_rpm": {"k_f": 2.3e-8},
        "motor_lag": {"tau_up_s": 0.03, "tau_down_s": 0.04}, "command_delay": {"delay_s": 0.012},
        "thrust_scale": {"s": 0.97}, "motor_imbalance": {"g": (1.02, 0.98, 1.01, 0.99)}, "mass": {"m": 0.042},
        "inertia": {"inertia_kg_m2": (2e-5, 2.1e-5, 3.3e-5)}, "yaw_torque": {"k_m": 0.006},
        "drag_linear": {"d": (0.016, 0.017, 0.006)}, "drag_quadratic": {"q": (0.003, 0.003, 0.001)},
        "drag_rotor": {"d": (2e-6, 2e-6, 7e-7)}, "drag_torque": {"c": -1e-4}, "angular_damping": {"d_r": (1e-5,) * 3},
        "com_offset": {"r_m": (1e-3, -5e-4, 2e-3)}, "inflow": {"k_z": 0.014, "k_h": 0.005},
        "ground_effect": {"rho": 1.1, "R": 0.0231}, "wind": {"w_m_s": (0.2, -0.1, 0.05)},
        "force_world": {"f_N": (0.004, -0.002, 0.001)}, "frame_tilt": {"roll_rad": 0.01, "pitch_rad": -0.02},
        "saturation": {"T_max_N": 0.15}, "rotor_gyro": {"J_r": -2e-8},
        "slung_load": {"m_kg": 0.004, "l_m": 0.6, "zeta": 0.03, "r_m": (0.001, 0.0, -0.01)}})


def exports() -> dict[str, Any]:
    """Text of simulator.toml, and of every file of every target."""
    from nanobench_tools.physics.export import TARGETS, export_model
    from nanobench_tools.physics.simulator import dumps

    whole = every_term()
    found: dict[str, Any] = {}
    for what, model in (("every term", whole), ("no drag", whole.without("drag_linear", "drag_quadratic", "drag_rotor",
                                                                        "wind", "drag_torque"))):
        found[what] = {"simulator.toml": dumps(model)}
        for target in TARGETS:
            with tempfile.TemporaryDirectory() as folder:
                made = export_model(model, target, Path(folder))
                found[what][target] = {path.name: path.read_bytes().decode("latin-1") for path in made.files}
                found[what][target]["account"] = vars(made.account)
    return found


def fits(data: Path) -> dict[str, Any]:
    """Grey-box models of five flights, scored on five others."""
    from identification.greybox.fit import GreyBox
    from identification.greybox.ladder import FULL, RATE_HELD, THRUST

    flights = _flights(data, 10)
    found = {}
    for name, made in (("full", GreyBox(FULL)), ("held", GreyBox({**THRUST, **RATE_HELD})),
                       ("inputs", GreyBox(FULL, adapt="inputs")),
                       ("names", GreyBox(["thrust_voltage", "motor_lag", "drag_linear", "motor_imbalance", "inflow"]))):
        made.fit(flights[:5])
        found[name] = {"parameters": made.parameters_, "result": vars(made.result_), "score": made.score(flights[5:]),
                       "soft": [vars(p) for p in made.solution_.problem.priors]}
    return found


def real(data: Path) -> dict[str, Any]:
    """A diagnosis of three flights by the shipped plant with pieces taken away."""
    import controllers
    from identification.mismatch.diagnosis import diagnose_flights
    from nanobench_tools.physics.simulator import read_simulator

    shipped = read_simulator(Path(str(controllers.__file__)).with_name("recorded_vehicle.toml"))
    flights = _flights(data, 3)
    return {name: diagnose_flights(flights, model) for name, model in
            (("shipped", shipped), ("no drag", shipped.without("drag_linear")))}


def blind() -> dict[str, Any]:
    """Six cases: truths, verdicts and scores, beside what two of them are believed to be."""
    from identification.mismatch.believe import beliefs, start_of
    from identification.mismatch.diagnosis import diagnose_flights, recorded
    from identification.prove.make import make_cases
    from identification.prove.plan import plan_cases
    from identification.prove.score import score_case
    from nanobench_tools.physics import Vehicle

    found: dict[str, Any] = {"plan": [repr(spec) for spec in plan_cases(200, SEED)]}
    cases = make_cases(plan_cases(CASES, SEED))
    for case in cases:
        verdict = diagnose_flights(case.flights, case.simulator)
        found[case.name] = {"truth": case.truth, "verdict": verdict, "score": score_case(case.truth, verdict)}
    found["believed"] = beliefs(recorded(cases[0].flights)).as_dict()
    found["start"] = start_of(Vehicle(mass_kg=1.5, motor_positions_m=((.2, -.2), (-.2, -.2), (-.2, .2), (.2, .2))))
    found["scales"] = usual_sizes()
    return found


def usual_sizes() -> dict[str, Any]:
    """Usual sizes on vehicles of three sizes."""
    from identification.mismatch.space import scales, space_around

    whole, found = every_term(), {}
    for mass, arm in ((0.04, 0.0325), (0.7, 0.1), (2.6, 0.2)):
        model = whole.on(mass_kg=mass, motor_positions_m=((arm, -arm), (-arm, -arm), (-arm, arm), (arm, arm)))
        space = space_around(model)
        found[str(mass)] = {"scales": scales(space.model).tolist(), "terms": space.terms, "names": space.model.names}
    bare = space_around(whole.on(mass_kg=0.041).without(*(t.name for t in whole.terms if t.name != "thrust_voltage")))
    return {**found, "bare": {"terms": bare.terms, "names": bare.model.names, "values": bare.model.values.tolist()}}


def callable_simulator() -> dict[str, Any]:
    """A callable of its own equations diagnosed along SYNTHETIC flights."""
    import numpy as np

    from identification.mismatch.diagnosis import diagnose_callable, recorded
    from identification.prove.make import make_cases
    from identification.prove.plan import plan_cases
    from nanobench_tools.physics import Vehicle

    flights = make_cases([s for s in plan_cases(20, SEED) if s.kind == "null"][:1])[0].flights[:3]

    def accelerations(at: Any) -> tuple[Any, Any]:
        volts = at.motor * at.battery_V[:, None]
        lift = -0.0248 + 0.0652 * volts - 0.0268 * volts**2 + 0.00678 * volts**3
        velocity = np.einsum("nji,nj->ni", at.rotation, at.velocity_m_s)
        force = lift.sum(axis=1)[:, None] * [0.0, 0.0, 1.0] - [0.02, 0.02, 0.006] * velocity
        torque = np.stack([0.0325 * lift @ [-1, -1, 1, 1], 0.0325 * lift @ [-1, 1, 1, -1],
                           0.006 * lift @ [-1, 1, -1, 1]], axis=1)
        return force / 0.041, torque / np.array([1.8e-5, 1.8e-5, 3.1e-5])

    return diagnose_callable(recorded(flights), accelerations, "mine", vehicle=Vehicle(mass_kg=0.041)).to_json()


def _flights(data: Path, many: int) -> list[Any]:
    """Every k-th flight of a folder, by name."""
    from nanobench_tools.sources.discover import load_recordings

    paths = sorted(data.rglob("*.csv.xz"))
    return list(load_recordings(paths[::max(len(paths) // many, 1)][:many]).flights)


def write(path: Path, data: Path | None, only: list[str]) -> None:
    """All the numbers of the code on the import path."""
    from nanobench_tools.result import to_json

    parts: dict[str, Any] = {"exports": exports, "blind": blind, "callable": callable_simulator}
    if data is not None:
        parts |= {"fits": lambda: fits(data), "real": lambda: real(data)}
    found = {name: to_json(part()) for name, part in parts.items() if not only or name in only}
    path.write_text(json.dumps(found, indent=1, default=str), encoding="utf-8")


def compare(before: Any, after: Any, place: str = "") -> list[str]:
    """Places where two results differ, times aside."""
    if isinstance(before, dict) and isinstance(after, dict):
        return [line for key in {**before, **after} if key not in TIMES
                for line in compare(before.get(key, "absent"), after.get(key, "absent"), f"{place}/{key}")]
    if isinstance(before, list) and isinstance(after, list) and len(before) == len(after):
        return [line for i, (a, b) in enumerate(zip(before, after, strict=True))
                for line in compare(a, b, f"{place}[{i}]")]
    same = before == after or (before != before and after != after)
    return [] if same else [f"{place}: {str(before)[:200]} -> {str(after)[:200]}"]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("write", "compare"))
    parser.add_argument("files", nargs="+", type=Path)
    parser.add_argument("--data", type=Path)
    parser.add_argument("--only", nargs="*", default=[])
    given = parser.parse_args()
    if given.what == "write":
        write(given.files[0], given.data, given.only)
        return 0
    old, new = (json.loads(path.read_text(encoding="utf-8")) for path in given.files)
    different = compare(old, new)
    print("\n".join(different) or f"the same: {', '.join(old)}")
    return bool(different)


if __name__ == "__main__":
    raise SystemExit(main())
