"""A time column that stands still, or steps once a second: every verb that needs the flight says so in one line."""

import lzma

import pytest


def stuck(recording, folder, stamp):
    """A copy of a recording whose stamps are ``stamp(t)``."""
    text = lzma.decompress(recording.read_bytes()).decode() if recording.suffix == ".xz" else recording.read_text()
    head, *rows = text.splitlines()
    parts = [row.partition(",") for row in rows]
    first = float(parts[0][0])
    folder.mkdir(exist_ok=True)
    lines = [head, *(f"{stamp(float(t), first):.9f},{rest}" for t, _, rest in parts)]
    (folder / "stuck.csv").write_text("\n".join(lines) + "\n")
    return folder / "stuck.csv", len(rows)


@pytest.mark.parametrize("verb", ["estimate", "thrust"])
@pytest.mark.parametrize(("stamp", "distinct"), [
    (lambda t, first: first, 1), (lambda t, first: first + (t - first) // 1, None)],
                         ids=["one stamp", "once a second"])
def test_the_line_names_file_and_time_column(nanobench, recordings, tmp_path, verb, stamp, distinct):
    path, rows = stuck(next(p for p in sorted(recordings.iterdir()) if ".csv" in p.name), tmp_path / "in", stamp)
    code, _, err = nanobench(verb, "--data", path, "--jobs", 1, "--quiet")
    assert code == 2
    line = err.strip().splitlines()[-1]
    assert f"{path}: " in line
    assert "the time column repeats itself" in line
    assert "coarse_time" in line
    assert line.endswith("give every row its own time")
    if distinct is not None:
        assert f"{rows - distinct} of {rows} rows" in line


def test_half_of_the_stamps_repeated_is_no_stuck_clock(nanobench, recordings, tmp_path):
    """50 Hz rows written twice: the rows that repeat are left out and the rest is scored."""
    whole = next(p for p in sorted(recordings.iterdir()) if ".csv" in p.name)
    path, _ = stuck(whole, tmp_path / "in", lambda t, first: first + round((t - first) * 100) // 2 / 50)
    code, _, err = nanobench("estimate", "--data", path, "--protocol", "clean", "--only", "--method", "onboard_ekf",
                             "--json", tmp_path / "r.json", "--jobs", 1, "--quiet")
    assert code == 0, err
