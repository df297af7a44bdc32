"use strict";
// Draws the Plotly JSON of plotly_json.py: places for its panels, a legend that hides, lists to choose by, a cursor through time.
const nanobench = (() => {
  const root = document.documentElement;
  const drawings = {};
  const drawn = new Map(); // figure element -> redraw
  // Named one by one: the library's own choice has a button that sends data away.
  const BUTTONS = [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]];
  const [BETWEEN, BELOW, TITLE, EDGE, LETTER] = [58, 46, 20, 10, 9]; // px: between rows, under the last, over a panel, beside all; a bold letter at most
  const printing = () => root.classList.contains("printing");
  const narrow = () => !printing() && window.innerWidth < 700;
  const coarse = () => window.matchMedia("(pointer: coarse)").matches;

  async function inflate(id) {
    const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), character => character.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"))).json();
  }

  // The plotting library is text until the first picture is drawn: numbers and links are there before it.
  let library = null;
  function load() {
    if (library) document.head.append(Object.assign(document.createElement("script"), { textContent: library }));
    library = null;
    return Boolean(window.Plotly);
  }

  // A copy of a part of a figure with the colours of the style sheet.
  function themed(part) {
    const style = getComputedStyle(root);
    return JSON.parse(JSON.stringify(part).replace(/var\((--\w+)\)/g, (_, name) => style.getPropertyValue(name).trim()));
  }

  // What all figures have in common.
  function common(width, height) {
    const axis = { gridcolor: "var(--line)", linecolor: "var(--grey)", showline: true, tickcolor: "var(--grey)", ticks: "outside", ticklen: 4, tickfont: { size: 11 },
      automargin: false, zerolinecolor: "var(--grey)", title: { standoff: 6, font: { size: 12 } } };
    return { width, height, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", showlegend: false, barmode: "overlay",
      font: { color: "var(--ink)", size: 12, family: "system-ui, sans-serif" }, margin: { l: EDGE, r: EDGE, t: 0, b: BELOW },
      hoverlabel: { bgcolor: "var(--panel)", bordercolor: "var(--grey)", font: { color: "var(--ink)", size: 12 } }, dragmode: coarse() ? false : "zoom",
      modebar: { bgcolor: "rgba(0,0,0,0)", color: "var(--soft)", activecolor: "var(--ink)" }, template: { layout: { xaxis: axis, yaxis: axis } } };
  }

  const left = panel => (narrow() ? Math.min(panel.left, 129) : panel.left);

  // Height of the plot itself [px]; where both axes have one scale, no more than the data need.
  const tall = (panel, each) => (panel.aspect ? Math.max(110, Math.min(panel.height - 50, 1.12 * (each - left(panel)) * panel.aspect)) : panel.height - 50);

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
      row.top = top + (row.panels.some(p => p.title) ? (narrow() ? 2 : 1) * TITLE : 4);
      row.height = Math.max(...row.panels.map(p => tall(p, row.full ? width : width / columns)));
      top = row.top + row.height + BETWEEN;
    }
    return { rows, height: top - BETWEEN + BELOW };
  }

  // A title in lines of at most so many letters; a phone has room for two.
  const folded = (text, letters) => text.split(" ").reduce(([line, ...before], word) => (
    line && line.length + word.length >= letters ? [word, line, ...before] : [line ? `${line} ${word}` : word, ...before]), [""]).reverse().join("<br>");

  const numbered = k => (k ? String(k + 1) : "");

  function build(figure, width) {
    const columns = width > 620 ? 2 : 1;
    const inner = width - 2 * EDGE;
    const { rows, height } = placed(figure.panels, columns, inner);
    const upper = height - BELOW;
    const { data, layout } = themed({ data: figure.data, layout: { ...figure.layout, ...common(width, height) } });
    if (narrow()) for (const title of layout.annotations) title.text = folded(title.text, Math.floor(inner / LETTER));
    for (const row of rows) row.panels.forEach((panel, column) => {
      const n = numbered(figure.panels.indexOf(panel));
      const each = row.full ? inner : inner / columns;
      const from = column * each + left(panel);
      layout[`xaxis${n}`].domain = [from / inner, ((column + 1) * each - (row.full ? 4 : 16)) / inner];
      layout[`yaxis${n}`].domain = [1 - (row.top + row.height) / upper, 1 - row.top / upper];
      if (panel.short && narrow()) layout[`yaxis${n}`].ticktext = panel.short;
    });
    return { data, layout };
  }

  function legend(box, figure, place) {
    const of = k => place.data.filter(trace => trace.xaxis === `x${numbered(k)}`);
    const several = figure.panels.map((_, k) => of(k)).filter(traces => new Set(traces.map(trace => trace.meta)).size > 1); // a trace by itself is named by its axis
    const names = new Map(several.flat().filter(trace => trace.meta && trace.name).map(trace => [trace.meta, trace]));
    box.replaceChildren(...(names.size < 2 ? [] : [...names].map(([name, { type, mode, marker, line, visible }]) => {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: name });
      const swatch = document.createElement("i");
      swatch.style.color = marker.color;
      swatch.className = type === "bar" ? "bar" : mode === "markers" ? `points ${marker.symbol}` : line.dash;
      button.prepend(swatch);
      button.setAttribute("aria-pressed", String(visible));
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(on));
        Plotly.restyle(place, { visible: on }, place.data.map((t, k) => (t.meta === name ? k : -1)).filter(k => k >= 0));
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
  function cursor(box, figure, place, dots) {
    const [start, end] = figure.cursor;
    box.innerHTML = `<button type="button" aria-label="play">▶</button><label>Time <input type="range" min="${start}" max="${end}" step="0.02"></label><output></output>`;
    const [button, slider, output] = ["button", "input", "output"].map(tag => box.querySelector(tag));
    const first = place.data.length - dots.length;
    const units = new Map(figure.panels.flatMap((panel, k) => (panel.timed ? [[`x${numbered(k)}`, panel.unit]] : [])));
    const told = place.data.filter(trace => units.has(trace.xaxis) && trace.name && trace.type !== "bar" && trace.line.width >= 1);
    const titles = new Map(figure.panels.map((panel, k) => [`x${numbered(k)}`, (place.layout[`yaxis${numbered(k)}`]?.title?.text ?? "").replace(/ \[.*$/, "")]));
    const shares = (s, key) => told.some(other => other !== s && other[key] === s[key]);
    const label = s => (!shares(s, "meta") ? s.meta : shares(s, "xaxis") ? `${s.meta} ${titles.get(s.xaxis)}` : titles.get(s.xaxis) || s.meta);
    const lines = place.layout.shapes.length - units.size;
    let waiting = false;
    const move = () => {
      const t = Number(slider.value);
      output.textContent = [`${t.toFixed(2)} s`, ...told.map(s => [s, s.y[nearest(s.x, t)]]).filter(([, v]) => v !== null && v !== undefined).map(([s, v]) => `${label(s)} ${Number(v.toPrecision(3))} ${units.get(s.xaxis)}`.trim())].join(" · ");
      slider.setAttribute("aria-valuetext", output.textContent);
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(() => {
        waiting = false;
        const at = dots.map(trace => nearest(trace.customdata, Number(slider.value)));
        const shapes = Object.fromEntries(Array.from(units, (_, k) => [[`shapes[${lines + k}].x0`, Number(slider.value)], [`shapes[${lines + k}].x1`, Number(slider.value)]]).flat());
        if (dots.length) Plotly.update(place, Object.fromEntries(["x", "y"].map(key => [key, dots.map((trace, k) => [trace[key][at[k]]])])), shapes, dots.map((_, k) => first + k));
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
      let before = performance.now(), time = Number(slider.value);
      button.textContent = "❚❚"; button.setAttribute("aria-label", "stop");
      const frame = now => { // in the time of the flight, however long drawing takes
        if (!place.isConnected) { stop(); return; }
        if (now - before >= 20) { time += Math.min((now - before) / 1000, 0.5); slider.value = String(time); before = now; move(); }
        if (time >= end - 0.02) stop(); else playing = requestAnimationFrame(frame);
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
    if (!place || !load()) return;
    for (const part of [".choices", ".cursor"]) element.querySelector(part).replaceChildren();
    let lists = [];
    const redraw = () => {
      const figure = chosen(drawing, lists);
      const { data, layout } = build(figure, printing() ? 690 : place.clientWidth);
      const dots = data.filter(trace => trace.customdata);
      if (figure.cursor) {
        data.push(...themed(dots.map(({ xaxis, yaxis, meta, line }) => ({ xaxis, yaxis, meta, x: [null], y: [null], mode: "markers", type: "scatter", hoverinfo: "skip",
          marker: { size: 12, color: line.color, line: { color: "var(--paper)", width: 2 } } }))));
        layout.shapes.push(...themed(figure.panels.flatMap((panel, k) => (panel.timed ? [{ type: "line", xref: `x${numbered(k)}`, yref: `y${numbered(k)} domain`, x0: figure.cursor[0], x1: figure.cursor[0], y0: 0, y1: 1,
          line: { color: "var(--ink)", width: 1.2 } }] : []))));
      }
      place.style.height = `${layout.height}px`;
      Plotly.react(place, data, layout, { displaylogo: false, responsive: false, scrollZoom: false, doubleClick: "reset",
        displayModeBar: coarse() || narrow() ? false : "hover", modeBarButtons: BUTTONS });
      element.dataset.drawn = String(Number(element.dataset.drawn || 0) + 1);
      if (drawing.figures) element.querySelector(".note").textContent = figure.note;
      legend(element.querySelector(".legend"), figure, place);
      if (figure.cursor) cursor(element.querySelector(".cursor"), figure, place, dots);
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
    const [found, text] = await Promise.all([inflate(id), inflate("library")]);
    Object.assign(drawings, found);
    library = text;
    document.querySelectorAll("figure[data-figure]").forEach(element => { if (drawings[element.dataset.figure]) watcher.observe(element); });
  }
  return { inflate, put, start };
})();
