"use strict";
// Pictures of the thrust page: the map, what it leaves over PWM and voltage, held-out files beside the firmware.
(() => {
  const { axis, layout, escape, short, read, draw } = nanobench;
  const data = read("data-thrust");
  const symbols = ["circle", "square", "diamond", "triangle-up", "x", "star", "cross", "triangle-down"];
  const palette = c => [c.blue, c.red, c.green, c.purple, c.orange, c.sky, c.ink, c.grey];
  const FEW = 8; // more files than this are told apart by split only

  // One trace per file, or one per split where there are too many files for a legend.
  function groups(points) {
    if (points.length <= FEW) return points.map(p => ({ name: `${p.file} (${p.split})`, parts: [p] }));
    return [...new Set(points.map(p => p.split))].map(split => ({ name: split === "train" ? "flights that train" : "flights held out",
      parts: points.filter(p => p.split === split) }));
  }

  function marks(part, c, x, y) {
    const colours = palette(c);
    return groups(part.points).map((group, i) => ({ mode: "markers", type: "scatter", name: escape(group.name),
      x: group.parts.flatMap(x), y: group.parts.flatMap(y), text: group.parts.flatMap(p => p.pwm.map(() => escape(p.file))),
      hovertemplate: "%{text}<br>%{x:.3f}, %{y:.4g}<extra></extra>",
      marker: { size: part.points.length > FEW ? 3 : 6, opacity: 0.6, color: colours[i % colours.length], symbol: symbols[i % symbols.length] } }));
  }

  const entries = (traces, first) => traces.map((t, i) => ({ name: t.name, colour: t.marker.color, shape: "mark", traces: [first + i] }));

  function map(part, kind) {
    return c => {
      const shades = [c.red, c.orange, c.green, c.sky, c.blue];
      const lines = part.curves.map((curve, i) => ({ x: curve.pwm, y: curve.thrust_N.map(t => 1e3 * t), mode: "lines", type: "scatter",
        line: { width: 2, color: shades[i % shades.length] }, hovertemplate: `${curve.voltage_V} V<br>PWM %{x:.3f}: %{y:.1f} mN<extra></extra>` }));
      const rows = kind === "stand" ? marks(part, c, p => p.pwm, p => p.measured.map(t => 1e3 * t)) : [];
      const legend = [...lines.map((l, i) => ({ name: `${part.curves[i].voltage_V} V`, colour: l.line.color, traces: [i] })), ...entries(rows, lines.length)];
      return { traces: [...lines, ...rows], legend, height: 400,
        layout: layout(c, { xaxis: axis(c, "PWM ratio"), yaxis: axis(c, "thrust of one motor [mN]") }) };
    };
  }

  function residual(part, key, title) {
    return c => {
      const rows = marks(part, c, p => p[key], p => p.predicted.map((v, i) => part.factor * (v - p.measured[i])));
      const known = rows.some(t => t.x.some(v => v !== null));
      if (!known) return { absent: "No battery voltage was measured." };
      const edge = part.factor * part.half_width;
      const shapes = part.half_width === null ? [] : [edge, -edge].map(y => ({ type: "line", xref: "paper", x0: 0, x1: 1, y0: y, y1: y,
        line: { color: c.grey, width: 1.5, dash: "dot" } }));
      return { traces: rows, legend: entries(rows, 0), height: 330,
        layout: layout(c, { shapes, xaxis: axis(c, title), yaxis: axis(c, `error [${part.unit}]`, { zeroline: true, zerolinecolor: c.grey }) }) };
    };
  }

  function files(part) {
    return (c, width) => {
      const sorted = [...part.pairs].sort((a, b) => b.rms - a.rms);
      const names = sorted.map(p => escape(short(p.file, width > 600 ? 34 : 16)));
      const at = sorted.map((_, i) => i);
      const traces = [["firmware", c.grey, "square"], ["rms", c.blue, "circle"]].map(([key, colour, symbol]) => ({ mode: "markers", type: "scatter",
        name: key === "rms" ? "chosen map" : "firmware", y: at, x: sorted.map(p => part.factor * p[key]),
        marker: { size: 9, color: colour, symbol }, text: names, hovertemplate: `%{text}: %{x:.3f} ${part.unit}<extra></extra>` }));
      return { traces, legend: entries(traces, 0), height: 70 + 17 * Math.max(sorted.length, 4),
        layout: layout(c, { xaxis: axis(c, `RMS [${part.unit}]`, { rangemode: "tozero" }),
          yaxis: axis(c, "", { tickvals: at, ticktext: names, range: [-0.7, sorted.length - 0.3], tickfont: { size: 10 } }) }) };
    };
  }

  for (const [kind, part] of Object.entries(data)) {
    draw(`${kind}-map`, map(part, kind));
    draw(`${kind}-pwm`, residual(part, "pwm", "PWM ratio"));
    draw(`${kind}-voltage`, residual(part, "voltage", "battery [V]"));
    if (part.pairs.length) draw(`${kind}-files`, files(part));
  }
  document.documentElement.dataset.ready = "all";
})();
