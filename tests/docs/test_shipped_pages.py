"""Pages of simulators that shipped wrong: each has what happened, what the diagnosis reports and what was right."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from identification.prove.shipped.shipped_cases import shipped_cases
from tools import shipped_pages

CASES = {case.name: case for case in shipped_cases()}
ERROR = {"quantity": "position", "unit": "m", "ahead_s": 0.5, "shipped": 0.4, "identified": 0.1, "corrected": None}
KNOWN = {"terms": ["thrust_scale", "mass"], "by": "thrust_scale", "parameter": "thrust over weight", "true": 1.61,
         "value": 1.6, "ci95": [1.58, 1.62], "inside": True}
FIGURES = {"flights": ["a", "b", "c"], "judged_s": 27.0, "credit": "someone", "reason": "", "worst": ERROR,
           "half_second": [ERROR], "right": False, "why": "also identified: wind", "identified": True,
           "visible": True, "known": [KNOWN], "false": ["wind"], "again": [], "before": "The simulator is wrong. " * 20,
           "after": "Nothing is identified."}
NOTHING = {"reason": "no recordings", "right": None, "half_second": []}


def test_a_page_has_the_thread_the_size_and_what_was_wrong():
    text = shipped_pages.page(CASES["agileflight_thrust"], FIGURES, "Real: flights")
    for part in (*CASES["agileflight_thrust"].threads, "1.58 to 1.62", "right is 1.61", "`wind`",
                 "The answer is wrong: also identified: wind.", "0.4 m | 0.1 m | –",
                 "agileflight_thrust-dark.svg#only-dark"):
        assert part in text, part
    assert max(map(len, text.split("```text")[1].split("```")[0].splitlines())) <= shipped_pages.LONGEST


def test_a_case_that_is_not_applicable_has_its_reason():
    case = CASES["rotorpy_rate_gain"]
    text = shipped_pages.page(case, NOTHING, "Real: flights")
    assert case.reason in text
    assert "svg" not in text


def test_a_picture_is_small_and_well_formed():
    for _, colours in shipped_pages.SHADES:
        svg = shipped_pages.picture("A & B", [ERROR, {**ERROR, "corrected": 0.8}], colours)
        ET.fromstring(svg)
        assert ">25<" in svg  # % of the error as shipped
        assert len(svg) < 10_000


def test_the_overview_has_a_row_for_each_case():
    figures = {"case": {name: FIGURES if CASES[name].vehicle else NOTHING for name in CASES},
               "all": {"right": 0, "n": 19, "ci95": [0.0, 0.2], "false": 19}}
    text = shipped_pages.overview(list(CASES.values()), figures, "Real: flights")
    assert text.count(".md)") == len(CASES)
    assert "0 of 19 answers are right (95 %: 0 to 20 %)" in text


@pytest.mark.parametrize("name", CASES)
def test_every_case_has_a_page_that_is_up_to_date(name):
    source = shipped_pages.stored()
    page = Path(shipped_pages.PLACE / f"{name}.md").read_text(encoding="utf-8")
    assert page == shipped_pages.page(CASES[name], source["figures"]["case"][name], shipped_pages.origin_of(source))
    nav = (shipped_pages.DOCS.parent / "mkdocs.yml").read_text(encoding="utf-8")
    assert f"gallery/shipped/{name}.md" in nav
