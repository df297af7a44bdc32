"""The page of a diagnosis: what it says, what it draws, and that it asks nobody for anything."""

from __future__ import annotations

import json
import os
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest
from carried_tracks import MODEL, wrench_of
from markupsafe import escape
from scipy.stats import t as student

from identification.mismatch.binned import BLOCK_S, binned, block_numbers
from identification.mismatch.decide import decide
from identification.mismatch.drawings import drawings
from identification.mismatch.fitting import Slopes, fit, slopes
from identification.mismatch.left_by_rules import floor, left_by_rules
from identification.mismatch.moments import moments_of
from identification.mismatch.naming import Hypothesis, Named
from identification.mismatch.page import SECTIONS, page_text, write_page
from identification.mismatch.pictures import pictures
from identification.mismatch.proof import prove
from identification.mismatch.recordings import Recordings
from identification.mismatch.space import space_around
from identification.mismatch.verdict import Verdict
from nanobench_tools.flight import Fault, Flight, Provenance

NASTY = "flight_1 <script>alert(1)</script>"
SIMULATOR = MODEL.with_term("drag_linear", d=(0.002, 0.002, 0.006))
"""Lacks most of the drag."""
FAULT = Fault("gap", "imu", ("gyro_x",), 3.0, 3.6, 0.6, "s", "no sample of imu for 0.6 s")


@pytest.fixture(scope="module")
def recordings():
    tracks = wrench_of(MODEL, flights=2, seconds=10.0).tracks
    names = (NASTY, "flight_2")
    flights = tuple(Flight(n, {}, {}, Provenance("flight.csv", "0" * 64, "hand", True)) for n in names)
    return Recordings(flights, {}, tuple(replace(t, name=names[t.flight]) for t in tracks),
                      ((NASTY, FAULT), ("flight_2", FAULT)), {"flight_9": "no motor stream"})


def verdict_of(recordings, terms):
    """Without the search for names: they are given."""
    from identification.mismatch.wrench import Wrench

    wrench, space = Wrench(recordings.tracks), space_around(SIMULATOR)
    free = space.free("drag_linear")
    force, _ = slopes(wrench, space.model, free)
    names = [space.model.names[i] for i in free]
    moments = moments_of(wrench, wrench.residual(MODEL), force, names)
    known = Slopes(moments)
    nothing, found = fit(known, space.model, []), fit(known, space.model, free)
    accepted = tuple(Hypothesis(t, found, nothing.loss - found.loss) for t in terms)
    named = Named(accepted, tuple(("drag_rotor",) for _ in terms), space, found if terms else nothing, nothing.loss,
                  {"drag_linear": nothing.loss - found.loss, "wind": 70.0, "mass": 3.0},
                  {"wind": "wind changes less than errors of logging could"})
    decision = decide(recordings, moments, space, named)
    return Verdict.of(recordings, SIMULATOR, moments, decision, prove(moments, decision, SIMULATOR), 1.0)


@pytest.fixture(scope="module")
def verdict(recordings):
    return verdict_of(recordings, ("drag_linear",))


@pytest.fixture(scope="module")
def drawn(verdict, recordings):
    return pictures(verdict, recordings)


@pytest.fixture(scope="module")
def page(verdict, recordings):
    return page_text(verdict, recordings, synthetic=True)


def without_scripts(page):
    return re.sub(r"<script.*?</script>|<style.*?</style>", "", page, flags=re.DOTALL)


def test_every_section_is_there_with_what_was_found(page, verdict):
    assert [f'<section id="{name}">' in page for name, _ in SECTIONS] == [True] * len(SECTIONS)
    text = without_scripts(page)
    assert verdict.body["outcome"] == "named"
    assert "drag_rotor" in text  # what it cannot be told from
    assert "wind changes less than errors of logging could" in text
    assert "no motor stream" in text
    assert "2 of 2" in text  # flights with the fault
    for picture in ("whole", "spans", "rms", "timeline", "share", "covariates", "room", "by_flight", "scores",
                    "intervals", "errors"):
        assert f'id="fig-{picture}"' in page, picture


def test_it_opens_with_one_sentence_and_one_picture(page, verdict):
    opening = page[:page.index("<nav")]
    assert escape(verdict.body["headline"]) in opening
    assert opening.count("<figure") == 1
    assert 'id="fig-errors"' in opening


def test_nothing_is_asked_of_a_network_and_no_cell_is_empty(page):
    text = without_scripts(page)
    assert not re.findall(r"""(?:src|href)=["'](?!#|data:)""", text)
    assert not re.findall(r"https?://", text)
    cells = re.findall(r"<td[^>]*>(.*?)</td>", text, re.DOTALL)
    assert len(cells) > 50
    assert not {"", "nan", "None", "inf"} & set(cells)


def test_every_table_and_picture_says_what_data_it_is_of(page, verdict, recordings):
    captions = re.findall(r"<caption>(.*?)</caption>|<figcaption>(.*?)</figcaption>", page, re.DOTALL)
    assert len(captions) > 15
    assert all("SYNTHETIC" in a + b for a, b in captions)
    real = without_scripts(page_text(verdict, recordings, synthetic=False))
    assert "SYNTHETIC" not in real
    tables = re.findall(r"<caption>(.*?)</caption>", real, re.DOTALL)
    assert all(re.search(r"n = 2 flights.*, real", t) for t in tables)


def test_a_name_full_of_traps_is_only_a_name(page):
    assert "<script>alert(1)" not in page
    assert "flight_<wbr>1 &lt;script&gt;" in page


def test_a_diagnosis_that_judged_nothing_has_a_page(recordings, tmp_path):
    nothing = replace(recordings, tracks=(), faults=())
    write_page(Verdict.insufficient(nothing, SIMULATOR, 0.1), nothing, tmp_path / "report.html", synthetic=False)
    text = without_scripts((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert "Too little to say" in text
    assert text.count("there is nothing to show") == 5
    assert "SYNTHETIC" not in text


def test_what_is_drawn_is_what_was_concealed(drawn):
    assert drawn["whole"][0]["name"] == "drag_linear"
    named, rest, chance = (part["share"] for part in drawn["whole"])
    assert named > 0.85 * (named + rest)  # the tracks' own steps leave a little
    assert named + rest + chance == pytest.approx(1.0)
    share = drawn["share"]
    assert max(share["groups"], key=lambda g: sum(share["before"][share["groups"].index(g)])) == "air speed"
    assert np.array(share["after"]).sum() < 0.1 * np.array(share["before"]).sum()
    first = drawn["covariates"][0]
    assert first["covariate"].startswith(("velocity", "speed"))
    assert np.abs(first["sides"][1]["mean"]).max() < 0.1 * np.abs(first["sides"][0]["mean"]).max()
    assert all(a < b for a, b in zip(drawn["rms"]["after"][:2], drawn["rms"]["before"][:2], strict=True))
    assert [r["fate"] for r in drawn["scores"]["rows"]] == ["named", "rejected", "small"]
    assert json.dumps(drawn, allow_nan=False)


def test_without_a_name_only_the_simulator_as_given_is_drawn(recordings):
    plain = verdict_of(recordings, ())
    found = pictures(plain, recordings)
    assert not found["named"]
    assert [len(k["sides"]) for k in found["covariates"]] == [1] * len(found["covariates"])
    share = drawings(found, [(50, "500 ms")], "", "")["share"]
    assert [panel.title for panel in share.panels] == ["simulator as given"]


def test_the_figures_hold_what_was_found(drawn):
    found = drawings(drawn, [(1, "10 ms"), (10, "100 ms"), (50, "500 ms")], "n = 2", "n = 2")
    before, after = found["rms"].panels[0].marks[:2]
    assert (before.high, after.high) == (drawn["rms"]["before"][:3], drawn["rms"]["after"][:3])
    key = ("500 ms (h = 50)", "position")
    assert next(iter(found["errors"].figures)) == key
    assert found["errors"].figures[key].panels[0].marks[-1].x == drawn["errors"]["after"][2][0]
    ways, heights = found["room"].first.panels
    assert sum(len(mark.x) for mark in heights.marks) == len(drawn["room"]["maps"][-1]["x"])
    assert ways.equal
    assert found["whole"].panels[0].marks[-1].high == pytest.approx([100.0])


def test_a_term_of_each_flight_is_taken_from_each_flight(verdict):
    """Against the corrected model with the value of that flight put in by hand."""
    own = {"drag_linear.d[0]": np.array([0.003, -0.002])}
    moments, decision, proof = verdict.reasoned
    left = left_by_rules(moments, replace(decision, fit=replace(decision.fit, own=own)), proof)
    model = proof.models[1]
    for flight in (0, 1):
        here = left.wrench.flight[left.wrench.force_at] == flight
        by_hand = model.with_parameters({"drag_linear.d[0]": model.parameters["drag_linear.d[0]"]
                                         + float(own["drag_linear.d[0]"][flight])})
        np.testing.assert_allclose(left.after[0][here], left.wrench.residual(by_hand)[0][here], atol=1e-12)


def test_the_floor_is_the_size_of_the_remembered_noise(verdict):
    moments, _, _ = verdict.reasoned
    channel = moments.channels[0]
    memory = replace(channel.memory, weights=np.array([0.9]))
    coloured = replace(channel, memory=memory, sd=2.0)
    found = floor(replace(moments, channels=(coloured, *moments.channels[1:])))
    assert found[0] == pytest.approx(2.0 / np.sqrt(1.0 - 0.9**2), rel=1e-6)  # variance of a first-order process


def test_means_of_whole_stretches_are_the_means_of_their_means():
    """Equal stretches: Student's interval over the stretches' means."""
    rng = np.random.default_rng(0)
    per, many = 50, 12
    values = rng.standard_normal((many, per)) + rng.standard_normal((many, 1))
    found = binned(values.reshape(-1, 1), np.zeros(many * per, int), np.repeat(np.arange(many), per), 1)
    means = values.mean(axis=1)
    low, high = student.interval(0.95, many - 1, means.mean(), means.std(ddof=1) / np.sqrt(many))
    assert found.mean[0, 0] == pytest.approx(means.mean())
    assert found.half[0, 0] == pytest.approx((high - low) / 2.0)


def test_a_bin_of_few_stretches_has_no_bar():
    track, time_s = np.zeros(600, int), 0.01 * np.arange(600)
    blocks = block_numbers(track, time_s)
    assert len(np.unique(blocks)) == 6.0 / BLOCK_S
    found = binned(np.ones((600, 1)), np.zeros(600, int), blocks, 2)
    assert not found.shown.any()
    assert np.isnan(found.half).all()


@pytest.mark.browser
@pytest.mark.slow
def test_it_is_drawn_and_fits_phone_and_desk(verdict, recordings, tmp_path):
    binary = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    driver = pytest.importorskip("playwright.sync_api") if binary else None
    if driver is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)("NO BROWSER: the page was not opened; install chromium")
    path = tmp_path / "report.html"
    write_page(verdict, recordings, path, synthetic=True)
    trouble = []
    with driver.sync_playwright() as started:
        browser = started.chromium.launch(executable_path=binary, args=["--no-sandbox"], timeout=600_000)
        sheet = browser.new_page(viewport={"width": 390, "height": 844})
        sheet.on("console", lambda m: trouble.append(m.text) if m.type == "error" else None)
        sheet.on("pageerror", lambda e: trouble.append(str(e)))
        sheet.on("request", lambda r: trouble.append(r.url) if r.url.startswith(("http", "ws")) else None)
        sheet.set_default_timeout(600_000)  # a busy machine is slow, not wrong
        sheet.goto(path.as_uri())
        sheet.wait_for_selector("html[data-ready]", state="attached")
        for figure in sheet.query_selector_all("figure[data-figure]"):
            figure.scroll_into_view_if_needed()
            sheet.wait_for_selector(f"#{figure.get_attribute('id')}[data-drawn]")
        empty = sheet.evaluate("""[...document.querySelectorAll("figure")].filter(f =>
            !f.querySelector(".cartesianlayer path")).map(f => f.id)""")
        assert empty == []
        first = "document.querySelector('#fig-timeline .plot').data[0].y[3]"
        before = sheet.evaluate(first)
        sheet.locator("#fig-timeline select").nth(1).select_option(label="force y")
        assert sheet.evaluate(first) != before
        assert sheet.evaluate("document.scrollingElement.scrollWidth - window.innerWidth") <= 0
        sheet.set_viewport_size({"width": 1400, "height": 900})
        sheet.wait_for_selector("#fig-spans .main-svg[width='1208']")
        assert sheet.evaluate("document.scrollingElement.scrollWidth - window.innerWidth") <= 0
        browser.close()
    assert trouble == []
