"""Copies and slices are found by content: names, places and order do not matter."""

from dataclasses import replace

import numpy as np
import pytest
from made_flights import cut, made_flight

from nanobench_tools.auditing.selection import distinct, is_piece, without_copies
from nanobench_tools.flight import make_stream


def other_name(flight, name):
    return replace(flight, name=name, provenance=replace(flight.provenance, path=f"elsewhere/{name}.csv"))


def test_copies_and_slices_are_left_out_whatever_the_order():
    whole, later = made_flight("b"), made_flight("c", epoch_s=2e9, seed=1)
    copy, piece = other_name(whole, "a_copy"), cut(whole, 4.0, 12.0)
    for flights in ([whole, copy, piece, later], [piece, later, copy, whole]):
        kept, repeats = distinct(flights)
        assert {f.name for f in kept} == {"b", "c"}
        found = {(r.flight.name, r.of.name, r.kind) for r in repeats}
        assert found == {("a_copy", "b", "copy"), ("piece", "b", "slice")}


def test_slices_stay_when_only_copies_go():
    whole = made_flight("b")
    kept, repeats = without_copies([cut(whole, 4.0, 12.0), whole, other_name(whole, "a_copy")])
    assert [f.name for f in kept] == ["piece", "b"]
    assert [r.flight.name for r in repeats] == ["a_copy"]


def test_the_same_times_with_other_numbers_are_another_flight():
    whole = made_flight("b")
    assert not is_piece(cut(made_flight("x", seed=7), 4.0, 12.0), whole)
    assert is_piece(cut(whole, 4.0, 12.0), whole)


def test_the_same_numbers_at_another_time_are_another_flight():
    whole = made_flight("b")
    assert not is_piece(replace(cut(whole, 4.0, 12.0), epoch_s=whole.epoch_s + 3.0), whole)
    assert not is_piece(replace(whole, epoch_s=whole.epoch_s + 1e-3), whole)


def test_the_same_flight_rounded_by_another_format_is_a_repeat():
    whole = made_flight("b")
    mocap = whole["mocap"]
    rounded = make_stream("mocap", np.round(whole.epoch_s + mocap.time_s, 4) - whole.epoch_s,
                          np.round(mocap.values, 4), mocap.quantities)
    other = whole.with_streams(mocap=rounded)
    assert is_piece(other, whole)
    assert [r.kind for r in distinct([whole, other_name(other, "as_tum")])[1]] == ["copy"]


def test_without_motion_capture_only_equal_numbers_are_repeats():
    bare, other = (made_flight("b", seed=seed).without_streams("mocap") for seed in (0, 1))
    for find in (distinct, without_copies):
        kept, repeats = find([bare, other_name(bare, "c"), other_name(other, "d")])
        assert {f.name for f in kept} in ({"b", "d"}, {"c", "d"})
        assert [r.kind for r in repeats] == ["copy"]


def test_motion_capture_without_positions_repeats_nothing():
    whole = made_flight("b")
    mocap = whole["mocap"]
    left = [n for n, name in enumerate(mocap.columns) if name not in ("px", "py", "pz")]
    names = {part: tuple(getattr(mocap, part)[n] for n in left) for part in ("columns", "quantities", "unit")}
    turned = replace(mocap, values=mocap.values[:, left], **names)
    bare = replace(whole, streams={**whole.streams, "mocap": turned})
    kept, repeats = distinct([bare, whole])
    assert len(kept) == 2
    assert not repeats


@pytest.mark.real
@pytest.mark.slow
def test_real_copies_and_slices(real):
    flights, _ = real
    kept, repeats = distinct(flights)
    kinds = [r.kind for r in repeats]
    assert len(kept) + len(repeats) == len(flights)
    # 68 distinct whole recordings, of which one never flew, and one piece whose whole is not in the data.
    assert len(kept) == 69
    assert kinds.count("slice") + kinds.count("copy") == 33
    assert len({round(f.epoch_s, 3) for f in kept}) == len(kept)
    again = distinct([flights[i] for i in np.random.default_rng(0).permutation(len(flights))])[0]
    assert {f.provenance.sha256 for f in again} == {f.provenance.sha256 for f in kept}
