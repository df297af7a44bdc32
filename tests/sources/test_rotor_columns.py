"""Motors beyond the fourth and a collective command in a user's own table."""

from __future__ import annotations

import numpy as np
import pytest

from nanobench_tools import InputError
from nanobench_tools.auditing.recording_audit import audit
from nanobench_tools.flight import motors_of
from nanobench_tools.sources import load_recordings
from nanobench_tools.sources.column_map import read_column_map

HEAD = 'schema = "nanobench-columns/1"\ntime = {column = "t", unit = "s"}\n'
N = 40


def loaded(tmp_path, streams: str, names: list[str]):
    (tmp_path / "columns.toml").write_text(HEAD + streams)
    rng = np.random.default_rng(1)
    values = np.column_stack([0.01 * np.arange(N), rng.uniform(0.3, 0.6, (N, len(names)))])
    text = "\n".join([",".join(["t", *names]), *(",".join(f"{v:.9f}" for v in row) for row in values)])
    (tmp_path / "flight.csv").write_text(text + "\n")
    flight, = load_recordings([tmp_path / "flight.csv"], columns=tmp_path / "columns.toml").flights
    return flight, values


@pytest.mark.parametrize("rotors", [3, 6, 8])
def test_as_many_motors_as_there_are(tmp_path, rotors):
    names = [f"u{i}" for i in range(1, rotors + 1)]
    streams = "[streams.motor]\n" + "\n".join(f'm{i} = {{column = "u{i}", unit = "1"}}' for i in range(1, rotors + 1))
    flight, values = loaded(tmp_path, streams, names)
    assert motors_of(flight["motor"]) == tuple(f"m{i}" for i in range(1, rotors + 1))
    np.testing.assert_allclose(flight["motor"].values, values[:, 1:], atol=1e-8)
    assert not [f for f in audit(flight).faults if f.kind == "missing_column"]


def test_a_ninth_motor_is_unknown(tmp_path):
    (tmp_path / "columns.toml").write_text(HEAD + '[streams.motor]\nm9 = {column = "u9"}\n')
    with pytest.raises(InputError, match="unknown quantity"):
        read_column_map(tmp_path / "columns.toml")


@pytest.mark.parametrize(("unit", "factor", "si"), [("N", 1.0, "N"), ("gram_force", 0.00981, "N"), ("1", 1.0, "1"),
                                                    ("pwm16", 1.0 / 65535.0, "1")])
def test_a_collective_command_is_a_force_or_a_share(tmp_path, unit, factor, si):
    flight, values = loaded(tmp_path, f'[streams.command]\nthrust = {{column = "T", unit = "{unit}"}}\n', ["T"])
    assert flight["command"].unit == (si,)
    np.testing.assert_allclose(flight["command"]["thrust"], factor * values[:, 1], rtol=1e-3)


def test_motors_are_no_force(tmp_path):
    (tmp_path / "columns.toml").write_text(HEAD + '[streams.motor]\nm1 = {column = "u", unit = "N"}\n')
    with pytest.raises(InputError, match="unit 'N'"):
        read_column_map(tmp_path / "columns.toml")
