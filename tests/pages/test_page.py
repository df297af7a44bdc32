"""report.html as a file: self-contained, escaped, labelled, and honest about what is not there."""

import re
from html.parser import HTMLParser
from importlib.resources import files

import pytest

from nanobench_tools.pages import report_page, write_report

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
    assert read.headings == [
        "2 recordings of folder", "Flights", "Where was it?",
        "How well was it flown, and how would another controller fly?",
        "Which physics does it obey?", "How late are the timestamps?",
        "The published tables, and the same recordings corrected", "How this was made"]
    assert all(v.startswith("data:") for v in read.fetched)
    assert not {"iframe", "object", "embed", "img"} & set(read.tags)


def test_the_title_names_the_data_and_the_day(tmp_path, flights, results):
    of_a_day = {name: {**body, "manifest": {"started": "2026-11-30T09:00:00"}} for name, body in results.items()}
    text = write_report(tmp_path, of_a_day, flights, {}, synthetic=False).read_text("utf-8")
    assert "<title>2 recordings of folder, 2026-11-30 - nanobench report</title>" in text


def test_real_data_never_carry_the_label_and_simulated_ones_everywhere(real, tmp_path, flights, results):
    assert "synthetic" not in real.read_text("utf-8").lower()
    for table in real.parent.glob("*.tex"):
        assert "SYNTHETIC" not in table.read_text()
    text = write_report(tmp_path, results, flights, {}, synthetic=True).read_text("utf-8")
    read = Reader(text)
    assert read.headings[0].startswith("SYNTHETIC")
    assert len(read.captions) > 12
    assert all(caption.startswith("SYNTHETIC ") for caption in read.captions)
    assert all("SYNTHETIC" in table.read_text() for table in tmp_path.glob("*.tex"))
    assert "(published)" in real.read_text("utf-8")
    assert "(published)" not in text
    assert not {"The published tables, and the same recordings corrected"} & set(read.headings)


def test_the_tables_are_beside_the_page(real):
    names = {p.name for p in real.parent.iterdir()}
    assert names >= {f"{stem}{suffix}" for suffix in (".csv", ".tex")
                     for stem in ("table_task1", "table_task2", "table_task3", "audit_flights")}


def test_a_missing_number_is_a_dash_with_its_reason_and_never_nan(real):
    text = real.read_text("utf-8")
    body = re.sub(r"<script.*?</script>", "", text, flags=re.S)
    assert "ATE RMSE, n = 2, 95 % [20.0, 22.0]; 9.0 mm with the clock re-timed" in body
    assert not re.search(r">\s*(nan|none|null|inf)\b", body.replace(">none<", "><"), flags=re.I)
    assert re.search(r"<td[^>]*title=\"[^\"]*could not be computed[^\"]*\"[^>]*>–<sup>a</sup>", body)
    assert re.search(r"<sup>a</sup> – the results hold no value", body)


def test_names_can_do_no_harm(tmp_path, make):
    flight = make.flight(NASTY)
    text = write_report(tmp_path, make.results([flight]), [flight], {}, synthetic=False).read_text("utf-8")
    outside = re.sub(r"<script[^>]*>.*?</script>", "", text, flags=re.S)
    assert "alert(1)" in outside
    assert "<script>alert" not in text
    assert Reader(text).tags.count("script") == len(report_page.SCRIPTS) + 3  # drawings, the flight, the library
    latex = (tmp_path / "audit_flights.tex").read_text()
    assert r"\textbackslash{}frac\{1\}\{2\} \$x\_1\textasciicircum{}2\$ \%" in latex


def test_a_name_that_is_no_text_is_shown_with_question_marks(tmp_path, make):
    flight = make.flight("a\udcff[red]x[")  # what a file system may hold
    text = write_report(tmp_path, make.results([flight]), [flight], {}, synthetic=False).read_text("utf-8")
    assert 'href="#flight=a%3F%5Bred%5Dx%5B">a?[red]x[</a>' in text


@pytest.mark.parametrize(("absent", "heading"), [
    ("estimate", "Where was it?"), ("sysid", "Which physics does it obey?"), ("audit", "How late are the timestamps?"),
    ("control", "How well was it flown, and how would another controller fly?")])
def test_an_absent_result_has_no_section(tmp_path, flights, results, absent, heading):
    kept = {name: body for name, body in results.items() if name != absent}
    read = Reader(write_report(tmp_path, kept, flights, {}, synthetic=False).read_text("utf-8"))
    assert heading not in read.headings
    assert len(read.headings) >= 6


def test_nothing_at_all_still_makes_a_page(tmp_path):
    read = Reader(write_report(tmp_path, {}, [], {}, synthetic=False).read_text("utf-8"))
    assert read.headings == ["nanobench report", "How this was made"]
    assert "figure" not in read.tags


def test_no_flight_is_usable_and_the_first_screen_says_so(tmp_path, flights, make):
    audit = {"flights": [{**make.entry(f), "severity": "unusable", "usable": []} for f in flights]}
    text = write_report(tmp_path, {"audit": audit}, flights, {}, synthetic=False).read_text("utf-8")
    assert re.search(r'<a class="tile bad" href="#flights"><span>Recordings usable</span><b>0 of 2</b>', text)


def test_audits_given_as_objects_are_used(tmp_path, flights, make):
    from nanobench_tools.auditing.recording_audit import Audit

    entry = {**make.entry(flights[0]), "faults": []}
    for clock in entry["clock"].values():
        clock.setdefault("reason", "")
    text = write_report(tmp_path, {}, flights[:1], {"any key": Audit.from_json(entry)}, synthetic=False).read_text()
    assert "13.0 of 16.0 s of flight usable" in text


def test_the_page_of_another_verb_is_kept(tmp_path):
    verdict = {"verdict": {"outcome": "named", "headline": "Words.", "paragraph": "Words."}}
    diagnosis = "<html><title>nanobench diagnose</title></html>"
    (tmp_path / "report.html").write_text(diagnosis)
    made = [write_report(tmp_path, verdict, [], {}, synthetic=False).name for _ in range(2)]
    assert made == ["overview.html"] * 2
    assert (tmp_path / "report.html").read_text() == diagnosis
    (tmp_path / "report.html").unlink()
    made = [write_report(tmp_path, verdict, [], {}, synthetic=False).name for _ in range(2)]
    assert made == ["report.html"] * 2


def test_a_diagnosis_beside_the_others_is_told(tmp_path):
    verdict = {"outcome": "named", "headline": "The simulator is wrong about drag_linear (97%).", "paragraph": "Words.",
               "findings": [{"term": "drag_linear"}]}
    text = write_report(tmp_path, {"verdict": verdict}, [], {}, synthetic=False).read_text("utf-8")
    assert "<b>drag linear</b><small>The simulator is wrong about drag_linear (97%).</small>" in text
    assert "Where is the simulator wrong?" in Reader(text).headings


def test_failures_are_listed(tmp_path, results, flights):
    failed = [{"item": "read", "file": "broken.csv", "error": "line 3: text where a number belongs"}]
    named = {**results, **{name: {**results[name], "failed": failed} for name in ("audit", "control")}}
    text = write_report(tmp_path, named, flights, {}, synthetic=False).read_text("utf-8")
    assert "Failed items: 1" in text
    assert text.count("line 3: text where a number belongs") == 1


def test_the_library_stands_with_its_licence_and_a_hundred_flights_stay_small(real, tmp_path, make):
    licence = (files("nanobench_tools.pages") / "vendor" / "LICENSE.plotly.txt").read_text()
    assert "MIT" in licence
    assert "Licensed under the MIT license" in real.read_text("utf-8")
    many = [make.flight(f"flight {i}", radius_m=0.3 + 0.01 * i) for i in range(10)]
    results = make.results(many)
    each = (write_report(tmp_path, results, many, {}, synthetic=False).stat().st_size
            - write_report(tmp_path, make.results(many[:1]), many[:1], {}, synthetic=False).stat().st_size) / 9
    assert real.stat().st_size + 100 * each < 3e6


def test_the_drawing_code_is_short():
    folder = files("nanobench_tools.pages") / "templates"
    scripts = [script.read_text() for script in folder.iterdir() if script.name.endswith(".js")]
    assert sum(text.count("\n") for text in scripts) < 450
    assert len((folder / "chart.js").read_text().split("\n")) < 400


def test_the_same_input_gives_the_same_bytes(real, tmp_path, flights, results):
    assert write_report(tmp_path, results, flights, {}, synthetic=False).read_bytes() == real.read_bytes()
