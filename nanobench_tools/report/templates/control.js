"use strict";
// Pictures of Task 2: one flight of every controller with a slider, error against speed, ranking, solver times.
nanobench.control = (() => {
  const { axis, layout, escape } = nanobench;
  const dashes = ["solid", "dash", "dot", "dashdot"];
  const palette = c => [c.blue, c.red, c.green, c.purple, c.orange, c.sky, c.grey, c.ink];

  // One set of flights along one reference: from above, from the side, and how far away over time; marks at time k.
  function flights(set, k) {
    return (c, width) => {
      const wide = width > 620;
      const all = palette(c);
      const goal = set.reference;
      const range = name => {
        const [low, high] = [Math.min(...goal[name]), Math.max(...goal[name])];
        const room = Math.max(0.35, 0.15 * (high - low));
        return [low - room, high + room];
      };
      const traces = [];
      const legend = [];
      const path = (line, look, mark, name) => {
        const first = traces.length;
        const end = [k];
        traces.push({ x: line.x, y: line.y, mode: "lines", line: look, hoverinfo: "skip" });
        traces.push({ x: end.map(i => line.x[i]), y: end.map(i => line.y[i]), mode: "markers", marker: mark, hovertemplate: `${escape(name)}<extra></extra>` });
        traces.push({ x: set.time_s, y: line.z, xaxis: "x3", yaxis: "y3", mode: "lines", line: look, hovertemplate: `${escape(name)}<br>%{x:.1f} s: %{y:.2f} m<extra></extra>` });
        if (line.error) traces.push({ x: set.time_s, y: line.error.map(e => Math.max(e, 1e-3)), xaxis: "x2", yaxis: "y2", mode: "lines", line: look,
          hovertemplate: `${escape(name)}<br>%{x:.1f} s: %{y:.3f} m<extra></extra>` });
        legend.push({ name, colour: look.color, dash: look.dash, traces: traces.map((_, i) => i).filter(i => i >= first) });
      };
      path(goal, { color: c.ink, width: 2, dash: "dot" }, { size: 11, color: c.ink, symbol: "cross-thin", line: { width: 2, color: c.ink } }, "reference");
      set.flights.forEach((one, i) => path(one, { color: all[i % all.length], width: 2, dash: dashes[Math.floor(i / all.length)] },
        { size: 10, color: all[i % all.length], line: { width: 1, color: c.paper } }, one.name));
      const line = { type: "line", x0: set.time_s[k], x1: set.time_s[k], y0: 0, y1: 1, line: { color: c.soft, width: 1 } };
      const margin = { l: 14, r: 14, t: 10, b: 44 };
      const out = layout(c, { margin,
        shapes: [{ ...line, xref: "x2", yref: "y2 domain" }, { ...line, xref: "x3", yref: "y3 domain" }] });
      let [tall, at] = [400, { a: [0.06, 0.45], ay: [0, 1], b: [0.56, 1], by: [0.46, 1], cy: [0, 0.32] }];
      if (!wide) { // one below the other; what is seen from above is as high as one scale makes it
        const [across, up] = ["x", "y"].map(name => range(name)[1] - range(name)[0]);
        const above = Math.min(0.86 * (width - margin.l - margin.r) * up / across, 420);
        const most = 362 + above; // heights: 122, 60 between, 130, 50 between, then the view from above
        tall = most + margin.t + margin.b;
        at = { a: [0.14, 1], ay: [362 / most, 1], b: [0.14, 1], by: [172 / most, 302 / most], cy: [0, 122 / most] };
      }
      out.xaxis = axis(c, "x [m]", { domain: at.a, range: range("x"), constrain: "domain", automargin: false });
      out.yaxis = axis(c, "y [m]", { domain: at.ay, range: range("y"), scaleanchor: "x", constrain: "domain", automargin: false });
      out.xaxis2 = axis(c, "", { domain: at.b, anchor: "y2", automargin: false });
      out.yaxis2 = axis(c, "error [m]", { domain: at.by, anchor: "x2", type: "log", range: [-3, 0.5], dtick: 1, exponentformat: "none", automargin: false });
      out.xaxis3 = axis(c, "time [s]", { domain: at.b, anchor: "y3", matches: "x2", automargin: false });
      out.yaxis3 = axis(c, "height [m]", { domain: at.cy, anchor: "x3", range: range("z"), nticks: 4, automargin: false });
      return { traces, layout: out, legend, height: tall };
    };
  }

  // The figure with a choice of sets, a slider and a button that plays it.
  function player(id, data) {
    const figure = document.getElementById(`fig-${id}`);
    const place = document.getElementById(`plot-${id}`);
    if (!place) return;
    let [which, k, playing] = [0, 0, null];
    // Drawn, as not every font has signs for both.
    const sign = stops => `<svg width="14" height="14" viewBox="0 0 14 14" fill="currentColor" aria-hidden="true"><path d="${stops ? "M2 1h4v12H2zM8 1h4v12H8z" : "M2 1l11 6-11 6z"}"/></svg>`;
    const bar = document.createElement("div");
    bar.className = "chooser player";
    bar.innerHTML = `<label>Flight <select></select></label><button type="button" aria-label="play">${sign(false)}</button>`
      + `<label>Time <output></output><input type="range" min="0" step="1"></label>`;
    const [select, button, slider, output] = ["select", "button", "input", "output"].map(name => bar.querySelector(name));
    data.sets.forEach((set, i) => select.add(new Option(set.name, String(i))));
    const hidden = () => [...figure.querySelectorAll(".legend button")].map(b => b.getAttribute("aria-pressed") === "false");
    const set = () => data.sets[which];
    const mark = () => {
      output.textContent = `${set().time_s[k].toFixed(1)} s`;
      const lines = [set().reference, ...set().flights];
      const index = [];
      let next = 0;
      lines.forEach(line => { index.push(next + 1); next += line.error ? 4 : 3; });
      if (typeof Plotly === "undefined") return;
      Plotly.update(place, { x: lines.map(line => [line.x[k]]), y: lines.map(line => [line.y[k]]) },
        Object.fromEntries([0, 1].flatMap(i => ["x0", "x1"].map(end => [`shapes[${i}].${end}`, set().time_s[k]]))), index);
    };
    const show = () => {
      slider.max = String(set().time_s.length - 1);
      k = Math.min(k, set().time_s.length - 1);
      slider.value = String(k);
      output.textContent = `${set().time_s[k].toFixed(1)} s`;
      const off = hidden();
      nanobench.draw(id, (c, width) => flights(set(), k)(c, width), which);
      figure.querySelectorAll(".legend button").forEach((b, i) => { if (off[i]) b.click(); });
    };
    const stop = () => { cancelAnimationFrame(playing); playing = null; button.innerHTML = sign(false); button.setAttribute("aria-label", "play"); };
    select.addEventListener("change", () => { stop(); which = Number(select.value); k = 0; show(); });
    slider.addEventListener("input", () => { stop(); k = Number(slider.value); mark(); });
    button.addEventListener("click", () => {
      if (playing !== null) { stop(); return; }
      const times = set().time_s;
      if (k >= times.length - 1) k = 0;
      button.innerHTML = sign(true); button.setAttribute("aria-label", "stop");
      let [time, before] = [times[k], performance.now()];
      const frame = now => { // in the time of the flight, however long drawing takes; a page that was hidden goes on where it was
        time += Math.min(Math.max(now - before, 0) / 1000, 0.5);
        before = now;
        const last = k;
        while (k < times.length - 1 && times[k + 1] <= time) k += 1;
        if (k !== last) { slider.value = String(k); mark(); }
        if (k >= times.length - 1) stop(); else playing = requestAnimationFrame(frame);
      };
      playing = requestAnimationFrame(frame);
    });
    figure.querySelector(".legend").before(bar);
    k = Math.floor(set().time_s.length / 3);
    show();
  }

  function ranking(data) {
    return (c, width) => {
      const names = data.rows.map(row => row.name);
      const ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 5000].filter((_, i) => width > 500 || i % 3 === 0);
      const least = Math.min(...data.rows.map(row => row.cm)) / 1.6;
      const most = Math.max(...data.rows.map(row => Math.max(row.worst, row.cm))) * 1.9;
      return { height: 70 + 34 * names.length,
        legend: [{ name: "median over references", colour: c.blue, shape: "mark", traces: [0] },
          { name: "largest worst decile", colour: c.red, shape: "square", traces: [1] }],
        traces: [{ x: data.rows.map(row => row.cm), y: names.map((_, i) => i), mode: "markers+text", marker: { size: 11, color: c.blue },
          error_x: { type: "data", array: data.rows.map(row => row.off), color: c.blue, thickness: 2, width: 5, visible: data.bar },
          text: data.rows.map(row => row.cm.toPrecision(2)), textposition: "top center", textfont: { size: 11, color: c.blue },
          customdata: data.rows.map(row => row.lost), hovertemplate: "%{x:.2f} cm, %{customdata:.0f} % lost<extra></extra>" },
        { x: data.rows.map(row => row.worst), y: names.map((_, i) => i), mode: "markers", marker: { size: 9, color: c.red, symbol: "square-open", line: { width: 2, color: c.red } },
          hovertemplate: "%{x:.1f} cm<extra></extra>" }],
        layout: layout(c, { margin: { l: 10, r: 14, t: 14, b: 44 },
          xaxis: axis(c, "RMSE [cm]", { type: "log", range: [Math.log10(least), Math.log10(most)], tickvals: ticks, ticktext: ticks.map(String) }),
          yaxis: axis(c, "", { tickvals: names.map((_, i) => i), ticktext: names.map(escape), range: [names.length - 0.4, -0.7], ticks: "", fixedrange: true }) }) };
    };
  }

  function solver(data) {
    return (c, width) => {
      const all = palette(c);
      const ticks = [0.001, 0.01, 0.1, 1, 10, 100];
      return { height: 320,
        legend: data.lines.map((line, i) => ({ name: line.name, colour: all[i % all.length], dash: dashes[Math.floor(i / all.length) % dashes.length], traces: [i] })),
        traces: data.lines.map((line, i) => ({ x: line.ms, y: line.percent, mode: "lines", line: { color: all[i % all.length], width: 2, shape: "hvh", dash: dashes[Math.floor(i / all.length) % dashes.length] },
          hovertemplate: `${escape(line.name)}<br>%{x:.3g} ms: %{y:.1f} %<extra></extra>` })),
        layout: layout(c, { margin: { l: 14, r: 14, t: 10, b: 44 },
          xaxis: axis(c, "time of a command [ms]", { type: "log", tickvals: ticks, ticktext: ticks.map(String) }),
          yaxis: axis(c, "share [%]", { rangemode: "tozero" }) }) };
    };
  }

  return (data, lines) => [
    ...["gateflights", "race"].filter(id => data[id] && !data[id].absent).map(id => () => player(id, data[id])),
    ...(data.speeds && !data.speeds.absent ? [() => nanobench.draw("speeds", lines({ ...data.speeds, horizon: "speed [m/s]", unit: "m/s" }))] : []),
    ...(data.ranking && !data.ranking.absent ? [() => nanobench.draw("ranking", ranking(data.ranking))] : []),
    ...(data.solver && !data.solver.absent ? [() => nanobench.draw("solver", solver(data.solver))] : [])];
})();
