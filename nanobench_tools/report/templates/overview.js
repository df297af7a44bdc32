"use strict";
// Pictures over all recordings: Task 1 error over horizon, Task 3 error by speed, clock offsets.
nanobench.overview = (() => {
  const { axis, layout, escape, short, narrow } = nanobench;
  const symbols = ["circle", "square", "diamond", "triangle-up", "x", "star", "cross", "triangle-down"];

  // A scale of less than two decades says more than its powers of ten.
  function scale(panel) {
    const values = panel.lines.flatMap(line => [...line.y, ...(line.low || []), ...(line.high || [])]).filter(v => v > 0);
    const [least, most] = [Math.min(...values), Math.max(...values)];
    if (!(Math.log10(most / least) < 1.8)) return { exponentformat: "power", dtick: 1, minor: { ticks: "outside", ticklen: 2 } };
    const decades = [-2, -1, 0, 1].map(k => Math.floor(Math.log10(least)) + 1 + k);
    const ticks = decades.flatMap(k => [1, 2, 5].map(m => Number(`${m}e${k}`)));
    return { tickvals: ticks, ticktext: ticks.map(String) };
  }

  function task1(data) {
    return (c, width) => {
      const names = [...new Set(data.panels.flatMap(panel => panel.lines.map(line => line.name)))];
      const base = [...new Set(data.panels.flatMap(panel => panel.lines.filter(l => !l.published).map(l => l.name)))];
      const palette = [c.blue, c.red, c.green, c.purple, c.orange, c.sky, c.ink, c.grey];
      const rank = name => Math.max(0, base.indexOf(name.replace(/, published$/, "")));
      const columns = width > 560 ? 2 : 1;
      const rows = Math.ceil(data.panels.length / columns);
      const height = rows * (columns === 2 ? 275 : 240);
      const traces = [];
      const out = layout(c, { margin: { l: 14, r: 14, t: 10, b: 46 } });
      data.panels.forEach((panel, i) => {
        const n = i === 0 ? "" : String(i + 1);
        const [row, column] = [Math.floor(i / columns), i % columns];
        const gap = { y: 58 / height };
        const tall = (1 - (rows - 1) * gap.y) / rows;
        const x0 = columns === 2 ? 0.07 + column * 0.5 : 0.16;
        const top = 1 - row * (tall + gap.y);
        const ticks = nanobench.few([...new Set(panel.lines.flatMap(line => line.x))].sort((a, b) => a - b));
        out["xaxis" + n] = axis(c, data.horizon || "horizon [s]", { type: "log", domain: [x0, columns === 2 ? x0 + 0.42 : 1], anchor: "y" + n,
          tickvals: ticks, ticktext: ticks.map(String), automargin: false });
        out["yaxis" + n] = axis(c, `${panel.title} [${panel.unit}]`, { type: "log", domain: [top - tall, top], anchor: "x" + n,
          ...scale(panel), automargin: false });
        for (const line of panel.lines) {
          const colour = palette[rank(line.name) % palette.length];
          traces.push({ x: line.x, y: line.y, xaxis: "x" + n, yaxis: "y" + n, name: escape(line.name), mode: "lines+markers",
            line: { color: colour, width: 2, dash: line.published ? "dot" : "solid" },
            marker: { size: 8, maxdisplayed: 8, color: colour, symbol: symbols[rank(line.name) % symbols.length] + (line.published ? "-open" : "") },
            error_y: { type: "data", symmetric: false, array: line.high.map((v, k) => (v > line.y[k] ? v - line.y[k] : null)),
              arrayminus: line.low.map((v, k) => (v < line.y[k] ? line.y[k] - v : null)), color: colour, thickness: 1.5, width: 3, visible: !line.published },
            hovertemplate: `${escape(line.name)}<br>%{x} ${data.unit || "s"}: %{y:.3g} ${panel.unit}<extra></extra>`, legendgroup: line.name });
        }
      });
      const legend = names.map(name => ({ name, colour: palette[rank(name) % palette.length], shape: "both",
        dash: name.endsWith(", published") ? "dot" : "solid", open: name.endsWith(", published"),
        traces: traces.map((t, k) => (t.legendgroup === name ? k : -1)).filter(k => k >= 0) }));
      return { traces, layout: out, legend, height };
    };
  }

  function task3(data) {
    return c => {
      const palette = [c.red, c.blue];
      const all = data.sets.flatMap(s => [...s.points.map(p => p.mm), ...s.means.flatMap(m => [m.mm, m.low || m.mm, m.high || m.mm])]);
      const range = [Math.log10(Math.min(...all)) - 0.25, Math.log10(Math.max(...all)) + 0.25];
      const tall = 380;
      const up = pixels => 10 ** (pixels * (range[1] - range[0]) / (tall - 52)); // a factor on the logarithmic axis
      const traces = [];
      const legend = [];
      data.sets.forEach((set, i) => {
        const side = i ? 1 : -1;
        const at = group => data.groups.indexOf(group) + side * 0.1;
        const spread = k => side * (0.12 + 0.22 * ((k * 0.618034) % 1));
        const first = traces.length;
        if (set.points.length) traces.push({ x: set.points.map((p, k) => at(p.group) + spread(k)), y: set.points.map(p => p.mm), mode: "markers",
          marker: { size: 7, color: palette[i], opacity: 0.6, symbol: i ? "circle" : "square" },
          text: set.points.map(p => escape(p.flight)), hovertemplate: "%{text}<br>%{y:.1f} mm<extra></extra>" });
        if (set.means.length) traces.push({ x: set.means.map(m => at(m.group)), y: set.means.map(m => m.mm), mode: "markers",
          marker: { size: 13, color: palette[i], symbol: i ? "circle-open" : "square-open", line: { width: 3, color: palette[i] } },
          error_y: { type: "data", symmetric: false, color: palette[i], thickness: 2,
            array: set.means.map(m => (m.high === null ? 0 : m.high - m.mm)),
            arrayminus: set.means.map(m => (m.low === null ? 0 : Math.min(m.mm - m.low, 0.95 * m.mm))) },
          hovertemplate: `${set.name}: mean %{y:.1f} mm<extra></extra>` },
        { x: set.means.map(m => at(m.group)), mode: "text", hoverinfo: "skip", textposition: i ? "bottom center" : "top center",
          y: set.means.map(m => (i ? Math.min((m.low || m.mm) / up(3), m.mm / up(9)) : Math.max((m.high || m.mm) * up(3), m.mm * up(9)))),
          text: set.means.map(m => `<b>${m.mm.toFixed(1)}</b>`), textfont: { color: palette[i] } });
        legend.push({ name: set.name, colour: palette[i], shape: i ? "mark" : "square",
          traces: traces.map((_, k) => k).filter(k => k >= first) });
      });
      return { traces, legend, height: tall, layout: layout(c, {
        xaxis: axis(c, "speed", { tickvals: data.groups.map((_, i) => i), ticktext: data.groups, range: [-0.55, data.groups.length - 0.45], showgrid: false }),
        yaxis: axis(c, "ATE RMSE [mm]", { type: "log", range, dtick: range[1] - range[0] < 1.8 ? "D2" : 1, exponentformat: "none", minor: { ticks: "outside", ticklen: 2 } }) }) };
    };
  }

  function clocks(data) {
    return (c, width) => {
      const names = data.rows.map(row => row.flight);
      const room = narrow() || width < 500 ? 20 : 34;
      const row = nanobench.printing() ? Math.min(15, 800 / names.length) : 15;
      return { legend: [], height: 70 + row * names.length, traces: [{
        x: data.rows.map(row => row.ms), y: names.map((_, i) => i), mode: "markers", marker: { size: 7, color: c.blue },
        error_x: { type: "data", symmetric: false, array: data.rows.map(row => row.high - row.ms),
          arrayminus: data.rows.map(row => row.ms - row.low), color: c.blue, thickness: 1.5, width: 3 },
        text: data.rows.map(row => escape(row.flight) + (row.wander === null ? "" : `<br>wander SD ${row.wander.toFixed(1)} ms`)),
        hovertemplate: "%{text}<br>%{x:.1f} ms<extra></extra>" }],
      layout: layout(c, { margin: { l: 10, r: 14, t: 30, b: 40 }, xaxis: axis(c, "clock offset [ms]", { zeroline: true, zerolinecolor: c.ink, mirror: "allticks", side: "bottom" }),
        yaxis: axis(c, "", { tickvals: names.map((_, i) => i), ticktext: names.map(n => escape(short(n, room))), range: [names.length - 0.4, -0.6],
          tickfont: { size: Math.min(10, row) }, ticks: "", fixedrange: true }) }) };
    };
  }

  // The same picture as in the section of single flights, of the flight that stands for all.
  function wander(data) {
    return nanobench.clock(nanobench.read(`data-flight-${data.index}`), `Of the flights with a confirmed moving error the longer half, and of these the one with the median wander. `);
  }

  const builders = { task1, wander, task3, blackout: data => task1({ ...data, horizon: "time since the last pose [s]" }), clocks };
  return data => [...Object.entries(builders).filter(([id]) => data[id] && !data[id].absent)
    .map(([id, builder]) => () => nanobench.draw(id, builder(data[id]))), ...nanobench.estimates(data), ...nanobench.control(data, task1)];
})();
