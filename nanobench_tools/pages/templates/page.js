"use strict";
// Puts the report to work: sorting, the flight that was chosen.
(() => {
  for (const table of document.querySelectorAll("table.sortable")) {
    table.querySelectorAll("thead th").forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      table.querySelectorAll("thead th").forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const value = row => row.cells[column].dataset.v ?? row.cells[column].textContent;
      const order = (a, b) => {
        const [x, y] = [value(a), value(b)];
        if (x === "" || y === "") return (x === "") - (y === "");
        const numbers = Number.isFinite(Number(x)) && Number.isFinite(Number(y));
        return (up ? 1 : -1) * (numbers ? x - y : x.localeCompare(y, undefined, { numeric: true }));
      };
      table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
    }));
  }

  const $ = id => document.getElementById(id);
  const chosen = $("chosen");
  const names = chosen ? [...chosen.options].map(option => option.textContent) : [];
  const fromAddress = () => {
    const match = location.hash.match(/^#flight=(.*)$/);
    try { return match ? names.indexOf(decodeURIComponent(match[1])) : -1; } catch (error) { return -1; }
  };

  function fill(id, lines, numeric) {
    document.querySelector(`#${id} tbody`).replaceChildren(...lines.map(line => {
      const row = document.createElement("tr");
      row.append(...line.map((text, i) => Object.assign(document.createElement(i ? "td" : "th"),
        { textContent: text, className: numeric.includes(i) ? "num" : "txt" })));
      return row;
    }));
  }

  let turn = 0;
  async function show(i) {
    const mine = ++turn;
    delete document.documentElement.dataset.ready;
    chosen.value = String(i);
    const data = await nanobench.inflate(`data-flight-${i}`);
    if (mine !== turn) return;
    $("flight-name").textContent = data.name;
    const state = Object.assign(document.createElement("i"), { className: `state ${data.severity}`, textContent: data.severity });
    $("flight-verdict").replaceChildren(...(data.severity ? [state, ` ${data.verdict}${data.advice ? `; ${data.advice}` : ""}`] : ["Not audited."]));
    $("facts").replaceChildren(...data.facts.map(([name, value]) => {
      const [box, dt, dd] = ["div", "dt", "dd"].map(tag => document.createElement(tag));
      [dt.textContent, dd.textContent] = [name, value];
      box.append(dt, dd);
      return box;
    }));
    fill("flight-events", data.events.rows.length ? data.events.rows : [["nothing", "", "", ""]], []);
    $("events-note").textContent = data.events.left_out ? `${data.events.left_out} more are in audit.json.` : "";
    fill("flight-streams", data.streams, [1, 2, 3, 5]);
    const figure = $("fig-flight");
    figure.querySelector(".note").textContent = data.figure.note;
    nanobench.put(figure, data.figure);
    nanobench.cards();
    document.documentElement.dataset.ready = String(i);
  }

  if (chosen) {
    const choose = i => {
      const wrapped = (i + names.length) % names.length;
      history.replaceState(null, "", `#flight=${encodeURIComponent(names[wrapped])}`);
      show(wrapped);
    };
    chosen.addEventListener("change", () => choose(Number(chosen.value)));
    $("previous").addEventListener("click", () => choose(Number(chosen.value) - 1));
    $("next").addEventListener("click", () => choose(Number(chosen.value) + 1));
    window.addEventListener("hashchange", () => {
      const i = fromAddress();
      if (i < 0) return;
      show(i).then(() => { $("flight-name").scrollIntoView(); $("flight-name").focus({ preventScroll: true }); });
    });
  }
  nanobench.start("data-drawings").then(() => {
    if (!chosen) { document.documentElement.dataset.ready = "none"; return; }
    const i = fromAddress();
    show(i >= 0 ? i : Number(chosen.value));
  });
})();
