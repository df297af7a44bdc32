"""The page in a real browser: no request, no error, pictures drawn, two widths, print, and the chooser.

Chromium of the system is driven through playwright; without it these tests say so, and on a continuous-integration
machine (environment variable CI) they fail instead.
"""

import os
import shutil

import pytest
from test_control_pictures import BODY as control_body

from nanobench_tools.pages import write_report

pytestmark = pytest.mark.browser
NAMES = ("chromium", "chromium-browser", "google-chrome")
PICTURES = ("usable", "flight", "task1", "wander", "speed", "deadlogs", "bands", "attribution", "clocks", "published")
ARGUMENTS = ["--no-sandbox"]
NASTY = "third <script>alert(1)</script> & \"Ü☃\" 50%"
PHONE, DESK = (390, 844), (1400, 900)
PATIENCE_MS = 600_000
"""Limit of every wait for the browser: a busy machine is slow, not wrong."""


@pytest.fixture(scope="module")
def browser():
    binary = next(filter(None, map(shutil.which, NAMES)), None)
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        sync_playwright = None
    if binary is None or sync_playwright is None:
        said = "NO BROWSER: the report was not opened; install " + ("chromium" if binary is None else "playwright")
        if os.environ.get("CI"):
            pytest.fail(said)
        pytest.skip(said)
    with sync_playwright() as driver:
        instance = driver.chromium.launch(executable_path=binary, args=ARGUMENTS, timeout=PATIENCE_MS)
        yield instance
        instance.close()


@pytest.fixture(scope="module")
def path(tmp_path_factory, make):
    flights = [make.flight("loop one"), make.flight("loop two", radius_m=0.4), make.flight(NASTY),
               make.flight("no battery, no mocap", streams=("estimator", "setpoint", "motor"))]
    return write_report(tmp_path_factory.mktemp("page"), make.results(flights), flights, {}, synthetic=False)


class Page:
    """A page that counts what must not happen."""

    def __init__(self, browser, path, size=DESK, fragment="", **context):
        self.context = browser.new_context(viewport={"width": size[0], "height": size[1]}, **context)
        self.context.set_default_timeout(PATIENCE_MS)
        self.page = self.context.new_page()
        self.trouble = []
        self.page.on("console", lambda m: self.trouble.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda e: self.trouble.append(str(e)))
        self.page.on("dialog", lambda d: (self.trouble.append("a dialog"), d.dismiss()))
        self.context.route("**/*", self._gate)
        self.page.goto(path.as_uri() + fragment)
        self.wait()

    def _gate(self, route):
        if route.request.url.startswith(("file:", "data:", "blob:")):
            route.continue_()
        else:
            self.trouble.append(f"asked the network for {route.request.url}")
            route.abort()

    def wait(self):
        self.page.wait_for_selector("html[data-ready]", state="attached")

    def choose(self, name):
        self.page.select_option("#chosen", label=name)
        self.wait()
        return self

    def seen(self, picture):
        """Scrolls to a picture, which is drawn then."""
        self.page.locator(f"#fig-{picture}").scroll_into_view_if_needed()
        self.page.wait_for_selector(f"#fig-{picture}[data-drawn]")
        return self

    def ink(self, picture):
        """How many marks a picture has: drawn paths with a length."""
        return self.seen(picture).page.evaluate("""id => [...document.querySelectorAll(
            `#fig-${id} .plot .main-svg .cartesianlayer path`)].filter(p => p.getTotalLength() > 0).length""", picture)

    def plot(self, picture, what):
        """A value of the library's state of a picture."""
        return self.page.evaluate(f"document.querySelector('#fig-{picture} .plot').{what}")

    def overflow(self):
        return self.page.evaluate("document.scrollingElement.scrollWidth - window.innerWidth")


@pytest.fixture
def opened(browser, path):
    pages = []

    def call(**options):
        pages.append(Page(browser, path, **options))
        return pages[-1]

    yield call
    for page in pages:
        trouble = list(page.trouble)
        page.context.close()
        assert trouble == []


def _shared(browser, path, **options):
    page = Page(browser, path, **options)
    yield page
    trouble = list(page.trouble)
    page.context.close()
    assert trouble == []


@pytest.fixture(scope="module")
def desk(browser, path):
    """One page for the tests that leave nothing behind another could trip over."""
    yield from _shared(browser, path, color_scheme="light")


@pytest.fixture(scope="module")
def phone(browser, path):
    """As ``desk``."""
    yield from _shared(browser, path, size=PHONE, color_scheme="dark", has_touch=True)


def test_nothing_is_drawn_before_it_is_near(phone):
    assert phone.page.get_attribute("#fig-attribution", "data-drawn") is None
    assert phone.ink("attribution") > 2


@pytest.mark.parametrize("shown", ["phone", "desk"])
def test_everything_is_drawn_and_fits_the_width(shown, request):
    page = request.getfixturevalue(shown)
    assert page.overflow() <= 0
    assert {picture: page.ink(picture) for picture in PICTURES if page.ink(picture) < 2} == {}
    texts = page.page.eval_on_selector_all("td, tbody th", "list => list.map(c => c.textContent.trim().toLowerCase())")
    assert not {"nan", "undefined", "null"} & set(texts)


CUT_TEXTS = """id => { const edge = document.querySelector(`#fig-${id} .plot .main-svg`).getBoundingClientRect();
    return [...document.querySelectorAll(`#fig-${id} .plot text`)].map(text => [text.textContent,
        text.getBoundingClientRect()]).filter(([text, box]) => text && (
        box.left < edge.left - 1 || box.right > edge.right + 1)).map(([text]) => text); }"""


def test_no_text_of_a_picture_is_cut_on_a_phone(phone):
    assert {name: cut for name in ("usable", "deadlogs", "task1", "attribution", "speed")
            if (cut := phone.seen(name).page.evaluate(CUT_TEXTS, name))} == {}
    assert "&quot;" not in phone.page.locator("#fig-usable").inner_text()


WIDER_THAN_ITS_BOX = """() => [...document.querySelectorAll("main .scroll")].filter(
    box => box.clientWidth && box.scrollWidth > box.clientWidth + 1).length"""
HIDDEN_COLUMNS = "() => document.querySelectorAll('main th[hidden]').length"
TIME_AXES = """() => { const layout = document.querySelector("#fig-flight .plot")._fullLayout;
    return Object.entries(layout).filter(([key, axis]) => /^xaxis/.test(key) && axis.title.text.startsWith("time"))
        .map(([, axis]) => axis._offset); }"""


def test_columns_that_do_not_fit_wait_behind_a_button(opened):
    page = opened(size=(1280, 900)).page
    page.evaluate("() => document.querySelectorAll('details').forEach(part => { part.open = true; })")
    page.wait_for_function("() => document.querySelectorAll('details button.more').length > 0")
    assert page.evaluate(WIDER_THAN_ITS_BOX) == 0
    before = page.evaluate(HIDDEN_COLUMNS)
    page.evaluate("() => document.querySelector('button.more').click()")
    assert page.evaluate(HIDDEN_COLUMNS) < before


def test_the_time_axes_of_a_flight_line_up(desk):
    lefts = desk.choose("loop one").seen("flight").page.evaluate(TIME_AXES)
    assert len(lefts) > 2
    assert max(lefts) - min(lefts) < 1.0


def test_every_axis_says_its_unit(desk):
    page = desk.choose("loop one")
    for picture in PICTURES:
        page.seen(picture)
    titles = page.page.evaluate("""() => [...document.querySelectorAll(".plot")].flatMap(p => {
        const l = p._fullLayout;
        return Object.keys(l).filter(k => /^[xy]axis/.test(k)).map(k => [l[k].title.text || "", l[k].ticks]);
    })""")
    assert len(titles) > 20
    assert [t for t in titles if not t[0].endswith("]") and t[1] and t[0] != "motor PWM ratio"] == []


def test_a_logarithmic_axis_has_ticks_that_can_be_read(desk):
    ticks = desk.choose("loop one").seen("task1").page.evaluate("""() => {
        const l = document.querySelector("#fig-task1 .plot")._fullLayout;
        return Object.keys(l).filter(k => /^[xy]axis/.test(k)).map(k => l[k]._vals.map(v => v.text)); }""")
    assert all(2 <= len(t) <= 12 for t in ticks)
    assert "0.01" in ticks[0]


def test_the_chooser_changes_the_picture_and_the_address(desk):
    page = desk.choose("loop one")
    before = page.seen("flight").plot("flight", "data[0].x")
    page.choose("loop two").seen("flight")
    assert page.page.url.endswith("#flight=loop%20two")
    assert page.plot("flight", "data[0].x") != before
    assert page.page.inner_text("#flight-name") == "loop two"
    page.page.click("#previous")
    page.page.wait_for_selector("html[data-ready='0']", state="attached")
    assert page.seen("flight").plot("flight", "data[0].x") == before


def test_a_name_in_the_list_opens_its_flight(desk):
    page = desk.choose("loop one")
    page.page.click("#table-flights >> text=loop two")
    page.page.wait_for_selector("html[data-ready='1']", state="attached")
    assert page.page.evaluate("document.activeElement.id") == "flight-name"


def test_a_recording_without_battery_and_mocap_draws_what_it_has(opened):
    page = opened(fragment="#flight=no%20battery%2C%20no%20mocap")
    titles = "data.length"
    assert page.ink("flight") > 1
    without = page.plot("flight", titles)
    page.choose("loop one").seen("flight")
    assert page.plot("flight", titles) > without


def test_a_name_full_of_traps_is_only_a_name(desk):
    page = desk.choose("loop one")
    page.choose(NASTY)
    assert page.page.input_value("#chosen") == "2"
    assert NASTY in page.page.inner_text("#table-flights").replace("\n", "")
    assert page.ink("clocks") > 1


def test_a_touched_heading_sorts_the_table(desk):
    page = desk.choose("loop one")
    button = page.page.locator("#table-flights thead button").first
    first = "#table-flights tbody tr:first-child th"
    button.click()
    up = page.page.inner_text(first)
    button.click()
    assert (up, page.page.inner_text(first)) == ("loop one", NASTY)
    assert page.page.get_attribute("#table-flights thead th:first-child", "aria-sort") == "descending"


def test_a_legend_name_hides_its_curve_and_zoom_is_shared(desk):
    page = desk.choose("loop one").seen("flight")
    page.page.locator("#fig-flight .legend button", has_text="motion capture").click()
    assert page.plot("flight", "data[0].visible") is False
    timed = page.page.evaluate("""() => { const l = document.querySelector("#fig-flight .plot")._fullLayout;
        return Object.keys(l).filter(k => /^xaxis/.test(k) && l[k].title.text === "time [s]"); }""")
    assert len(timed) > 4
    page.page.evaluate("k => Plotly.relayout(document.querySelector('#fig-flight .plot'), {[k + '.range']: [3, 4]})",
                       timed[-1])
    assert page.plot("flight", f"_fullLayout.{timed[0]}.range") == [3, 4]


def test_the_slider_shows_where_everything_was_and_says_it(desk):
    page = desk.choose("loop one").seen("flight")
    page.page.evaluate("""() => { const s = document.querySelector("#fig-flight .cursor input"); s.value = 10.0;
                                  s.dispatchEvent(new Event("input")); }""")
    page.page.wait_for_function("""() => document.querySelector("#fig-flight .plot").data.filter(
        t => t.mode === "markers" && t.meta === "motion capture").every(t => t.x[0] > 0.5)""")
    said = page.page.inner_text("#fig-flight output")
    assert said.startswith("10.00 s · position error 100 mm · attitude error 10 deg")
    assert page.page.get_attribute("#fig-flight .cursor input", "aria-valuetext") == said
    dots = page.plot("flight", "data.filter(t => t.mode === 'markers').map(t => [t.meta, t.x[0], t.y[0]])")
    assert [x for name, x, y in dots if name == "motion capture"] == pytest.approx([1.0, 1.0], abs=0.02)


def test_on_a_phone_a_row_is_a_card_with_its_numbers(phone):
    cell = phone.page.locator("#table-flights tbody tr:first-child td.num").first
    assert cell.get_attribute("data-head") == "Usable [s]"
    box = cell.bounding_box()
    assert box["x"] >= 0.0
    assert box["x"] + box["width"] <= PHONE[0]


@pytest.mark.slow
def test_printed_it_is_whole_light_and_within_the_sheet(opened):
    page = opened(color_scheme="dark")
    page.page.emulate_media(media="print")
    page.page.wait_for_selector("html.printing", state="attached")
    widths = page.page.eval_on_selector_all(".plot", "list => list.map(p => p.querySelector('.main-svg').clientWidth)")
    assert max(widths) <= 703  # A4 less its margins, at 96 px per inch
    assert page.page.eval_on_selector_all("section, .plot", "list => list.every(e => e.offsetHeight > 50)")
    assert page.page.query_selector("figure[data-figure]:not([data-drawn])") is None
    assert page.page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    assert page.page.eval_on_selector_all(".scroll", "l => l.every(e => getComputedStyle(e).overflowX === 'visible')")
    assert page.page.pdf(prefer_css_page_size=True).startswith(b"%PDF")
    page.page.emulate_media(media="screen")
    page.page.wait_for_selector("html:not(.printing)", state="attached")


def test_what_a_finger_has_to_hit_is_large_enough(opened):
    page = opened(size=PHONE, has_touch=True, is_mobile=True)
    assert page.overflow() <= 0
    small = page.page.eval_on_selector_all("nav a, .tile, summary, button:not(thead *), select", """list => list
        .map(e => [e.textContent.trim(), e.getBoundingClientRect()]).filter(([_, r]) => r.height < 40 || r.width < 40)
        .map(([name]) => name)""")
    assert small == []


@pytest.mark.parametrize("size", [PHONE, DESK])
@pytest.mark.slow
def test_a_flight_that_is_played_goes_in_its_own_time_to_its_end(browser, tmp_path, size):
    path = write_report(tmp_path, {"control": control_body}, [], {}, synthetic=False)
    opened = Page(browser, path, size).seen("gateflights").seen("race")
    taken = opened.page.evaluate("""() => new Promise(done => {
        const button = document.querySelector("#fig-race .cursor button"), begun = performance.now();
        button.click();
        const said = [button.getAttribute("aria-label")];
        const look = () => (button.getAttribute("aria-label") === "play" ? done([performance.now() - begun, ...said])
            : setTimeout(look, 5));
        look();
    })""")
    end = control_body["flights"][0]["time_s"][38]
    assert taken[1] == "stop"
    assert taken[0] > 1000.0 * (end * 2.0 / 3.0) - 100.0  # a busy machine is slower; none is faster
    opened.page.wait_for_timeout(100)
    state = opened.page.evaluate("""() => { const p = document.querySelector("#fig-race .plot"); return {
        mark: p.data.filter(t => t.meta === "good" && t.mode === "markers")[0].x[0],
        line: p.layout.shapes.map(s => s.x0),
        shown: document.querySelector("#fig-race output").textContent }; }""")
    assert state["mark"] == pytest.approx(control_body["flights"][0]["flown_m"][38][0], abs=2e-2)
    assert state["line"] == pytest.approx([end] * 2, abs=0.05)
    assert state["shown"].startswith("1.")
    assert opened.overflow() <= 0
    assert opened.trouble == []
    opened.context.close()


def test_another_estimator_can_be_chosen_for_its_three_sigma(desk):
    page = desk.choose("loop one").seen("bands")
    before = page.page.get_attribute("#fig-bands", "data-drawn")
    page.page.locator("#fig-bands select").nth(1).select_option(label="two")
    assert page.page.get_attribute("#fig-bands", "data-drawn") != before
    assert "All three axes" in page.page.inner_text("#fig-bands .note")
    assert page.ink("bands") > 5
