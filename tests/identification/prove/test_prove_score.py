"""One verdict against one truth: every rule on a case worked out by hand."""

import pytest

from identification.prove.score import IntervalScore, below, score_case
from identification.prove.truth import TrueEffect, TrueFault, TrueParameter, Truth


def effect(term, size="large", twins=(), parameters=None, foreign=False, flights=("flight_1", "flight_2")):
    return TrueEffect(term, size, flights, foreign, twins, parameters or {})


def truth(kind, *effects, faults=(), outcome=None):
    return Truth("case_007", kind, effects, tuple(TrueFault(**fault) for fault in faults), outcome, "practice")


def finding(term, *equivalent, confidence=0.9, parameters=None, flights=()):
    return {"term": term, "equivalent": list(equivalent), "confidence": confidence, "parameters": parameters or {},
            "where": {"flights": list(flights)}}


def verdict(outcome, *findings, unknown=None, power=None, faults=()):
    return {"outcome": outcome, "findings": list(findings), "unknown": unknown, "data_faults": list(faults),
            "power": power or {}, "improvement": None, "elapsed_s": 3.0}


SPIKE = {"flight": "flight_1", "kind": "spike"}
SIGN = {"flight": "flight_1", "kind": "sign"}
SIZED = {"mass.m": TrueParameter(0.0404, "kg", 0.04)}
LEAST = {"mass": {"minimum_detectable": 5e-4, "unit": "kg", "parameter": "mass.m"}}
WIND = effect("wind")
JET = effect("jet", foreign=True)


@pytest.mark.parametrize(("there", "said", "right", "false_name"), [
    (truth("null"), verdict("none"), True, False),
    (truth("null"), verdict("unknown", unknown={"hint": "?"}), False, False),
    (truth("null"), verdict("insufficient"), False, False),
    (truth("null"), verdict("named", finding("wind")), False, True),
    (truth("single", WIND), verdict("named", finding("wind")), True, False),
    (truth("single", WIND), verdict("named", finding("force_world", "wind")), True, False),
    (truth("single", WIND), verdict("named", finding("force_world")), False, True),
    (truth("single", WIND), verdict("named", finding("wind"), finding("inflow")), False, True),
    (truth("single", WIND), verdict("named", finding("wind"), unknown={"hint": "?"}), True, False),
    (truth("single", WIND), verdict("unknown", unknown={"hint": "?"}), False, False),
    (truth("single", effect("mass", twins=("thrust_scale",))), verdict("named", finding("thrust_scale")), True, False),
    (truth("pair", WIND, effect("motor_lag")), verdict("named", finding("motor_lag"), finding("wind")), True, False),
    (truth("pair", WIND, effect("motor_lag")), verdict("named", finding("wind")), False, False),
    # one finding of a wide class names one effect, not both
    (truth("pair", WIND, effect("inflow")), verdict("named", finding("wind", "inflow")), False, False),
    # but what only the class can say is given to it
    (truth("pair", WIND, effect("inflow")), verdict("named", finding("wind", "inflow"), finding("wind")), True, False),
    (truth("fault", faults=[SIGN], outcome="data_fault"), verdict("data_fault", faults=[SIGN]), True, False),
    (truth("fault", faults=[SIGN], outcome="data_fault"), verdict("named", finding("motor_lag")), False, True),
    (truth("fault", faults=[SIGN], outcome="data_fault"), verdict("none"), False, False),
    (truth("fault", faults=[SPIKE], outcome="none"), verdict("none", faults=[SPIKE]), True, False),
    (truth("fault", faults=[SPIKE], outcome="none"), verdict("data_fault", faults=[SPIKE]), False, False),
    (truth("fault", faults=[SPIKE], outcome="none"), verdict("unknown", unknown={"hint": "?"}), False, False),
    (truth("foreign", JET), verdict("unknown", unknown={"hint": "?"}), True, False),
    (truth("foreign", JET), verdict("named", finding("wind"), unknown={"hint": "?"}), False, True),
    (truth("foreign", JET), verdict("none"), False, False),
    (truth("single", effect("mass", "small", parameters=SIZED)), verdict("none", power=LEAST), True, False),
    (truth("single", effect("mass", "medium", parameters=SIZED)), verdict("none", power=LEAST), False, False),
    (truth("single", effect("mass", "small", parameters=SIZED)), verdict("none"), False, False),
])
def test_right_and_false(there, said, right, false_name):
    scored = score_case(there, said)
    assert (scored.right, scored.false_name) == (right, false_name)
    assert scored.outcome == said["outcome"]
    assert scored.named == tuple(f["term"] for f in said["findings"])


def test_a_small_effect_is_below_what_could_be_seen_by_the_parameter_the_verdict_speaks_of():
    lag = effect("motor_lag", parameters={
        "motor_lag.tau_up_s": TrueParameter(0.04, "s", 0.04), "motor_lag.tau_down_s": TrueParameter(0.05, "s", 0.04)})
    assert below(lag, {"minimum_detectable": 0.012, "unit": "s"})
    assert not below(lag, {"minimum_detectable": 0.008, "unit": "s"})
    assert below(lag, {"minimum_detectable": 0.008, "unit": "s", "parameter": "motor_lag.tau_up_s"})
    assert below(lag, {"minimum_detectable": None, "unit": "s"})
    assert not below(lag, {"minimum_detectable": 1.0, "unit": "N"})


def test_what_the_simulator_lacks_is_as_large_as_it_is_from_where_it_does_nothing():
    scale = {"thrust_scale.s": TrueParameter(1.02, "1", None)}
    gains = {f"motor_imbalance.g[{i}]": TrueParameter(g, "1", None)
             for i, g in enumerate((0.98, 1.02, 1.0, 1.0))}
    for parameters, name in ((scale, "thrust_scale"), (gains, "motor_imbalance")):
        there = effect(name, parameters=parameters)
        stated = {"unit": "1", "parameter": next(iter(parameters))}
        assert below(there, {"minimum_detectable": 0.021, **stated})
        assert not below(there, {"minimum_detectable": 0.019, **stated})


def test_intervals_are_judged_where_the_term_itself_is_named():
    there = effect("mass", twins=("thrust_scale",), parameters=SIZED)
    stated = {"mass.m": {"value": 0.0401, "ci95": [0.0399, 0.0403], "unit": "kg"}}
    scored = score_case(truth("single", there), verdict("named", finding("mass", parameters=stated)))
    assert scored.intervals == (IntervalScore("mass.m", 0.0404, 0.04, 0.0401, (0.0399, 0.0403), False),)
    bare = {"m": {"value": 0.0401, "ci95": [0.0399, 0.0405], "unit": "kg"}}
    scored = score_case(truth("single", there), verdict("named", finding("mass", parameters=bare)))
    assert scored.intervals[0].covered
    twin = finding("thrust_scale", parameters={"thrust_scale.s": {"value": 1.0, "ci95": [0.9, 1.1], "unit": "1"}})
    assert score_case(truth("single", there), verdict("named", twin)).intervals == ()


def test_flights_of_a_change_and_kinds_of_faults():
    change = truth("change", effect("mass", flights=("flight_2",)))
    for flights, right in ((("flight_2",), True), (("flight_1", "flight_2"), False)):
        assert score_case(change, verdict("named", finding("mass", flights=flights))).flights_right is right
    fault = truth("fault", faults=[SPIKE])
    assert score_case(fault, verdict("data_fault", faults=[SPIKE])).fault_right
    assert not score_case(fault, verdict("data_fault", faults=[{**SPIKE, "flight": "flight_2"}])).fault_right
    assert score_case(truth("null"), verdict("none")).fault_right is None
