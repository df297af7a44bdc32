"use strict";
// A flight's clock error over time, and below it the position error that a clock like this makes.
nanobench.clock = (data, chosen = "") => {
  const { axis, layout, unpack, narrow } = nanobench;
  const frame_s = 12; // a whole flight is too dense to be read; a double click shows it

  const line = (x, y, name, colour, more) => Object.assign({ x, y, name, mode: "lines", connectgaps: false,
    line: { color: colour, width: 1.6 } }, more);

  function frame() {
    if (nanobench.printing() || data.span[1] - data.span[0] <= frame_s) return data.span;
    const half = (narrow() ? 0.5 : 1) * frame_s / 2;
    const middle = (data.span[0] + data.span[1]) / 2;
    return [middle - half, middle + half];
  }

  function bounds(lists, x, [from, to], margin) {
    const inside = lists.flatMap(list => list.filter((v, i) => v !== null && x(list)[i] >= from && x(list)[i] <= to));
    if (!inside.length) return undefined;
    const [low, high] = inside.reduce(([a, b], v) => [Math.min(a, v), Math.max(b, v)], [Infinity, -Infinity]);
    return [low - margin * (high - low), high + margin * (high - low)];
  }

  return c => {
    const part = data.clock;
    if (part.absent) return { absent: part.absent };
    const t = unpack(part.t);
    const [d, low, high] = [part.d, part.low, part.high].map(unpack);
    const second = part.measured !== undefined;
    const traces = [
      line([...t, ...t.slice().reverse()], [...high, ...low.slice().reverse()], "95 % band", c.sky, { fill: "toself", fillcolor: c.sky, opacity: 0.35,
        line: { width: 0 }, hoverinfo: "skip" }),
      line(t, d, "d(t)", c.blue, { hovertemplate: "%{x:.2f} s: late by %{y:.1f} ms<extra></extra>" })];
    const legend = [{ name: "how late the stamps are, d(t)", colour: c.blue, traces: [1] }, { name: "its 95 % band", colour: c.sky, shape: "bar", traces: [0] }];
    const window_s = frame();
    const out = layout(c, { margin: { l: narrow() ? 58 : 112, r: 14, t: 8, b: 40 },
      xaxis: axis(c, "time [s]", { range: window_s, anchor: second ? "y2" : "y" }),
      yaxis: axis(c, "d(t) [ms]", { domain: second ? [0.56, 1] : [0, 1], range: bounds([low, high], () => t, window_s, 0.06), zeroline: true, zerolinecolor: c.grey }) });
    const how = value => value.toFixed(1);
    let note = chosen;
    if (second) {
      const te = unpack(part.te);
      const [measured, told] = [part.measured, part.told].map(unpack);
      traces.push(line(te, measured, "measured", c.mocap, { yaxis: "y2", hovertemplate: "%{x:.2f} s: %{y:.1f} mm behind<extra>measured</extra>" }),
        line(te, told, "told", c.orange, { yaxis: "y2", line: { color: c.orange, width: 1.8, dash: "dot" }, hovertemplate: "%{x:.2f} s: %{y:.1f} mm<extra>clock times speed</extra>" }));
      legend.push({ name: "estimate behind the vehicle, measured", colour: c.mocap, traces: [2] },
        { name: "d(t) and the estimator's own delay, times speed", colour: c.orange, dash: "dot", traces: [3] });
      out.yaxis2 = axis(c, "behind [mm]", { domain: [0, 0.46], range: bounds([measured, told], () => te, window_s, 0.06), zeroline: true, zerolinecolor: c.grey });
      note += `Above: read from gyro and accelerometer against motion capture, and from how fast the estimated position advances; where that position lies was not compared with motion capture. Below: how far it lies behind the vehicle along its track, and d(t) plus one constant, times speed. The constant, ${how(part.own_ms)} ms, is the estimator's own delay and the one number taken from the position. Error along the track, RMS: ${how(part.rms_mm)} mm; less the best constant delay (${how(part.constant_ms)} ms) ${how(part.rms_constant_mm)} mm; less d(t) and its constant ${how(part.rms_left_mm)} mm.`;
    } else if (part.apart) {
      note += "Read from gyro and accelerometer against motion capture, and from how fast the estimated position advances.";
    } else {
      note += "The audit's reading, from all streams together, the estimated position among them; so no position error is laid beside it: it would agree by construction.";
    }
    if (window_s !== data.span) note += ` Frame: the middle ${Math.round(window_s[1] - window_s[0])} s; a double click shows all.`;
    return { traces, layout: out, legend, height: second ? 470 : 260, note };
  };
};
