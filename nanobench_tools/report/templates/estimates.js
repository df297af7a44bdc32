"use strict";
// Pictures of Task 3: an estimate with its three standard deviations, logs that had ended, what an error comes from.
nanobench.estimates = (() => {
  const { axis, layout, escape, short } = nanobench;

  // Points of the ellipse of three standard deviations about (x, y).
  function ellipse(x, y, sx, sy, cxy) {
    const [a, d] = [sx * sx, sy * sy];
    const mean = (a + d) / 2;
    const away = Math.hypot((a - d) / 2, cxy);
    const angle = 0.5 * Math.atan2(2 * cxy, a - d);
    const [long, wide] = [3 * Math.sqrt(Math.max(mean + away, 0)), 3 * Math.sqrt(Math.max(mean - away, 0))];
    const points = Array.from({ length: 33 }, (_, i) => [long * Math.cos((i * Math.PI) / 16), wide * Math.sin((i * Math.PI) / 16)]);
    return points.map(([u, v]) => [x + u * Math.cos(angle) - v * Math.sin(angle), y + u * Math.sin(angle) + v * Math.cos(angle)]);
  }

  const ellipses = 12;

  function band(one) {
    return (c, width) => {
      const wide = width > 620;
      const traces = [];
      const outline = { x: [], y: [] };
      const [px, py] = ["x", "y"].map(k => one.t.map((_, i) => one.truth[k][i] + one.error[k][i]));
      for (let j = 0; j < ellipses; j++) {
        const i = Math.round(((j + 1) / ellipses) * (one.t.length - 1));
        for (const [x, y] of ellipse(px[i], py[i], one.sd.x[i], one.sd.y[i], one.cxy[i])) { outline.x.push(x); outline.y.push(y); }
        outline.x.push(null); outline.y.push(null);
      }
      traces.push({ ...outline, mode: "lines", line: { color: c.sky, width: 1.5 }, hoverinfo: "skip" });
      traces.push({ x: one.truth.x, y: one.truth.y, mode: "lines", line: { color: c.mocap, width: 3 }, hoverinfo: "skip" });
      traces.push({ x: px, y: py, mode: "lines", line: { color: c.orange, width: 1.8 }, text: one.t.map(t => `${t.toFixed(1)} s`),
        hovertemplate: "%{text}: x %{x:.3f} m, y %{y:.3f} m<extra></extra>" });
      const most = Math.max(...["x", "y", "z"].flatMap(k => one.t.map((_, i) => Math.max(3 * one.sd[k][i], Math.abs(one.error[k][i])))));
      const [unit, factor] = most < 0.5 ? ["mm", 1e3] : ["m", 1];
      const at = wide ? { plan: [0.07, 0.46], tall: [0, 1], time: [0.57, 1], rows: [[0.72, 1], [0.36, 0.64], [0, 0.28]] }
        : { plan: [0.15, 1], tall: [0.57, 1], time: [0.15, 1], rows: [[0.345, 0.485], [0.1725, 0.3125], [0, 0.14]] };
      const out = layout(c, { margin: { l: 14, r: 14, t: 10, b: 46 } });
      out.xaxis = axis(c, "x [m]", { domain: at.plan, constrain: "domain", automargin: false });
      out.yaxis = axis(c, "y [m]", { domain: at.tall, scaleanchor: "x", constrain: "domain", automargin: false });
      out.xaxis2 = axis(c, "time [s]", { domain: at.time, anchor: "y4", automargin: false });
      ["x", "y", "z"].forEach((k, row) => {
        const n = row + 2;
        const limit = one.sd[k].map(s => 3 * factor * s);
        traces.push({ x: [...one.t, ...one.t.slice().reverse()], y: [...limit, ...limit.slice().reverse().map(v => -v)], xaxis: "x2", yaxis: `y${n}`,
          mode: "lines", fill: "toself", fillcolor: c.sky, opacity: 0.35, line: { width: 0 }, hoverinfo: "skip" });
        traces.push({ x: one.t, y: one.error[k].map(e => factor * e), xaxis: "x2", yaxis: `y${n}`, mode: "lines", line: { color: c.red, width: 1.4 },
          hovertemplate: `%{x:.2f} s: ${k} off by %{y:.2~f} ${unit}<extra></extra>` });
        out[`yaxis${n}`] = axis(c, `${k} [${unit}]`, { domain: at.rows[row], anchor: "x2", zeroline: true, zerolinecolor: c.grey, nticks: 5, automargin: false });
      });
      const inside = one.t.filter((_, i) => ["x", "y", "z"].every(k => Math.abs(one.error[k][i]) <= 3 * one.sd[k][i])).length;
      return { traces, layout: out, height: wide ? 430 : 780,
        legend: [{ name: "motion capture", colour: c.mocap, traces: [1] }, { name: one.name, colour: c.orange, traces: [2] },
          { name: "error", colour: c.red, traces: [4, 6, 8] }, { name: "three standard deviations", colour: c.sky, shape: "bar", traces: [0, 3, 5, 7] }],
        note: `From above, with the ellipse of three standard deviations at ${ellipses} moments, and error by axis with the band of ± 3 standard deviations that the estimator states: of this flight ${((100 * inside) / one.t.length).toFixed(0)} % of the time all three axes are inside. The flight is the one with the median error of its protocol; nanobench estimate --data FILE draws any other.` };
    };
  }

  // The picture with a choice of flight and estimator.
  function bands(data) {
    const figure = document.getElementById("fig-bands");
    if (!document.getElementById("plot-bands")) return;
    const bar = document.createElement("div");
    bar.className = "chooser player";
    bar.innerHTML = "<label>Given <select></select></label><label>Estimator <select></select></label>";
    const [given, method] = bar.querySelectorAll("select");
    data.sets.forEach((set, i) => given.add(new Option(set.name, String(i))));
    const set = () => data.sets[Number(given.value)];
    const fill = () => {
      const before = method.selectedOptions.length ? method.selectedOptions[0].textContent : "";
      method.replaceChildren(...set().methods.map((one, i) => new Option(one.name, String(i), false, one.name === before)));
    };
    const show = () => nanobench.draw("bands", (c, width) => band(set().methods[Number(method.value)])(c, width), `${given.value} ${method.value}`);
    given.addEventListener("change", () => { fill(); show(); });
    method.addEventListener("change", show);
    figure.querySelector(".legend").before(bar);
    fill();
    show();
  }

  function deadlogs(data) {
    return (c, width) => {
      const columns = width > 620 ? 2 : 1;
      const rows = Math.ceil(data.flights.length / columns);
      const each = 185;
      const height = rows * each + 40;
      const out = layout(c, { margin: { l: 14, r: 14, t: 8, b: 44 }, annotations: [] });
      const traces = [];
      const all = data.flights.flatMap(one => [...one.live, ...one.dead]).filter(v => v !== null && v > 0);
      const range = [Math.log10(Math.max(Math.min(...all), 1)) - 0.1, Math.log10(Math.max(...all)) + 0.15];
      data.flights.forEach((one, i) => {
        const n = i === 0 ? "" : String(i + 1);
        const [row, column] = [Math.floor(i / columns), i % columns];
        const gap = 62 / (height - 52);
        const tall = (1 - (rows - 1) * gap) / rows;
        const x0 = columns === 2 ? 0.075 + 0.51 * column : 0.16;
        const top = 1 - row * (tall + gap) - (24 / (height - 52));
        out["xaxis" + n] = axis(c, "time [s]", { domain: [x0, columns === 2 ? x0 + 0.41 : 1], anchor: "y" + n, automargin: false });
        out["yaxis" + n] = axis(c, "error [mm]", { type: "log", range, dtick: 1, exponentformat: "none", domain: [top - tall + (24 / (height - 52)), top], anchor: "x" + n, automargin: false });
        const said = `${one.all_mm.toFixed(0)} mm RMS` + (one.live_mm === null ? "" : `, ${one.live_mm.toFixed(0)} while the log lived`);
        out.annotations.push({ text: `${escape(short(one.name, columns === 2 ? 34 : 26))}<br>${said}`, x: x0, y: top + 2 / (height - 52), xref: "paper", yref: "paper",
          xanchor: "left", yanchor: "bottom", align: "left", showarrow: false, font: { size: 11 } });
        for (const [key, colour] of [["live", c.blue], ["dead", c.red]]) traces.push({ x: one.t, y: one[key].map(v => (v === null ? null : Math.max(v, 1))),
          xaxis: "x" + n, yaxis: "y" + n, mode: "lines", connectgaps: false, line: { color: colour, width: 1.8 }, hovertemplate: "%{x:.1f} s: %{y:.0f} mm<extra></extra>" });
      });
      const of = k => traces.map((_, i) => i).filter(i => i % 2 === k);
      return { traces, layout: out, height, legend: [{ name: "while the log lived", colour: c.blue, traces: of(0) }, { name: "rows after its last packet", colour: c.red, traces: of(1) }] };
    };
  }

  function attribution(data) {
    return (c, width) => {
      const wide = width > 620;
      const traces = [];
      const out = layout(c, { margin: { l: 14, r: 14, t: 10, b: 46 }, annotations: [] });
      const parts = [0, 1].map(part => data.bars.filter(bar => bar.part === part));
      const count = parts.map(rows => Math.max(rows.length, 1));
      const height = 44 * (count[0] + count[1]) + 150;
      const share = (1 - 70 / (height - 56)) * (count[0] / (count[0] + count[1]));
      const domains = [[1 - share, 1], [0, 1 - share - 70 / (height - 56)]];
      parts.forEach((rows, part) => {
        const n = part === 0 ? "" : "2";
        const reach = rows.flatMap(bar => [bar.low, bar.high, 0]);
        const [low, high] = [Math.min(...reach), Math.max(...reach)];
        const room = 0.16 * Math.max(high - low, 1e-6);
        traces.push({ type: "bar", orientation: "h", x: rows.map(bar => bar.mm), y: rows.map((_, i) => i), xaxis: "x" + n, yaxis: "y" + n, width: 0.42,
          marker: { color: rows.map(bar => (part === 0 ? c.blue : bar.low > 0 ? c.red : bar.high < 0 ? c.green : c.grey)) },
          error_x: { type: "data", symmetric: false, array: rows.map(bar => bar.high - bar.mm), arrayminus: rows.map(bar => bar.mm - bar.low), color: c.ink, thickness: 1.5, width: 4 },
          hovertemplate: "%{x:.2f} mm<extra></extra>" });
        rows.forEach((bar, i) => out.annotations.push({ text: `${escape(bar.name)}: <b>${bar.mm.toFixed(bar.part ? 2 : 1)}</b>`, x: 0, y: i - 0.4, xref: "x" + n + " domain", yref: "y" + n,
          xanchor: "left", showarrow: false, font: { size: wide ? 12 : 11 } }));
        out["xaxis" + n] = axis(c, part === 0 ? "ATE [mm]" : "change of the replayed filter's ATE [mm]",
          { range: [low < 0 ? low - room : 0, high + room], zeroline: true, zerolinecolor: c.grey, anchor: "y" + n, automargin: false });
        out["yaxis" + n] = axis(c, "", { domain: domains[part], range: [rows.length - 0.55, -0.75], tickvals: rows.map((_, i) => i), ticktext: rows.map(bar => escape(bar.name)), showticklabels: false, ticks: "", showgrid: false, anchor: "x" + n, fixedrange: true, automargin: false });
      });
      return { traces, layout: out, height, legend: [] };
    };
  }

  const builders = { deadlogs, attribution };
  return data => [...(data.bands && !data.bands.absent ? [() => bands(data.bands)] : []),
    ...Object.entries(builders).filter(([id]) => data[id] && !data[id].absent).map(([id, build]) => () => nanobench.draw(id, build(data[id])))];
})();
