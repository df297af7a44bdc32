"use strict";
// Pictures of the motors page: one second of a rotor, the map, errors of prediction over the time ahead.
(() => {
  const { axis, layout, escape, read, draw } = nanobench;
  const data = read("data-motors");
  const line = (x, y, colour, text, dash) => ({ x, y, mode: "lines", type: "scatter", line: { width: 2, color: colour, dash: dash || "solid" },
    name: escape(text), hovertemplate: `${escape(text)}<br>%{x:.3f}: %{y:.4g}<extra></extra>` });
  const legend = traces => traces.map((t, i) => ({ name: t.name, colour: t.line.color, dash: t.line.dash, traces: [i] }));

  function example(c) {
    const e = data.example;
    const shades = [c.grey, c.blue];
    const traces = [line(e.time_s, e.measured_rad_s, c.orange, "measured"), ...Object.entries(e.simulated_rad_s).map(([name, y], i) =>
      line(e.time_s, y, shades[i % shades.length], name, i ? "dash" : "dot"))];
    return { traces, legend: legend(traces), height: 360, note: `${e.flight}, motor ${e.motor}`,
      layout: layout(c, { xaxis: axis(c, "time [s]"), yaxis: axis(c, "rotor speed [rad/s]") }) };
  }

  function map(c) {
    if (!data.curves.length) return { absent: "No map is a result." };
    const shades = [c.red, c.green, c.blue];
    const traces = data.curves.map((k, i) => line(k.pwm, k.speed_rad_s, shades[i % shades.length], `${k.voltage_V} V`));
    return { traces, legend: legend(traces), height: 340,
      layout: layout(c, { xaxis: axis(c, "PWM ratio"), yaxis: axis(c, "rotor speed [rad/s]") }) };
  }

  function ahead(key, title) {
    return c => {
      const shades = [c.grey, c.red, c.orange, c.green, c.blue, c.purple];
      const dashes = ["dot", "solid", "dash", "dashdot", "solid", "dash"];
      const traces = data.rotation.map((r, i) => line(r[key].map((_, j) => 1e3 * data.step_s * (j + 1)), r[key], shades[i % shades.length],
        r.input, dashes[i % dashes.length]));
      return { traces, legend: legend(traces), height: 360,
        layout: layout(c, { xaxis: axis(c, "time ahead [ms]"), yaxis: axis(c, title, { rangemode: "tozero" }) }) };
    };
  }

  draw("example", example);
  draw("map", map);
  if (data.rotation.length) {
    draw("rate", ahead("roll_pitch", "error [rad/s]"));
    draw("attitude", ahead("attitude", "error [rad]"));
  }
  document.documentElement.dataset.ready = "all";
})();
