"use strict";
// Draws what figure.py describes: panels of marks, a legend that hides, lists to choose by, a cursor through time.
const nanobench = (() => {
  const root = document.documentElement;
  const drawings = {};
  const drawn = new Map(); // figure element -> redraw
  // Named one by one: the library's own choice has a button that sends data away.
  const BUTTONS = [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]];
  const [BETWEEN, BELOW, TITLE, EDGE] = [58, 46, 20, 10]; // px: between rows, under the last, over a panel, beside all
  const escape = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const printing = () => root.classList.contains("printing");
  const narrow = () => !printing() && window.innerWidth < 700;
  const coarse = () => window.matchMedia("(pointer: coarse)").matches;

  function unpack(packed) {
    if (typeof packed !== "object" || Array.isArray(packed)) return packed;
    if (packed.r) return Array.from({ length: packed.r[2] }, (_, i) => packed.r[0] + packed.r[1] * i);
    let total = 0;
    return packed.d.map(step => (step === null ? null : (total += step) * packed.s));
  }

  async function inflate(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), character => character.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
  }

  // The plotting library is text until the first picture is drawn: numbers and links are there before it.
  function load() {
    const text = document.getElementById("library");
    if (!text) return;
    document.head.append(Object.assign(document.createElement("script"), { textContent: text.textContent }));
    text.remove();
  }

  function theme() {
    const style = getComputedStyle(root);
    return new Proxy({}, { get: (_, name) => style.getPropertyValue(`--${String(name)}`).trim() });
  }

  // Ticks of a logarithmic axis: as many of 1, 2, 5 or 1, 3 or 1 of each decade as there is room for.
  function logTicks(values, room) {
    const good = values.filter(v => v > 0);
    const [low, high] = good.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, 0]);
    const decades = [];
    for (let k = Math.floor(Math.log10(low)); k <= Math.ceil(Math.log10(high)); k++) decades.push(k);
    for (const steps of [[1, 2, 5], [1, 3], [1]]) {
      const ticks = decades.flatMap(k => steps.map(m => Number(`${m}e${k}`))).filter(v => v >= low / 1.6 && v <= high * 1.6);
      if (ticks.length <= room || steps.length === 1) return ticks.filter((_, i) => i % Math.ceil(ticks.length / room) === 0);
    }
    return [];
  }
  const tickText = v => (v >= 1e-3 && v < 1e5 ? String(v) : v.toExponential(0).replace(/e\+?(-?)(\d+)/, "·10<sup>$1$2</sup>").replace(/^1·/, ""));

  function axis(c, spec, values, pixels, upright) {
    const out = { title: { text: escape(spec.title || "") + (spec.unit ? ` [${escape(spec.unit)}]` : ""), standoff: 6, font: { size: 12 } },
      gridcolor: c.line, linecolor: c.grey, tickcolor: c.grey, ticks: "outside", ticklen: 4, tickfont: { size: 11 }, automargin: false,
      zeroline: Boolean(spec.zero), zerolinecolor: c.grey, rangemode: spec.zero ? "tozero" : "normal", nticks: Math.max(4, Math.floor(pixels / (upright ? 30 : 70))) };
    if (spec.rows) {
      const most = upright ? (narrow() ? 18 : 40) : 16;
      const shown = spec.rows.map(text => escape(text.length > most ? `…${text.slice(1 - most)}` : text)); // the end of a name tells more
      Object.assign(out, { tickvals: shown.map((_, i) => i), ticktext: shown, ticks: "", showgrid: false, fixedrange: true, zeroline: false,
        range: upright ? [shown.length - 0.4, -0.6] : [-0.6, shown.length - 0.4] });
    } else if (spec.log) {
      const ticks = spec.ticks || logTicks(values, Math.max(2, Math.floor(pixels / (upright ? 30 : 52))));
      Object.assign(out, { type: "log", tickvals: ticks, ticktext: ticks.map(tickText) });
    }
    if (spec.range) out.range = spec.log ? spec.range.map(Math.log10) : spec.range;
    return out;
  }

  function traces(mark, axes, c, units) {
    const colour = c[mark.colour || "blue"];
    const [x, y, low, high] = ["x", "y", "low", "high"].map(key => unpack(mark[key]));
    const shared = { ...axes, name: escape(mark.name), meta: mark.name, visible: mark.hidden ? false : true, showlegend: false };
    const [kind, size] = [mark.kind || "line", mark.size === undefined ? 8 : unpack(mark.size)];
    const told = `<b>${escape(mark.name)}</b><br>` + (mark.text ? "%{text}" : `%{x:.4~g}${units.x}, %{y:.4~g}${units.y}`) + "<extra></extra>";
    if (kind === "bars") return [{ ...shared, type: "bar", orientation: "h", base: x, x: high.map((v, k) => v - x[k]), y, width: size, text: mark.text && mark.text.map(escape),
      textposition: "none", marker: { color: colour, opacity: mark.fade || 1 }, hovertemplate: mark.text ? told : `<b>${escape(mark.name)}</b><br>%{base:.4~g} to %{x:.4~g}${units.x}<extra></extra>` }];
    const ends = !low || kind === "area" ? {} : { [mark.across ? "error_x" : "error_y"]: { type: "data", symmetric: false, color: colour, thickness: 1.5, width: 4,
      array: (mark.across ? x : y).map((v, k) => (high[k] === null || v === null ? 0 : Math.max(high[k] - v, 0))),
      arrayminus: (mark.across ? x : y).map((v, k) => (low[k] === null || v === null ? 0 : Math.max(v - low[k], 0))) } };
    const main = { ...shared, ...ends, type: "scatter", x, y, mode: { line: "lines", area: "lines", points: "markers", both: "lines+markers" }[kind], connectgaps: false,
      line: { color: colour, width: mark.width || 2, dash: mark.dash || "solid" }, text: mark.text && mark.text.map(escape), hovertemplate: told,
      hoverinfo: mark.name ? undefined : "skip", marker: { color: colour, size, symbol: mark.symbol || "circle", opacity: mark.fade || 1 } };
    if (!mark.name) delete main.hovertemplate;
    if (kind !== "area") return [main];
    const there = x.map((_, i) => i).filter(i => low[i] !== null && high[i] !== null);
    const back = there.slice().reverse();
    return [{ ...shared, type: "scatter", mode: "lines", x: [...there, ...back].map(i => x[i]), y: [...there.map(i => high[i]), ...back.map(i => low[i])], fill: "toself",
      fillcolor: colour, opacity: 0.22, line: { width: 0 }, hoverinfo: "skip" }, main];
  }

  const labelled = panel => (panel.y.rows ? 14 + 6.4 * Math.min(Math.max(...panel.y.rows.map(text => text.length)), narrow() ? 18 : 40) : 62);

  // Height of the plot itself [px]; where both axes have one scale, no more than the data need.
  function tall(panel, each) {
    const most = (panel.height || 260) - 50;
    if (!panel.equal) return most;
    const size = key => {
      const values = panel.marks.flatMap(mark => unpack(mark[key])).filter(v => v !== null);
      const [low, high] = values.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
      return Math.max(high - low, 0.05);
    };
    return Math.max(110, Math.min(most, 1.12 * (each - labelled(panel)) * size("y") / size("x")));
  }

  // Rows of panels, each with its place in pixels from above.
  function placed(panels, columns, width) {
    const rows = [];
    for (const panel of panels) {
      const last = rows[rows.length - 1];
      if (!last || panel.wide || columns === 1 || last.full || last.panels.length === columns) rows.push({ panels: [panel], full: Boolean(panel.wide) || columns === 1 });
      else last.panels.push(panel);
    }
    let top = 0;
    for (const row of rows) {
      row.top = top + (row.panels.some(p => p.title) ? TITLE : 4);
      row.height = Math.max(...row.panels.map(p => tall(p, row.full ? width : width / columns)));
      top = row.top + row.height + BETWEEN;
    }
    return { rows, height: top - BETWEEN + BELOW };
  }

  function build(figure, width) {
    const c = theme();
    const columns = width > 620 ? figure.columns || 2 : 1;
    const inner = width - 2 * EDGE;
    const { rows, height } = placed(figure.panels, columns, inner);
    const upper = height - BELOW;
    const shared = Math.max(0, ...figure.panels.filter(p => p.timed).map(labelled)); // one time axis above the other
    const out = { traces: [], dots: [], timed: [], height, layout: { width, height, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, barmode: "overlay",
      font: { color: c.ink, size: 12, family: "system-ui, sans-serif" }, margin: { l: EDGE, r: EDGE, t: 0, b: BELOW }, shapes: [], annotations: [],
      hoverlabel: { bgcolor: c.panel, bordercolor: c.grey, font: { color: c.ink, size: 12 } }, dragmode: coarse() ? false : "zoom",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: c.soft, activecolor: c.ink } } };
    let count = 0;
    for (const row of rows) row.panels.forEach((panel, column) => {
      const n = ++count === 1 ? "" : String(count);
      const each = row.full ? inner : inner / columns;
      const labels = panel.timed && row.full ? shared : labelled(panel);
      const pixels = { x: each - labels - (row.full ? 4 : 16), y: row.height };
      const all = key => panel.marks.flatMap(m => [...unpack(m[key]), ...((key === "x") === Boolean(m.across) ? [...(unpack(m.low) || []), ...(unpack(m.high) || [])] : [])]).filter(v => typeof v === "number");
      const from = (column * each + labels) / inner;
      const domain = { x: [from, Math.min(1, from + pixels.x / inner)], y: [1 - (row.top + row.height) / upper, 1 - row.top / upper] };
      const [x, y] = [`xaxis${n}`, `yaxis${n}`];
      out.layout[x] = { ...axis(c, panel.x, panel.x.log ? all("x") : [], pixels.x, false), domain: domain.x, anchor: `y${n}` };
      out.layout[y] = { ...axis(c, panel.y, panel.y.log ? all("y") : [], pixels.y, true), domain: domain.y, anchor: `x${n}` };
      if (panel.equal) Object.assign(out.layout[y], { scaleanchor: `x${n}` }), [x, y].forEach(key => { out.layout[key].constrain = key === x ? "range" : "domain"; });
      if (panel.timed) {
        if (out.timed.length) out.layout[x].matches = out.timed[0].x;
        out.timed.push({ x: `x${n}`, y: `y${n}`, panel });
      }
      if (panel.title) out.layout.annotations.push({ text: `<b>${escape(panel.title)}</b>`, x: domain.x[0], y: domain.y[1], xref: "paper", yref: "paper", xanchor: "left", yanchor: "bottom", showarrow: false, font: { size: 12 } });
      for (const [x0, x1, colour] of panel.shaded || []) out.layout.shapes.push({ type: "rect", xref: `x${n}`, yref: `y${n} domain`, x0, x1, y0: 0, y1: 1, layer: "below", fillcolor: c[colour], opacity: 0.16, line: { width: 0 } });
      for (const [way, value] of panel.rules || []) out.layout.shapes.push({ type: "line", xref: `x${n}${way === "y" ? " domain" : ""}`, yref: `y${n}${way === "x" ? " domain" : ""}`,
        ...(way === "x" ? { x0: value, x1: value, y0: 0, y1: 1 } : { x0: 0, x1: 1, y0: value, y1: value }), line: { color: c.ink, width: 1.2, dash: "dot" } });
      const units = Object.fromEntries(["x", "y"].map(key => [key, panel[key].unit ? ` ${escape(panel[key].unit)}` : ""]));
      for (const mark of panel.marks) {
        out.traces.push(...traces(mark, { xaxis: `x${n}`, yaxis: `y${n}` }, c, units));
        if (mark.t) out.dots.push({ mark, axes: { xaxis: `x${n}`, yaxis: `y${n}` } });
      }
    });
    return out;
  }

  function legend(box, figure, place) {
    const several = figure.panels.filter(p => new Set(p.marks.map(m => m.name)).size > 1); // a mark by itself is named by its axis
    const names = new Map(several.flatMap(p => p.marks).filter(m => m.name).map(m => [m.name, m]));
    box.replaceChildren(...(names.size < 2 ? [] : [...names.values()].map(mark => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: mark.name });
      const swatch = document.createElement("i");
      swatch.style.color = `var(--${mark.colour || "blue"})`;
      swatch.className = mark.kind === "points" ? `points ${mark.symbol || ""}` : mark.kind === "bars" ? "bar" : mark.dash || "solid";
      button.prepend(swatch);
      button.setAttribute("aria-pressed", String(!mark.hidden));
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(on));
        Plotly.restyle(place, { visible: on }, place.data.map((t, k) => (t.meta === mark.name ? k : -1)).filter(k => k >= 0));
      });
      return button;
    })));
  }

  function nearest(times, t) {
    let [a, b] = [0, times.length - 1];
    while (b - a > 1) { const m = (a + b) >> 1; if (times[m] <= t) a = m; else b = m; }
    return t - times[a] <= times[b] - t ? a : b;
  }

  // The slider: dots where everything is, a line through the panels over time, and the values in words.
  function cursor(box, figure, place, built) {
    const [start, end] = figure.cursor;
    box.innerHTML = `<button type="button" aria-label="play">▶</button><label>Time <input type="range" min="${start}" max="${end}" step="0.02"></label><output></output>`;
    const [button, slider, output] = ["button", "input", "output"].map(tag => box.querySelector(tag));
    const first = built.traces.length - built.dots.length;
    const series = built.dots.map(({ mark }) => Object.fromEntries(["t", "x", "y"].map(key => [key, unpack(mark[key])])));
    const told = built.timed.flatMap(({ panel }) => panel.marks.filter(m => m.name && m.kind !== "bars" && !(m.kind === "area" && m.width < 1)).map(m => ({ name: m.name, unit: panel.y.unit || "", x: unpack(m.x), y: unpack(m.y) })));
    const lines = built.layout.shapes.length - built.timed.length;
    let waiting = false;
    const move = () => {
      const t = Number(slider.value);
      output.textContent = [`${t.toFixed(2)} s`, ...told.map(s => [s, s.y[nearest(s.x, t)]]).filter(([, v]) => v !== null && v !== undefined).map(([s, v]) => `${s.name} ${Number(v.toPrecision(3))} ${s.unit}`.trim())].join(" · ");
      slider.setAttribute("aria-valuetext", output.textContent);
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        const at = series.map(s => nearest(s.t, Number(slider.value)));
        const shapes = Object.fromEntries(built.timed.flatMap((_, k) => [[`shapes[${lines + k}].x0`, Number(slider.value)], [`shapes[${lines + k}].x1`, Number(slider.value)]]));
        if (series.length) Plotly.update(place, { x: series.map((s, k) => [s.x[at[k]]]), y: series.map((s, k) => [s.y[at[k]]]) }, shapes, series.map((_, k) => first + k));
        else Plotly.relayout(place, shapes);
      });
    };
    let playing = null;
    const stop = () => { cancelAnimationFrame(playing); playing = null; button.textContent = "▶"; button.setAttribute("aria-label", "play"); };
    slider.value = String(start + (end - start) / 3);
    slider.addEventListener("input", () => { stop(); move(); });
    button.addEventListener("click", () => {
      if (playing !== null) { stop(); return; }
      if (Number(slider.value) >= end - 0.02) slider.value = String(start);
      let before = performance.now();
      button.textContent = "❚❚"; button.setAttribute("aria-label", "stop");
      const frame = now => { // in the time of the flight, however long drawing takes
        if (!place.isConnected) { stop(); return; }
        if (now - before >= 20) { slider.value = String(Number(slider.value) + Math.min((now - before) / 1000, 0.5)); before = now; move(); }
        if (Number(slider.value) >= end - 0.02) stop(); else playing = requestAnimationFrame(frame);
      };
      playing = requestAnimationFrame(frame);
    });
    move();
  }

  function chosen(drawing, lists) {
    if (!drawing.figures) return drawing;
    return drawing.figures[lists.map(list => list.value).join("\t")] || Object.values(drawing.figures)[0];
  }

  // Lists that choose among the figures of one place; a later list holds what there is of the earlier ones.
  function choices(element, drawing, redraw) {
    const keys = Object.keys(drawing.figures).map(key => key.split("\t"));
    const box = element.querySelector(".choices");
    const lists = drawing.labels.map(label => {
      const list = document.createElement("select");
      const outer = Object.assign(document.createElement("label"), { textContent: `${label} ` });
      outer.append(list); box.append(outer);
      return list;
    });
    const fill = from => lists.forEach((list, i) => {
      if (i < from) return;
      const fits = keys.filter(key => lists.slice(0, i).every((other, k) => other.value === key[k]));
      const before = list.value;
      list.replaceChildren(...[...new Set(fits.map(key => key[i]))].map(text => new Option(text, text, false, text === before)));
    });
    lists.forEach((list, i) => list.addEventListener("change", () => { fill(i + 1); redraw(); }));
    fill(0);
    return lists;
  }

  // Draws into a figure element; its lists are made once per drawing.
  function draw(element, drawing) {
    const place = element.querySelector(".plot");
    if (!place) return;
    load();
    for (const part of [".choices", ".cursor"]) element.querySelector(part).replaceChildren();
    let lists = [];
    const redraw = () => {
      const figure = chosen(drawing, lists);
      const built = build(figure, printing() ? 690 : place.clientWidth);
      const c = theme();
      if (figure.cursor) {
        built.traces.push(...built.dots.map(({ mark, axes }) => ({ ...axes, x: [null], y: [null], mode: "markers", type: "scatter", meta: mark.name, showlegend: false, hoverinfo: "skip",
          marker: { size: 12, color: c[mark.colour || "blue"], line: { color: c.paper, width: 2 } } })));
        built.layout.shapes.push(...built.timed.map(({ x, y }) => ({ type: "line", xref: x, yref: `${y} domain`, x0: figure.cursor[0], x1: figure.cursor[0], y0: 0, y1: 1, line: { color: c.ink, width: 1.2 } })));
      }
      place.style.height = `${built.height}px`;
      Plotly.react(place, built.traces, built.layout, { displaylogo: false, responsive: false, scrollZoom: false, doubleClick: "reset",
        displayModeBar: coarse() || narrow() ? false : "hover", modeBarButtons: BUTTONS });
      element.dataset.drawn = String(Number(element.dataset.drawn || 0) + 1);
      if (drawing.figures) element.querySelector(".note").textContent = figure.note;
      legend(element.querySelector(".legend"), figure, place);
      if (figure.cursor) cursor(element.querySelector(".cursor"), figure, place, built);
    };
    if (drawing.figures) lists = choices(element, drawing, redraw);
    drawn.set(element, redraw);
    redraw();
  }

  // Figures are drawn when they come near the window, and all of them for paper.
  const watcher = new IntersectionObserver(entries => entries.filter(e => e.isIntersecting).forEach(e => show(e.target)), { rootMargin: "400px" });
  function show(element) {
    watcher.unobserve(element);
    const drawing = drawings[element.dataset.figure];
    if (drawing && !drawn.has(element)) draw(element, drawing);
  }
  // Another figure for an element: drawn now where it can be seen, else when it comes near.
  function put(element, drawing) {
    drawings[element.dataset.figure] = drawing;
    drawn.delete(element);
    delete element.dataset.drawn;
    watcher.unobserve(element);
    if (printing()) show(element); else watcher.observe(element);
  }
  const redrawAll = () => drawn.forEach((redraw, element) => (element.isConnected ? redraw() : drawn.delete(element)));
  function print(on) {
    if (on === printing()) return;
    root.classList.toggle("printing", on);
    if (on) document.querySelectorAll("figure[data-figure]").forEach(show);
    redrawAll();
  }
  let [lastWidth, waiting] = [window.innerWidth, null];
  window.addEventListener("resize", () => {
    if (window.innerWidth === lastWidth || printing()) return;
    lastWidth = window.innerWidth;
    clearTimeout(waiting);
    waiting = setTimeout(redrawAll, 150);
  });
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redrawAll);
  window.matchMedia("print").addEventListener("change", event => print(event.matches));
  window.addEventListener("beforeprint", () => print(true));
  window.addEventListener("afterprint", () => print(false));

  async function start(id) {
    Object.assign(drawings, await inflate(id));
    document.querySelectorAll("figure[data-figure]").forEach(element => { if (drawings[element.dataset.figure]) watcher.observe(element); });
  }
  return { inflate, put, start };
})();
