"use strict";
// Pictures of the page of a diagnosis.
(() => {
  const { axis, layout, escape, short, read, draw, unpack, narrow } = nanobench;
  const data = read("data-mismatch");
  const sides = data.named ? ["simulator as given", "corrected"] : ["simulator as given"];
  const shades = c => [c.orange, c.blue];
  const zero = c => ({ zeroline: true, zerolinecolor: c.grey, zerolinewidth: 1.5 });
  const force = i => i < 3;
  const unit = i => (force(i) ? "m/s²" : "rad/s²");
  const rows = names => ({ tickvals: names.map((_, i) => i), ticktext: names.map(n => escape(n)), range: [names.length - 0.4, -0.6], tickfont: { size: 11 } });
  const shortened = (names, width) => names.map(n => short(n, width > 600 ? 40 : 18));

  function whole(c) {
    const palette = [c.blue, c.green, c.purple, c.orange, c.sky];
    const traces = data.whole.map((part, i) => ({ type: "bar", orientation: "h", y: [0], x: [100 * part.share], name: part.name,
      marker: { color: i === data.whole.length - 1 ? c.line : i === data.whole.length - 2 ? c.grey : palette[i % palette.length] },
      hovertemplate: `${escape(part.name)}: %{x:.1f} %<extra></extra>` }));
    return { traces, height: 110, legend: data.whole.map((part, i) => ({ name: `${part.name} ${(100 * part.share).toFixed(0)} %`, colour: traces[i].marker.color,
      shape: "bar", traces: [i] })),
    layout: layout(c, { barmode: "stack", margin: { l: 14, r: 14, t: 4, b: 44 }, xaxis: axis(c, "of what signals predict of the residual [%]", { range: [0, 100] }),
      yaxis: axis(c, "", { visible: false, tickvals: [0], ticktext: [""] }) }) };
  }

  // Lines from a to b at height y, as one trace.
  const bars = (list, y) => ({ x: list.flatMap(([a, b]) => [a, b, null]), y: list.flatMap(() => [y, y, null]) });

  function spans(c, width) {
    if (!data.spans.length) return { absent: "There is no flight to show." };
    const all = key => data.spans.map((s, i) => bars(s[key], i)).reduce((p, q) => ({ x: [...p.x, ...q.x], y: [...p.y, ...q.y] }), { x: [], y: [] });
    const line = (key, colour, wide) => ({ ...all(key), type: "scatter", mode: "lines", line: { color: colour, width: wide }, hoverinfo: "skip" });
    const faults = data.spans.flatMap((s, i) => s.faults.map(([a, b, text]) => [(a + b) / 2, i - 0.28, `${text}<br>${a.toFixed(1)} to ${b.toFixed(1)} s`]));
    const traces = [line("airborne", c.grey, 3), line("judged", c.green, 9),
      { type: "scatter", mode: "markers", x: faults.map(f => f[0]), y: faults.map(f => f[1]), text: faults.map(f => escape(f[2]).replace("&lt;br&gt;", "<br>")),
        hovertemplate: "%{text}<extra></extra>", marker: { size: 7, symbol: "triangle-down", color: c.orange } }];
    return { traces, height: 80 + 26 * data.spans.length, legend: [{ name: "in the air", colour: c.grey, traces: [0] }, { name: "judged", colour: c.green, traces: [1] },
      { name: "fault (its middle)", colour: c.orange, shape: "mark", traces: [2] }],
    layout: layout(c, { xaxis: axis(c, "time of the recording [s]"), yaxis: axis(c, "", rows(shortened(data.spans.map(s => s.name), width))) }) };
  }

  function rms(from) {
    return c => {
      const keys = [["before", sides[0], c.orange], ...(data.named ? [["after", "corrected", c.blue]] : []), ["floor", "a right simulator", c.green]];
      const names = data.channels.slice(from, from + 3);
      const traces = keys.map(([key, name, colour]) => ({ type: "bar", orientation: "h", name, y: names.map((_, i) => i), x: data.rms[key].slice(from, from + 3),
        marker: { color: colour }, hovertemplate: `${name}: %{x:.3g} ${unit(from)}<extra></extra>` }));
      return { traces, height: 90 + 24 * 3 * keys.length / 2, legend: traces.map((t, i) => ({ name: t.name, colour: t.marker.color, shape: "bar", traces: [i] })),
        layout: layout(c, { barmode: "group", bargap: 0.3, xaxis: axis(c, `RMS [${unit(from)}]`, { rangemode: "tozero" }), yaxis: axis(c, "", rows(names)) }) };
    };
  }

  function timeline(flight, channel) {
    return c => {
      const part = data.timeline[flight][channel];
      if (!part.sides) return { absent: "Nothing of this flight was judged in this channel." };
      const traces = part.sides.map((packed, i) => {
        const y = unpack(packed);
        return { type: "scatter", mode: "lines", name: sides[i], x: y.map((_, k) => part.start_s + part.step_s * (k + 0.5)), y, connectgaps: false,
          line: { color: shades(c)[i], width: 2 }, hovertemplate: `%{x:.1f} s: %{y:.3f} ${unit(channel)}<extra></extra>` };
      });
      return { traces, height: 320, legend: traces.map((t, i) => ({ name: t.name, colour: t.line.color, traces: [i] })),
        layout: layout(c, { xaxis: axis(c, "time of the recording [s]"), yaxis: axis(c, `${data.channels[channel]} [${unit(channel)}]`, zero(c)) }) };
    };
  }

  function share(key) {
    return (c, width) => {
      const cells = data.share[key].map(row => row.slice(0, data.channels.length));
      if (!cells.length) return { absent: "The residual goes with no signal." };
      const top = Math.max(...data.share.before.flat(), 20);
      const names = width < 500 ? data.channels.map(n => n.replace("force ", "F").replace("torque ", "T")) : data.channels;
      const text = cells.map(row => row.map(v => (v >= 0.95 ? v.toFixed(0) : v >= 0.1 ? v.toFixed(1) : "")));
      return { height: 70 + 30 * cells.length, legend: [],
        traces: [{ type: "heatmap", z: cells, x: names.map((_, i) => i), y: cells.map((_, i) => i), text, texttemplate: "%{text}", zmin: 0, zmax: top,
          colorscale: [[0, c.paper], [1, c.blue]], showscale: false, xgap: 2, ygap: 2,
          customdata: cells.map((row, i) => row.map((_, j) => `${data.channels[j]}, ${data.share.groups[i]}`)), hovertemplate: "%{customdata}: %{z:.2f} %<extra></extra>" }],
        layout: layout(c, { margin: { l: 84, r: 8, t: 4, b: 30 }, xaxis: axis(c, "", { tickvals: names.map((_, i) => i), ticktext: names, showgrid: false, ticks: "" }),
          yaxis: axis(c, "", { ...rows(data.share.groups.map(g => (g === "hypothesis" ? "shape of a term" : g))), range: [cells.length - 0.5, -0.5], showgrid: false, ticks: "" }) }) };
    };
  }

  function covariate(k) {
    return c => {
      const traces = k.sides.map((side, i) => ({ type: "scatter", mode: "lines+markers", name: sides[i], x: k.x, y: side.mean,
        error_y: { type: "data", array: side.half, color: shades(c)[i], thickness: 1.5, width: 3 }, line: { color: shades(c)[i], width: 1.5 },
        marker: { size: 7, symbol: i ? "square" : "circle", color: shades(c)[i] }, hovertemplate: "%{x:.3g}: %{y:.3g} ± %{error_y.array:.2g}<extra></extra>" }));
      return { traces, height: 290, legend: traces.map((t, i) => ({ name: t.name, colour: t.line.color, shape: "line", traces: [i] })),
        layout: layout(c, { xaxis: axis(c, `${k.covariate} [${k.axis}]`), yaxis: axis(c, `${k.channel} [${k.unit}]`, zero(c)) }) };
    };
  }

  // Both axes of a map of the room have one scale, whatever the width of the page.
  function ground(c, width) {
    const reach = v => [Math.min(...v) - data.room.cell_m, Math.max(...v) + data.room.cell_m];
    const all = data.room.maps[data.room.maps.length - 1];
    const [x, y] = [reach(all.x), reach(all.y)];
    const height = Math.min(Math.max((width - 80) * (y[1] - y[0]) / (x[1] - x[0]), 200), 460) + 60;
    return { height, layout: layout(c, { xaxis: axis(c, "x [m]", { range: x, constrain: "domain" }),
      yaxis: axis(c, "y [m]", { range: y, scaleanchor: "x", constrain: "domain" }) }) };
  }

  const vector = m => `x ${m[0].toFixed(3)}, y ${m[1].toFixed(3)}, z ${m[2].toFixed(3)} m/s²`;
  const longest = pick => Math.max(1e-9, ...data.room.maps.flatMap(map => map.sides[0].mean.map(pick)));

  function room(flight, side) {
    return (c, width) => {
      const map = data.room.maps[flight];
      if (!map.x.length) return { absent: "Nothing of this flight was judged." };
      const part = map.sides[Math.min(side, map.sides.length - 1)];
      const top = longest(m => Math.hypot(m[0], m[1]));
      const scale = 1.5 * data.room.cell_m / top;
      const at = map.x.map((_, i) => i);
      const arrows = told => {
        const mine = at.filter(i => part.told[0][i] === told);
        return { type: "scatter", mode: "lines+markers", x: mine.flatMap(i => [map.x[i], map.x[i] + scale * part.mean[i][0], null]),
          y: mine.flatMap(i => [map.y[i], map.y[i] + scale * part.mean[i][1], null]), text: mine.flatMap(i => [vector(part.mean[i]), vector(part.mean[i]), ""]),
          hovertemplate: "%{text}<extra></extra>", line: { width: told ? 2 : 1, color: told ? shades(c)[side] : c.grey },
          marker: { opacity: 1, size: mine.flatMap(() => [3, told ? 10 : 7, 0]), symbol: mine.flatMap(() => ["circle", "arrow", "circle"]), angleref: "previous",
            color: told ? shades(c)[side] : c.grey } };
      };
      const traces = [arrows(true), arrows(false)];
      return { traces, ...ground(c, width), legend: [{ name: "told from zero", colour: shades(c)[side], traces: [0] }, { name: "not", colour: c.grey, traces: [1] }],
        note: `Mean force of each cell, in the world; an arrow as long as ${(1.5 * data.room.cell_m).toFixed(2)} m of the map is ${top.toPrecision(2)} m/s². Arrows that all point one way are a wind or a tilted frame, arrows around one spot a force of that place. One cell in twenty is coloured by chance.` };
    };
  }

  function roomUp(flight, side) {
    return (c, width) => {
      const map = data.room.maps[flight];
      if (!map.x.length) return { absent: "Nothing of this flight was judged." };
      const part = map.sides[Math.min(side, map.sides.length - 1)];
      const top = longest(m => Math.abs(m[2]));
      const group = (keep, colour, symbol) => {
        const mine = map.x.map((_, i) => i).filter(keep);
        return { type: "scatter", mode: "markers", x: mine.map(i => map.x[i]), y: mine.map(i => map.y[i]), text: mine.map(i => vector(part.mean[i])),
          hovertemplate: "%{text}<extra></extra>", marker: { opacity: 1, color: colour, symbol, size: mine.map(i => 5 + 17 * Math.sqrt(Math.abs(part.mean[i][2]) / top)) } };
      };
      const told = i => part.told[1][i];
      const traces = [group(i => told(i) && part.mean[i][2] > 0, c.blue, "triangle-up"), group(i => told(i) && part.mean[i][2] < 0, c.red, "triangle-down"),
        group(i => !told(i), c.grey, "circle-open")];
      return { traces, ...ground(c, width), legend: ["up", "down", "not told from zero"].map((name, i) => ({ name, colour: traces[i].marker.color, shape: "mark", open: i === 2, traces: [i] })),
        note: `Area stands for size; the largest is ${top.toPrecision(2)} m/s² with the simulator as given.` };
    };
  }

  // One row a flight: before, after, and the way between.
  function pairs(names, before, after, title, c, width) {
    const at = names.map((_, i) => i);
    const marks = [[before, c.orange, "circle"], ...(data.named ? [[after, c.blue, "square"]] : [])].map(([x, colour, symbol], i) => ({ type: "scatter", mode: "markers",
      name: sides[i], x, y: at, marker: { size: 9, color: colour, symbol }, hovertemplate: "%{x:.4g}<extra></extra>" }));
    const way = { type: "scatter", mode: "lines", x: at.flatMap(i => [before[i], after[i], null]), y: at.flatMap(i => [i, i, null]), line: { color: c.grey, width: 2 }, hoverinfo: "skip" };
    return { traces: [way, ...marks], height: 80 + 24 * names.length, legend: marks.map((m, i) => ({ name: m.name, colour: m.marker.color, shape: "mark", traces: [i + 1] })),
      layout: layout(c, { xaxis: axis(c, title, { rangemode: "tozero" }), yaxis: axis(c, "", rows(shortened(names, width))) }) };
  }

  const byFlight = (c, width) => pairs(data.flights, data.by_flight.before, data.by_flight.after, "RMS of the force residual [m/s²]", c, width);

  function scores(c) {
    const all = data.scores.rows.filter(r => r.gain > 1);
    if (!all.length) return { absent: "No hypothesis takes anything away." };
    const fates = [["named", "named", c.blue], ["equivalent", "cannot be told from it", c.sky], ["withdrawn", "withdrawn", c.red], ["rejected", "rejected", c.orange],
      ["explained", "nothing left beside the named", c.purple], ["small", "too little", c.grey]].filter(([key]) => all.some(r => r.fate === key));
    const traces = fates.map(([key, name, colour]) => {
      const mine = all.map((r, i) => [r, i]).filter(([r]) => r.fate === key);
      return { type: "bar", orientation: "h", name, y: mine.map(([, i]) => i), x: mine.map(([r]) => r.gain), marker: { color: colour }, hovertemplate: `${name}: %{x:.0f}<extra></extra>` };
    });
    const least = Math.log10(data.scores.least);
    return { traces, height: 80 + 24 * all.length, legend: traces.map((t, i) => ({ name: t.name, colour: t.marker.color, shape: "bar", traces: [i] })),
      layout: layout(c, { barmode: "overlay", bargap: 0.25, yaxis: axis(c, "", rows(all.map(r => r.term))),
        xaxis: axis(c, "takes away [sd²]", { type: "log", dtick: 1, range: [0, Math.log10(Math.max(all[0].gain, data.scores.least)) * 1.04] }),
        shapes: [{ type: "line", yref: "paper", y0: 0, y1: 1, x0: data.scores.least, x1: data.scores.least, line: { color: c.ink, width: 1.5, dash: "dot" } }] }) };
  }

  function intervals(c) {
    const list = data.intervals;
    if (!list.length) return { absent: "No parameter differs from the simulator's." };
    const traces = [{ type: "scatter", mode: "markers", x: list.map(() => 0), y: list.map((_, i) => i), text: list.map(p => `${p.believed.toPrecision(4)} ${escape(p.unit)}`),
      hovertemplate: "simulator: %{text}<extra></extra>", marker: { size: 10, symbol: "x", color: c.orange } },
    { type: "scatter", mode: "markers", x: list.map(() => 1), y: list.map((_, i) => i), text: list.map(p => `${p.value.toPrecision(4)} ${escape(p.unit)}`),
      error_x: { type: "data", symmetric: false, array: list.map(p => p.ends[1] - 1), arrayminus: list.map(p => 1 - p.ends[0]), color: c.blue, thickness: 2, width: 5 },
      hovertemplate: "flights: %{text}<extra></extra>", marker: { size: 9, color: c.blue } }];
    return { traces, height: 90 + 28 * list.length, legend: [{ name: "simulator", colour: c.orange, shape: "mark", traces: [0] }, { name: "flights, 95 %", colour: c.blue, shape: "mark", traces: [1] }],
      layout: layout(c, { xaxis: axis(c, "share of the way [1]", zero(c)), yaxis: axis(c, "", rows(list.map(p => p.name))) }) };
  }

  function errors(quantity, step) {
    return (c, width) => {
      const e = data.errors;
      const units = ["m", "m/s", "rad", "rad/s"];
      const names = ["position", "velocity", "attitude", "rate"];
      const picture = pairs(e.flights, e.before[step][quantity], e.after[step][quantity], `error of ${names[quantity]} [${units[quantity]}]`, c, width);
      return { ...picture, note: "Mean over windows of each flight; the further left, the better." + (data.named && e.held_out ? " Each flight is predicted by a fit without it." : "") };
    };
  }

  const chosen = id => Number((document.getElementById(id) || { value: 0 }).value);
  function on(ids, action) {
    for (const id of ids) {
      const element = document.getElementById(id);
      if (element) element.addEventListener("change", action);
    }
    action();
  }

  draw("spans", spans);
  if (data.flights) {
    draw("whole", whole);
    draw("rms-force", rms(0));
    if (data.channels.length > 3) draw("rms-torque", rms(3));
    on(["time-flight", "time-channel"], () => draw("timeline", timeline(chosen("time-flight"), chosen("time-channel"))));
    draw("share", share("before"));
    draw("share-after", share("after"));
    data.covariates.forEach((k, i) => draw(`covariate-${i}`, covariate(k)));
    on(["room-flight", "room-side"], () => {
      draw("room", room(chosen("room-flight"), chosen("room-side")));
      draw("room-up", roomUp(chosen("room-flight"), chosen("room-side")));
    });
    draw("by-flight", byFlight);
    draw("scores", scores);
    draw("intervals", intervals);
    on(["error-quantity", "error-step"], () => draw("errors", errors(chosen("error-quantity"), chosen("error-step"))));
  }
  document.documentElement.dataset.ready = "all";
})();
