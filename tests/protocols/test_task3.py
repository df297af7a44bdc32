"""Task 3: which flights and spans are scored, and in which groups."""

from dataclasses import replace

import numpy as np
import pytest
from cases_of_task3 import EKF, one_case, table
from made_flights import cut, dead, made_flight, verdict

from nanobench_tools import InputError, UsageError
from nanobench_tools.auditing.verb_needs import ESTIMATE
from nanobench_tools.flight import Flight, Provenance
from nanobench_tools.protocols import task3
from nanobench_tools.sources.labels import OTHER_FAMILIES


def test_a_stopped_log_is_cut():
    flight = made_flight()
    m = flight["estimator"]
    broken = m.values.copy()
    broken[1500:] += np.arange(len(m) - 1500)[:, None] * 0.01
    wrong = flight.with_streams(estimator=replace(m, values=broken))
    assert task3.score(one_case(wrong), EKF, "clean").metrics["ate_unaligned_rmse_m"] > 1.0
    case = one_case(wrong, dead("estimator", 14.99))
    value = task3.score(case, EKF, "clean")
    assert value.metrics["ate_unaligned_rmse_m"] < 0.04
    assert value.trajectory[-1, 0] <= 15.0


def test_faults_of_the_estimate_itself_are_not_cut():
    flight = made_flight()
    jump = replace(dead("estimator", 10.0, 12.0), kind="estimator_reset")
    assert one_case(flight, jump).spans == one_case(flight).spans
    hidden = replace(dead("mocap", 10.0, 12.0), kind="mocap_occlusion")
    assert len(one_case(flight, hidden).spans) == 2


def test_unknown_protocols_list_the_known_ones():
    with pytest.raises(UsageError, match="as-published, as-published-corrected, clean"):
        task3.select([], {}, "nonsense")


def test_nothing_to_score_names_the_place():
    bare = made_flight().without_streams("mocap")
    with pytest.raises(InputError, match=r"made\.csv: no flight for protocol .clean."):
        task3.select([bare], {bare.name: verdict(bare)}, "clean")


def test_what_recordings_lack_is_counted():
    bare = [made_flight(name).without_streams(lacks) for name, lacks in zip("abc", ("estimator", "estimator", "motor"),
                                                                            strict=True)]
    with pytest.raises(InputError, match=r"no estimator stream in 2; no motor stream in 1; it needs motion capture"):
        task3.select(bare, {f.name: verdict(f) for f in bare}, "clean", ESTIMATE)


def test_slices_count_once_in_clean_and_alone_when_alone():
    whole = made_flight("whole")
    piece = cut(whole, 2.5, 15.0)
    audits = {f.name: verdict(f) for f in (whole, piece)}
    rows = table([whole, piece], audits, "clean")
    assert rows["all"].flights == ["whole"]
    assert "1 copies and slices left out" in rows["all"].given
    alone = table([piece], audits, "clean")
    assert alone["all"].flights == ["piece"]
    assert set(alone) == {"all", "slow", "circle", "slow/circle"}


def test_as_published_without_cut_pieces_says_so():
    whole = made_flight("whole")
    rows = table([whole], {"whole": verdict(whole)}, "as-published")
    assert set(rows) == {"Slow"}
    assert "motor 1 above 1000 of all recordings" in rows["Slow"].given
    assert rows["Slow"].published is None


@pytest.mark.parametrize(("families", "apart"), [
    (("circle", "star", "trefoil", "oval"), (False, True, False, True)),
    (("star", "oval"), (False, False)),  # nobody's numbers were set here: the group would be all of them again
    (("circle", "trefoil"), (False, False)),
])
def test_families_that_set_nothing_of_the_filters_are_a_group(families, apart):
    provenance = Provenance("made", "", "test", synthetic=True)
    cases = [task3.Case(Flight(name, {}, {"family": name}, provenance), (), ("all",)) for name in families]
    assert tuple(OTHER_FAMILIES in case.groups for case in task3._apart(cases)) == apart
    assert all(case.groups[0] == "all" for case in task3._apart(cases))
