"use strict";
// Pictures of the chosen recording.
nanobench.flight = (() => {
  const { axis, layout, escape, unpack, narrow } = nanobench;
  const timed = ["errors", "clock", "timeline", "battery", "motors"];
  const left = () => (narrow() ? 58 : 112);
  const styles = c => ({ mocap: [c.mocap, "solid"], estimator: [c.blue, "solid"], setpoint: [c.orange, "dash"] });

  function decode(paths) {
    return paths.absent ? [] : paths.series.map(s => ({ name: s.name, key: s.key, x: unpack(s.x), y: unpack(s.y), z: unpack(s.z) }));
  }

  const pathLegend = (series, c) => series.map((s, i) => ({ name: s.name, colour: styles(c)[s.key][0], dash: styles(c)[s.key][1], traces: [i] }));

  function webgl() {
    try { return Boolean(document.createElement("canvas").getContext("webgl")); } catch (error) { return false; }
  }

  function space(data, series) {
    return (c, width) => {
      if (data.paths.absent) return { absent: data.paths.absent };
      if (!webgl()) return { absent: "This browser has no WebGL for a view in space; the flat views hold the same path." };
      const scene = title => ({ title: { text: title, font: { size: 12 } }, gridcolor: c.line, zerolinecolor: c.grey, color: c.soft,
        backgroundcolor: "rgba(0,0,0,0)", showspikes: false, nticks: 6 });
      return { height: narrow() ? 340 : nanobench.printing() ? 300 : 460, legend: pathLegend(series, c),
        traces: series.map(s => ({ type: "scatter3d", mode: "lines", name: s.name, x: s.x, y: s.y, z: s.z, connectgaps: false,
          line: { color: styles(c)[s.key][0], width: s.key === "mocap" ? 5 : 3, dash: styles(c)[s.key][1] },
          hovertemplate: `${s.name}<br>x %{x:.3f} m<br>y %{y:.3f} m<br>z %{z:.3f} m<extra></extra>` })),
        layout: layout(c, { margin: { l: 0, r: 0, t: 0, b: 0 }, dragmode: "turntable", uirevision: "space",
          scene: { aspectmode: "data", xaxis: scene("x [m]"), yaxis: scene("y [m]"), zaxis: scene("z [m]"),
            camera: { eye: width < 500 ? { x: 1.4, y: -1.4, z: 0.95 } : { x: 1.2, y: -1.2, z: 0.8 }, center: { x: 0, y: 0, z: -0.12 } } } }) };
    };
  }

  function bounds(values) {
    const good = values.filter(v => v !== null);
    if (!good.length) return [0, 1];
    const [low, high] = good.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    const margin = 0.06 * Math.max(high - low, 0.2);
    return [low - margin, high + margin];
  }

  function plane(data, series) {
    return (c, width) => {
      if (data.paths.absent) return { absent: data.paths.absent };
      const [x, y, z] = ["x", "y", "z"].map(k => bounds(series.flatMap(s => s[k])));
      const size = range => range[1] - range[0];
      const inner = width - 72;
      const scale = Math.min(inner / size(x), (narrow() ? 420 : 380) / (size(y) + size(z)));
      const middle = (x[0] + x[1]) / 2;
      const wide = [middle - inner / scale / 2, middle + inner / scale / 2];
      const [tallY, tallZ, gap, edge] = [size(y) * scale, size(z) * scale, 50, 54];
      const total = tallY + tallZ + gap;
      const line = (s, v, yaxis) => ({ x: s.x, y: s[v], yaxis, mode: "lines", name: s.name, connectgaps: false, xaxis: yaxis === "y2" ? "x2" : "x",
        line: { color: styles(c)[s.key][0], width: s.key === "mocap" ? 3 : 1.7, dash: styles(c)[s.key][1] },
        hovertemplate: `${s.name}<br>x %{x:.3f} m, ${v} %{y:.3f} m<extra></extra>` });
      return { height: Math.round(total + edge), legend: series.map((s, i) => ({ name: s.name, colour: styles(c)[s.key][0], dash: styles(c)[s.key][1],
        traces: [i, i + series.length] })),
      traces: [...series.map(s => line(s, "y", "y")), ...series.map(s => line(s, "z", "y2"))],
      layout: layout(c, { margin: { l: 58, r: 14, t: 8, b: edge - 8 },
        xaxis: axis(c, "x [m]", { range: wide, anchor: "y", automargin: false }), xaxis2: axis(c, "x [m]", { range: wide, anchor: "y2", matches: "x", automargin: false }),
        yaxis: axis(c, "y [m]", { range: y, domain: [(tallZ + gap) / total, 1], scaleanchor: "x", automargin: false }),
        yaxis2: axis(c, "z [m]", { range: z, domain: [0, tallZ / total], scaleanchor: "x2", anchor: "x2", automargin: false }) }) };
    };
  }

  const pad = ([low, high], floor) => {
    const margin = 0.08 * Math.max(high - low, floor);
    return [low - margin, high + margin];
  };
  const figures = value => Number(value.toPrecision(3)).toString();
  const shade = (c, spans, yref) => spans.map(([x0, x1]) => ({ type: "rect", xref: "x", yref, x0, x1, y0: 0, y1: 1, layer: "below",
    fillcolor: c.red, opacity: 0.16, line: { width: 0 } }));

  function outside(series, frame) {
    const leaves = s => s.beyond && (!frame || s.beyond[0] < frame[0] || s.beyond[1] > frame[1]);
    const parts = series.filter(leaves).map(s => `${s.name} from ${figures(s.beyond[0])} to ${figures(s.beyond[1])} ${s.unit === "1" ? "" : s.unit}`.trim());
    return parts.length ? ` Outside the frame: ${parts.join(", ")}; a double click shows all.` : "";
  }
  const shaded = series => (series.some(s => s.cut.length) ? " Shaded: cut by the audit." : "");

  function errors(data) {
    return c => {
      if (data.errors.absent) return { absent: data.errors.absent };
      const series = data.errors.series;
      const traces = series.map((s, i) => ({ x: unpack(s.t), y: unpack(s.v), mode: "lines", name: s.name, yaxis: i ? "y2" : "y", connectgaps: false,
        line: { color: i ? c.purple : c.blue, width: 1.4 }, hovertemplate: `${s.name}<br>%{x:.2f} s: %{y:.3g} ${s.unit}<extra></extra>` }));
      const out = layout(c, { margin: { l: left(), r: 14, t: 8, b: 40 }, xaxis: axis(c, "time [s]", { range: data.span, anchor: series.length > 1 ? "y2" : "y" }),
        shapes: series.flatMap((s, i) => shade(c, s.cut, i ? "y2 domain" : "y domain")) });
      series.forEach((s, i) => {
        out[i ? "yaxis2" : "yaxis"] = axis(c, `${s.name} [${s.unit}]`, { rangemode: "tozero", range: s.range ? [0, s.range[1] * 1.1] : undefined,
          domain: series.length === 1 ? [0, 1] : i ? [0, 0.46] : [0.54, 1] });
      });
      return { traces, layout: out, height: series.length > 1 ? 380 : 240, legend: [],
        note: `Distance and angle between onboard estimate and motion capture at the same stamps; not aligned, so a late clock counts. Frame: clean rows in the air.${shaded(series)}${outside(series)}` };
    };
  }

  function overTime(part, title, settings) {
    return c => {
      if (part.absent) return { absent: part.absent };
      const palette = [c.blue, c.orange, c.green, c.purple];
      const dashes = ["solid", "dash", "dot", "dashdot"];
      const ranges = part.series.filter(s => s.range).map(s => s.range);
      const range = settings.range || (ranges.length ? pad([Math.min(...ranges.map(r => r[0])), Math.max(...ranges.map(r => r[1]))], 1e-3) : undefined);
      return { height: settings.height, note: settings.note + shaded(part.series) + outside(part.series, settings.range),
        legend: part.series.length > 1 ? part.series.map((s, i) => ({ name: s.name, colour: palette[i % 4], dash: dashes[i % 4], traces: [i] })) : [],
        traces: part.series.map((s, i) => ({ x: unpack(s.t), y: unpack(s.v), mode: "lines", name: s.name, connectgaps: false,
          line: { color: palette[i % 4], width: 1.4, dash: part.series.length > 1 ? dashes[i % 4] : "solid" },
          hovertemplate: `${s.name}<br>%{x:.2f} s: %{y:.4g}<extra></extra>` })),
        layout: layout(c, { margin: { l: left(), r: 14, t: 8, b: 40 }, xaxis: axis(c, "time [s]", { range: settings.span }), yaxis: axis(c, title, { range }),
          shapes: shade(c, part.series[0].cut, "y domain") }) };
    };
  }

  function timeline(data) {
    return c => {
      const t = data.timeline;
      if (t.absent) return { absent: t.absent };
      const names = t.rows.map(row => row.name);
      const groups = { lost: ["lost data", c.red, "/"], value: ["wrong values", c.purple, "x"], clock: ["clock", c.orange, "."],
        flight: ["vehicle or estimator", c.ink, "\\"], information: ["information", c.grey, ""] };
      const traces = [];
      const legend = [];
      const bars = (rows, name, colour, width) => {
        const all = rows.flatMap(row => row.bars.map(bar => [row.name, bar]));
        if (!all.length) return;
        legend.push({ name, colour, shape: "bar", traces: [traces.length] });
        traces.push({ type: "bar", orientation: "h", y: all.map(a => names.indexOf(a[0])), base: all.map(a => a[1][0]), x: all.map(a => a[1][1] - a[1][0]),
          width, marker: { color: colour }, hovertemplate: all.map(a => `${escape(a[0])}: ${name} ${a[1][0].toFixed(2)}–${a[1][1].toFixed(2)} s<extra></extra>`) });
      };
      bars(t.rows.filter(row => row.kind === "airborne"), "airborne", c.sky, 0.6);
      bars(t.rows.filter(row => row.kind === "clean"), "clean", c.green, 0.6);
      bars(t.rows.filter(row => row.kind === "stream"), "stream present", c.grey, 0.22);
      const brief = (t.span[1] - t.span[0]) / 150;
      for (const [group, [label, colour, pattern]] of Object.entries(groups)) {
        const mine = t.faults.filter(f => f.group === group);
        if (!mine.length) continue;
        const first = traces.length;
        const about = f => `${escape(f.kind)}, ${escape(f.row)}, ${f.start.toFixed(2)}–${f.end.toFixed(2)} s<br>${wrap(f.text)}<extra></extra>`;
        const long = mine.filter(f => f.end - f.start >= brief);
        const quick = mine.filter(f => f.end - f.start < brief);
        if (long.length) traces.push({ type: "bar", orientation: "h", y: long.map(f => names.indexOf(f.row)), base: long.map(f => f.start), x: long.map(f => f.end - f.start),
          width: 0.66, marker: { color: colour, pattern: { shape: pattern, fillmode: "overlay", fgcolor: c.paper, fgopacity: 0.55, size: 6, solidity: 0.2 } }, hovertemplate: long.map(about) });
        if (quick.length) traces.push({ type: "scatter", mode: "markers", y: quick.map(f => names.indexOf(f.row)), x: quick.map(f => (f.start + f.end) / 2),
          marker: { color: colour, size: 9, symbol: "diamond", line: { color: c.paper, width: 1 } }, hovertemplate: quick.map(about) });
        legend.push({ name: `${label}: ${[...new Set(mine.map(f => f.kind))].join(", ")}`, colour, shape: "bar",
          traces: traces.map((_, k) => k).filter(k => k >= first) });
      }
      return { traces, legend, height: 70 + 26 * names.length, note: "A diamond is a fault too short for a bar. The tables below hold every fault in words and the clock offsets with their intervals.",
        layout: layout(c, { barmode: "overlay", bargap: 0, margin: { l: narrow() ? 14 : left(), r: 14, t: 8, b: 40 }, xaxis: axis(c, "time [s]", { range: data.span }),
          yaxis: axis(c, "", { tickvals: names.map((_, i) => i), ticktext: names.map(escape), range: [names.length - 0.5, -0.5], ticks: "", fixedrange: true, showgrid: false }) }) };
    };
  }

  function wrap(text) {
    return escape(text).replace(/(.{1,56})(\s|$)/g, "$1<br>");
  }

  // Zooming one picture over time zooms the others.
  function link() {
    let busy = false;
    for (const id of timed) {
      const place = document.getElementById(`plot-${id}`);
      if (!place || !place.on || place.dataset.linked) continue;
      place.dataset.linked = "1";
      place.on("plotly_relayout", change => {
        const from = change["xaxis.range[0]"], to = change["xaxis.range[1]"];
        const range = change["xaxis.range"] || (from === undefined ? null : [from, to]);
        if (busy || (!range && !change["xaxis.autorange"])) return;
        busy = true;
        const others = timed.filter(other => other !== id).map(other => document.getElementById(`plot-${other}`)).filter(o => o && o.layout);
        Promise.all(others.map(o => Plotly.relayout(o, range ? { "xaxis.range": range } : { "xaxis.autorange": true }))).then(() => { busy = false; });
      });
    }
  }

  function rows(table, lines, numeric) {
    document.querySelector(`#${table} tbody`).replaceChildren(...lines.map(line => {
      const row = document.createElement("tr");
      line.forEach((text, i) => {
        const cell = document.createElement(i ? "td" : "th");
        if (!i) cell.scope = "row";
        else cell.className = numeric.includes(i) ? "num" : "txt";
        cell.textContent = text;
        row.append(cell);
      });
      return row;
    }));
  }

  // The drawing steps of recording number `i`.
  return i => {
    const data = nanobench.read(`data-flight-${i}`);
    const series = decode(data.paths);
    document.getElementById("facts").replaceChildren(...data.facts.map(([name, value]) => {
      const [box, dt, dd] = ["div", "dt", "dd"].map(tag => document.createElement(tag));
      dt.textContent = name; dd.textContent = value;
      box.append(dt, dd);
      return box;
    }));
    rows("flight-faults", data.faults.rows.length ? data.faults.rows : [["none", "", "", "", ""]], [3]);
    document.getElementById("faults-note").textContent = data.faults.left_out ? `${data.faults.left_out} more kinds and streams are in audit.json.` : "";
    rows("flight-streams", data.streams, [1, 2, 3, 5]);
    const steps = { space: space(data, series), plane: plane(data, series), errors: errors(data), clock: nanobench.clock(data), timeline: timeline(data),
      battery: overTime(data.battery, "battery [V]", { height: 220, span: data.span, note: "" }),
      motors: overTime(data.motors, "PWM / 65535 [1]", { height: 260, span: data.span, range: [-0.03, 1.05], note: "Share of full duty after the battery compensation." }) };
    return [...Object.entries(steps).map(([id, build]) => () => nanobench.draw(id, build, i)), link];
  };
})();
