"""The page in a real browser: no request, no error, pictures drawn, two widths, print, and the chooser.

Chromium of the system is driven through playwright; without it these tests say so, and on a continuous-integration
machine (environment variable CI) they fail instead.
"""

import os
import shutil

import pytest
from test_control_pictures import BODY as control_body

from nanobench_tools.report import write_report

pytestmark = pytest.mark.browser
NAMES = ("chromium", "chromium-browser", "google-chrome")
PICTURES = ("task1", "wander", "task3", "deadlogs", "bands", "attribution", "clocks", "space", "plane", "errors",
            "clock", "timeline", "battery", "motors")
ARGUMENTS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
             "--ignore-gpu-blocklist"]
NASTY = "third <script>alert(1)</script> & \"Ü☃\" 50%"
PHONE, DESK = (390, 844), (1400, 900)


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
        instance = driver.chromium.launch(executable_path=binary, args=ARGUMENTS)
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
        self.page = self.context.new_page()
        self.trouble = []
        self.page.on("console", lambda m: self.trouble.append(m.text) if m.type == "error" else None)
        self.page.on("pageerror", lambda e: self.trouble.append(str(e)))
        self.page.on("dialog", lambda d: (self.trouble.append("a dialog"), d.dismiss()))
        self.context.route("**/*", self._gate)
        self.page.goto(path.as_uri() + fragment, timeout=120_000)  # a busy machine is slow, not wrong
        self.wait()

    def _gate(self, route):
        if route.request.url.startswith(("file:", "data:", "blob:")):
            route.continue_()
        else:
            self.trouble.append(f"asked the network for {route.request.url}")
            route.abort()

    def wait(self):
        self.page.wait_for_selector("html[data-ready]", state="attached", timeout=60_000)

    def choose(self, name):
        self.page.select_option("#chosen", label=name)
        self.wait()
        return self

    def ink(self, picture):
        """How many marks a picture has: drawn paths with a length, or pixels of its canvas that are not empty."""
        return self.page.evaluate("""id => {
            const place = document.getElementById("plot-" + id);
            const paths = [...place.querySelectorAll(".main-svg .plot path, .main-svg .cartesianlayer path")];
            let marks = paths.filter(p => p.getTotalLength() > 0).length;
            for (const canvas of place.querySelectorAll("canvas")) {
              const copy = document.createElement("canvas");
              [copy.width, copy.height] = [canvas.width, canvas.height];
              const pen = copy.getContext("2d");
              pen.drawImage(canvas, 0, 0);
              const pixels = pen.getImageData(0, 0, copy.width, copy.height).data;
              for (let i = 3; i < pixels.length; i += 4) marks += pixels[i] > 0;
            }
            return marks;
        }""", picture)

    def curve(self, picture):
        """The numbers the first curve of a picture was drawn from."""
        return self.page.evaluate("id => JSON.stringify(document.getElementById('plot-' + id).data[0].x)", picture)

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


@pytest.fixture(scope="module")
def desk(browser, path):
    """One page for the tests that leave nothing behind another could trip over."""
    page = Page(browser, path)
    yield page
    trouble = list(page.trouble)
    page.context.close()
    assert trouble == []


@pytest.mark.parametrize(("size", "scheme"), [(PHONE, "dark"), (DESK, "light")])
def test_everything_is_drawn_and_fits_the_width(opened, size, scheme):
    page = opened(size=size, color_scheme=scheme, has_touch=size == PHONE)
    assert page.overflow() <= 0
    headings = page.page.eval_on_selector_all("h2", "list => list.map(h => h.textContent.trim())")
    assert [h for h in headings if h.startswith("Task")] == ["Task 1", "Task 2", "Task 3"]
    assert {picture: page.ink(picture) for picture in PICTURES if page.ink(picture) < 2} == {}
    texts = page.page.eval_on_selector_all("td, tbody th", "list => list.map(c => c.textContent.trim().toLowerCase())")
    assert not {"nan", "undefined", "null"} & set(texts)


def test_every_axis_says_its_unit(desk):
    page = desk.choose("loop one")
    titles = page.page.evaluate("""() => [...document.querySelectorAll(".plot")].flatMap(p => {
        const l = p._fullLayout;
        const axes = l.scene ? [l.scene.xaxis, l.scene.yaxis, l.scene.zaxis] :
            Object.keys(l).filter(k => /^[xy]axis/.test(k)).map(k => l[k]);
        return axes.map(a => [p.id, a.title.text || "", a.ticktext ? "names" : ""]);
    })""")
    assert len(titles) > 20
    assert [t for t in titles if not t[1].endswith("]") and t[2] != "names"] == []


def test_the_chooser_changes_every_picture(desk):
    page = desk.choose("loop one")
    before = {picture: page.curve(picture) for picture in ("space", "plane")}
    page.choose("loop two")
    assert page.page.url.endswith("#flight=loop%20two")
    assert all(page.curve(picture) != x for picture, x in before.items())
    assert page.page.get_attribute("#plot-space", "data-shows") == "1"
    page.page.click("#previous")
    page.wait()
    assert page.curve("space") == before["space"]


def test_a_recording_without_battery_and_mocap_draws_what_it_has_and_says_the_rest(opened):
    page = opened(fragment="#flight=no%20battery%2C%20no%20mocap")
    assert "No battery stream" in page.page.inner_text("#fig-battery")
    assert "no truth to compare with" in page.page.inner_text("#fig-errors")
    assert page.ink("motors") > 1
    assert page.ink("plane") > 1
    page.choose("loop one")
    assert page.ink("battery") > 1
    assert page.ink("errors") > 1


def test_a_name_full_of_traps_is_only_a_name(desk):
    page = desk.choose("loop one")
    page.choose(NASTY)
    assert page.page.input_value("#chosen") == "2"
    assert NASTY in page.page.inner_text("table.matrix").replace("\n", "")
    assert page.ink("clocks") > 1


def test_a_touched_heading_sorts_the_table(desk):
    page = desk.choose("loop one")
    button = page.page.locator("table.matrix thead button").first
    first = "table.matrix tbody tr:first-child th"
    button.click()
    up = page.page.inner_text(first)
    button.click()
    assert (up, page.page.inner_text(first)) == ("loop one", NASTY)
    assert page.page.get_attribute("table.matrix thead th:first-child", "aria-sort") == "descending"


def test_a_legend_name_hides_its_curve_and_zoom_is_shared(desk):
    page = desk.choose("loop one")
    page.page.locator("#fig-motors .legend button").first.click()
    assert page.page.evaluate("document.getElementById('plot-motors').data[0].visible") is False
    page.page.evaluate("Plotly.relayout('plot-battery', {'xaxis.range': [3, 4]})")
    page.page.wait_for_function("document.getElementById('plot-timeline').layout.xaxis.range[1] === 4")
    assert page.page.evaluate("document.getElementById('plot-errors').layout.xaxis.range") == [3, 4]


def test_printed_it_is_whole_light_and_within_the_sheet(opened):
    page = opened(color_scheme="dark")
    page.page.emulate_media(media="print")
    page.page.wait_for_selector("html.printing", state="attached")
    widths = page.page.eval_on_selector_all(".plot", "list => list.map(p => p.querySelector('.main-svg').clientWidth)")
    assert max(widths) <= 703  # A4 less its margins, at 96 px per inch
    assert page.page.eval_on_selector_all("section, .plot", "list => list.every(e => e.offsetHeight > 50)")
    assert page.page.evaluate("getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    assert page.page.eval_on_selector_all(".scroll", "l => l.every(e => getComputedStyle(e).overflowX === 'visible')")
    assert page.page.pdf(prefer_css_page_size=True).startswith(b"%PDF")
    page.page.emulate_media(media="screen")
    page.page.wait_for_selector("html:not(.printing)", state="attached")


def test_what_a_finger_has_to_hit_is_large_enough(opened):
    page = opened(size=PHONE, has_touch=True, is_mobile=True)
    assert page.overflow() <= 0
    small = page.page.eval_on_selector_all("nav a, .chooser button, .chooser select, .legend button", """list => list
        .map(e => [e.textContent.trim(), e.getBoundingClientRect()]).filter(([_, r]) => r.height < 40 || r.width < 40)
        .map(([name]) => name)""")
    assert small == []


def test_the_slider_of_simulated_flights_moves_their_marks(browser, tmp_path):
    path = write_report(tmp_path, {"control": control_body}, [], {}, synthetic=False)
    phone = Page(browser, path, PHONE)
    mark = "document.getElementById('plot-race').data[4].x[0]"
    before = phone.page.evaluate(mark)
    phone.page.evaluate("(() => { const s = document.querySelector('#fig-race input'); s.value = 19;"
                        " s.dispatchEvent(new Event('input')); })()")
    assert phone.page.evaluate(mark) != before
    assert phone.page.evaluate(mark) == pytest.approx(control_body["flights"][0]["flown_m"][38][0], abs=2e-3)
    assert phone.page.query_selector("#plot-gateflights .main-svg") is not None
    assert phone.overflow() <= 0
    assert phone.trouble == []
    phone.context.close()


@pytest.mark.parametrize("size", [PHONE, DESK])
def test_a_flight_that_is_played_goes_in_its_own_time_to_its_end(browser, tmp_path, size):
    path = write_report(tmp_path, {"control": control_body}, [], {}, synthetic=False)
    opened = Page(browser, path, size)
    taken = opened.page.evaluate("""() => new Promise(done => {
        const button = document.querySelector("#fig-race .player button"), begun = performance.now();
        button.click();
        const said = [button.getAttribute("aria-label")];
        const look = () => (button.getAttribute("aria-label") === "play" ? done([performance.now() - begun, ...said])
            : setTimeout(look, 5));
        look();
    })""")
    times = control_body["flights"][0]["time_s"][::2]
    left_ms = 1000.0 * (times[-1] - times[len(times) // 3])
    assert taken[1] == "stop"
    assert taken[0] > left_ms - 10.0  # a busy machine is slower; none is faster
    state = opened.page.evaluate("""() => { const p = document.getElementById("plot-race"); return {
        mark: p.data[4].x[0], line: p.layout.shapes.map(s => s.x0),
        slider: document.querySelector("#fig-race input").value,
        shown: document.querySelector("#fig-race output").textContent }; }""")
    assert state["mark"] == pytest.approx(control_body["flights"][0]["flown_m"][38][0], abs=2e-3)
    assert state["line"] == pytest.approx([times[-1]] * 2)
    assert (state["slider"], state["shown"]) == ("19", "1.9 s")
    assert opened.trouble == []
    opened.context.close()


def test_another_estimator_can_be_chosen_for_its_three_sigma(desk):
    page = desk.choose("loop one")
    before = page.page.get_attribute("#plot-bands", "data-shows")
    page.page.locator("#fig-bands select").nth(1).select_option(label="two")
    assert page.page.get_attribute("#plot-bands", "data-shows") != before
    assert "all three axes" in page.page.inner_text("#fig-bands .note")
    assert page.ink("bands") > 5
