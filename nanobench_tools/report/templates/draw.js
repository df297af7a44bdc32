"use strict";
// What every picture shares: data out of the page, colours of the theme, a legend outside the plot, redrawing.
const nanobench = (() => {
  const drawn = new Map();
  // Named one by one: the library's own choice has a button that sends data away.
  const buttons = { flat: ["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"],
    space: ["toImage", "zoom3d", "pan3d", "tableRotation", "resetCameraDefault3d"] };
  const root = document.documentElement;
  const read = id => JSON.parse(document.getElementById(id).textContent);
  const escape = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const short = (text, n) => (text.length > n ? "…" + text.slice(1 - n) : text); // the end of a name tells more

  // Packed series: int16 steps around an offset (lowest value: gap) or float32.
  function unpack(packed) {
    const text = atob(packed.b === undefined ? packed.f : packed.b);
    const bytes = new Uint8Array(text.length);
    for (let i = 0; i < text.length; i++) bytes[i] = text.charCodeAt(i);
    const view = new DataView(bytes.buffer);
    const values = new Array(packed.n);
    for (let i = 0; i < packed.n; i++) {
      if (packed.b === undefined) {
        const value = view.getFloat32(4 * i, true);
        values[i] = Number.isFinite(value) ? value : null;
      } else {
        const step = view.getInt16(2 * i, true);
        values[i] = step === -32768 ? null : packed.o + packed.s * step;
      }
    }
    return values;
  }

  const printing = () => root.classList.contains("printing");
  const narrow = () => !printing() && window.innerWidth < 700;
  const coarse = () => window.matchMedia("(pointer: coarse)").matches;

  function colours() {
    const style = getComputedStyle(root);
    const names = ["ink", "soft", "line", "paper", "panel", "mocap", "blue", "orange", "green", "red", "purple", "sky", "grey"];
    return Object.fromEntries(names.map(name => [name, style.getPropertyValue("--" + name).trim()]));
  }

  function axis(c, title, more) {
    return Object.assign({ title: { text: title, standoff: 6, font: { size: 12 } }, gridcolor: c.line, linecolor: c.grey,
      zeroline: false, ticks: "outside", ticklen: 4, tickcolor: c.grey, automargin: true, tickfont: { size: 11 } }, more);
  }

  function layout(c, more) {
    return Object.assign({ paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false,
      font: { color: c.ink, size: 12, family: "system-ui, sans-serif" }, margin: { l: 58, r: 14, t: 8, b: 44 },
      hoverlabel: { bgcolor: c.panel, bordercolor: c.grey, font: { color: c.ink, size: 12 } },
      dragmode: coarse() ? false : "zoom", modebar: { bgcolor: "rgba(0,0,0,0)", color: c.soft, activecolor: c.ink } }, more);
  }

  function swatch(entry) {
    const ns = "http://www.w3.org/2000/svg";
    const svg = document.createElementNS(ns, "svg");
    svg.setAttribute("width", "26"); svg.setAttribute("height", "14"); svg.setAttribute("aria-hidden", "true");
    const make = (name, attributes) => {
      const element = document.createElementNS(ns, name);
      for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
      svg.append(element);
    };
    const dashes = { dash: "7 4", dot: "2 3", dashdot: "7 3 2 3", solid: "none" };
    if (entry.shape === "square") make("rect", { x: 8, y: 2, width: 10, height: 10, fill: entry.colour });
    else if (entry.shape === "bar") make("rect", { x: 2, y: 2, width: 22, height: 10, fill: entry.colour });
    else {
      if (entry.shape !== "mark") make("line", { x1: 1, x2: 25, y1: 7, y2: 7, stroke: entry.colour, "stroke-width": 3,
        "stroke-dasharray": dashes[entry.dash || "solid"] });
      if (entry.shape) make("circle", { cx: 13, cy: 7, r: 4, fill: entry.open ? "none" : entry.colour, stroke: entry.colour,
        "stroke-width": 2 });
    }
    return svg;
  }

  // A legend of buttons above the plot: it can never cover data, and a tap hides or shows what it names.
  function legend(id, entries) {
    const box = document.querySelector(`#fig-${id} .legend`);
    box.replaceChildren(...entries.map(entry => {
      const button = document.createElement("button");
      button.type = "button";
      button.setAttribute("aria-pressed", "true");
      button.append(swatch(entry), document.createTextNode(entry.name));
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(on));
        Plotly.restyle(`plot-${id}`, { visible: on }, entry.traces);
      });
      return button;
    }));
  }

  function note(id, text) {
    document.querySelector(`#fig-${id} .note`).textContent = text;
  }

  // Draws picture `id` from build(colours, width) -> {traces, layout, legend, height, note} or {absent}.
  function draw(id, build, key) {
    const place = document.getElementById(`plot-${id}`);
    if (!place || typeof Plotly === "undefined") return;
    drawn.set(id, [build, key]);
    const figure = place.closest("figure");
    const fixed = printing() ? (figure.closest(".pair") ? 335 : 690) : null;
    const width = fixed || place.clientWidth;
    const picture = build(colours(), width);
    let absent = figure.querySelector("p.absent");
    if (picture.absent) {
      if (!absent) { absent = document.createElement("p"); absent.className = "absent"; place.before(absent); }
      absent.textContent = picture.absent;
      Plotly.purge(place);
      place.replaceChildren();
      place.hidden = true;
      legend(id, []);
      note(id, "");
      return;
    }
    if (absent) absent.remove();
    place.hidden = false;
    place.style.height = `${picture.height}px`;
    picture.layout.height = picture.height;
    picture.layout.width = width;
    Plotly.react(place, picture.traces, picture.layout, { displaylogo: false, responsive: false, scrollZoom: false, doubleClick: "autosize",
      displayModeBar: coarse() || narrow() ? false : "hover", modeBarButtons: [picture.layout.scene ? buttons.space : buttons.flat] });
    place.dataset.shows = key === undefined ? "" : String(key);
    legend(id, picture.legend || []);
    if (picture.note !== undefined) note(id, picture.note);
  }

  function redraw() {
    for (const [id, [build, key]] of drawn) draw(id, build, key);
  }

  function print(on) {
    if (on === printing()) return;
    root.classList.toggle("printing", on);
    redraw();
  }

  let lastWidth = window.innerWidth;
  let waiting = null;
  window.addEventListener("resize", () => {
    if (window.innerWidth === lastWidth || printing()) return;
    lastWidth = window.innerWidth;
    clearTimeout(waiting);
    waiting = setTimeout(redraw, 150);
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  window.matchMedia("print").addEventListener("change", event => print(event.matches));
  window.addEventListener("beforeprint", () => print(true));
  window.addEventListener("afterprint", () => print(false));

  // Ticks of a logarithmic axis: all values, or 1, 2 and 5 of each decade where that is too many to be read.
  const few = values => (values.length <= 6 ? values : values.filter(v => /^[125]e/.test(v.toExponential())));

  return { few, read, escape, short, unpack, narrow, printing, axis, layout, draw, note };
})();
