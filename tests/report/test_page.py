"""report.html as a file: self-contained, escaped, labelled, and honest about what is not there."""

import re
import sys
from html.parser import HTMLParser

import pytest

from nanobench_tools.report import report_page, write_report

NASTY = "</script><script>alert(1)</script> & \"q\" 'a' Ünï–☃ \\frac{1}{2} $x_1^2$ %"


class Reader(HTMLParser):
    """Headings, captions and everything that could make a browser fetch something."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.fetched, self.headings, self.captions, self._open = [], [], [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        given = dict(attributes)
        self.fetched += [v for k, v in given.items() if k in ("src", "srcset", "poster", "data", "action")]
        self.fetched += [given["href"]] if tag in ("link", "base") else []
        if tag in ("h2", "caption", "figcaption", "h1"):
            self._open.append([tag, ""])

    def handle_endtag(self, tag):
        if self._open and self._open[-1][0] == tag:
            tag, text = self._open.pop()
            (self.headings if tag in ("h1", "h2") else self.captions).append(" ".join(text.split()))

    def handle_data(self, data):
        if self._open:
            self._open[-1][1] += data


@pytest.fixture(scope="module")
def real(tmp_path_factory, flights, results):
    return write_report(tmp_path_factory.mktemp("real"), results, flights, {}, synthetic=False)


def test_one_file_with_the_headings_and_nothing_to_fetch(real):
    read = Reader(real.read_text("utf-8"))
    assert [h for h in read.headings if h.startswith("Task")] == ["Task 1", "Task 2", "Task 3"]
    assert set(read.headings) >= {"Overview", "Data audit", "Flights", "How this was made"}
    assert all(v.startswith("data:") for v in read.fetched)
    assert not {"iframe", "object", "embed", "img"} & set(read.tags)


def test_real_data_never_carry_the_label_and_simulated_ones_everywhere(real, tmp_path, flights, results):
    assert "synthetic" not in real.read_text("utf-8").lower()
    for table in real.parent.glob("*.tex"):
        assert "SYNTHETIC" not in table.read_text()
    text = write_report(tmp_path, results, flights, {}, synthetic=True).read_text("utf-8")
    read = Reader(text)
    assert read.headings[0].startswith("SYNTHETIC")
    assert len(read.captions) > 15
    assert all(caption.startswith("SYNTHETIC ") for caption in read.captions)
    assert all("SYNTHETIC" in table.read_text() for table in tmp_path.glob("*.tex"))
    assert "(published)" in real.read_text("utf-8")
    assert "(published)" not in text


def test_the_tables_are_beside_the_page(real):
    names = {p.name for p in real.parent.iterdir()}
    assert names >= {f"{stem}{suffix}" for suffix in (".csv", ".tex")
                     for stem in ("table_task1", "table_task2", "table_task3", "audit_flights")}


def test_a_missing_number_is_a_dash_with_its_reason_and_never_nan(real):
    text = real.read_text("utf-8")
    body = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert not re.search(r">\s*(nan|none|null|inf)\b", body.replace(">none<", "><"), flags=re.I)
    assert re.search(r"<td[^>]*title=\"[^\"]*could not be computed[^\"]*\"[^>]*>–<sup>a</sup>", body)
    assert re.search(r"<sup>a</sup> – the results hold no value", body)


def test_names_can_do_no_harm(tmp_path, make):
    flight = make.flight(NASTY)
    text = write_report(tmp_path, make.results([flight]), [flight], {}, synthetic=False).read_text("utf-8")
    outside = re.sub(r"<script[^>]*>.*?</script>", "", text, flags=re.S)
    assert "alert(1)" in outside
    assert "<script>alert" not in text
    assert Reader(text).tags.count("script") == len(report_page.SCRIPTS) + 3
    latex = (tmp_path / "audit_flights.tex").read_text()
    assert r"\textbackslash{}frac\{1\}\{2\} \$x\_1\textasciicircum{}2\$ \%" in latex


@pytest.mark.parametrize("absent", ["audit", "estimate", "sysid", "control"])
def test_each_result_may_be_absent(tmp_path, flights, results, absent):
    kept = {name: body for name, body in results.items() if name != absent}
    text = write_report(tmp_path, kept, flights, {}, synthetic=False).read_text("utf-8")
    assert "This run holds no" in text or "No audit of recordings" in text


def test_nothing_at_all_still_makes_a_page(tmp_path):
    text = write_report(tmp_path, {}, [], {}, synthetic=False).read_text("utf-8")
    assert text.count("This run holds no results of this task.") == 3
    assert not re.findall(r'<figure id="fig-(?:task|gate|blackout|bands)', text)  # one sentence says it
    assert "there are no pictures of single flights" in text


def test_audits_given_as_objects_are_used(tmp_path, flights, make):
    from nanobench_tools.auditing import Audit

    entry = {**make.entry(flights[0]), "faults": []}
    for clock in entry["clock"].values():
        clock.setdefault("reason", "")
    text = write_report(tmp_path, {}, flights[:1], {"any key": Audit.from_json(entry)}, synthetic=False).read_text()
    assert '<table class="sortable matrix">' in text


def test_failures_are_listed(tmp_path, results, flights):
    failed = [{"item": "read", "file": "broken.csv", "error": "line 3: text where a number belongs"}]
    named = {**results, **{name: {**results[name], "failed": failed} for name in ("audit", "control")}}
    text = write_report(tmp_path, named, flights, {}, synthetic=False).read_text("utf-8")
    assert "Failed items: 1" in text
    assert text.count("line 3: text where a number belongs") == 1


def test_without_the_plotting_library_the_tables_are_there_and_the_way_to_it(tmp_path, results, flights, monkeypatch):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    path = write_report(tmp_path, results, flights, {}, synthetic=False)
    assert 'pip install "nanobench-tools[report]"' in path.read_text("utf-8").replace("&#34;", '"')
    assert path.stat().st_size < 300_000


def test_the_same_input_gives_the_same_bytes(real, tmp_path, flights, results):
    assert write_report(tmp_path, results, flights, {}, synthetic=False).read_bytes() == real.read_bytes()
