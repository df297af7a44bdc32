"""``nanobench simulate`` in process."""

import json

import pytest

from nanobench_tools.cli.main import main
from nanobench_tools.sources.discover import load_recordings


def test_it_writes_recordings_marked_synthetic(tmp_path, capsys):
    out = tmp_path / "practice"
    assert main(["simulate", "--out", str(out), "--flights", "1", "--seed", "4", "--family", "oval", "--speed", "fast",
                 "--controller", "mellinger", "--duration", "1", "--wander-ms", "20", "--suffix", ".csv.gz",
                 "--json", "-"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["synthetic"] is True
    assert [(out / name).exists() for name in result["files"]] == [True]
    loaded = load_recordings([out], cache=False)
    assert not loaded.failed
    flight = loaded.flights[0]
    assert flight.provenance.synthetic
    assert (flight.metadata["family"], flight.metadata["speed"]) == ("oval", "fast")
    assert flight.metadata["practice"]["clock_wander_sd_s"] == 0.02
    assert flight.metadata["practice"]["controller"] == "mellinger"


@pytest.mark.parametrize(("arguments", "says"), [
    (["--flights", "1"], "--out DIR is needed"),
    (["--out", "x", "--family", "spiral"], "unknown name 'spiral'; known: circle"),
    (["--out", "x", "--controller", "indi"], "unknown name 'indi'; known: pid, mellinger"),
    (["--out", "x", "--flights", "0"], "--flights")])
def test_bad_usage_is_one_line_and_exit_2(arguments, says, capsys):
    assert main(["simulate", *arguments]) == 2
    err = capsys.readouterr().err
    assert says in err
    assert err.count("\n") == 1
