"use strict";
// Puts the page to work: sorting, choosing a recording, drawing everything in small steps so that it can be read meanwhile.
(() => {
  for (const table of document.querySelectorAll("table.sortable")) {
    table.querySelectorAll("thead th").forEach((head, column) => head.querySelector("button").addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      table.querySelectorAll("thead th").forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const value = row => row.cells[column].dataset.v ?? "";
      const order = (a, b) => {
        const [x, y] = [value(a), value(b)];
        if (x === "" || y === "") return (x === "") - (y === "");
        const numbers = Number.isFinite(Number(x)) && Number.isFinite(Number(y));
        return (up ? 1 : -1) * (numbers ? x - y : x.localeCompare(y, undefined, { numeric: true }));
      };
      table.tBodies[0].append(...[...table.tBodies[0].rows].sort(order));
    }));
  }

  let turn = 0;
  function steps(list, wanted, done) {
    const next = () => {
      if (!wanted()) return;
      const step = list.shift();
      if (!step) { done(); return; }
      step();
      setTimeout(next, 0);
    };
    next();
  }

  const chosen = document.getElementById("chosen");
  const names = chosen ? [...chosen.options].map(option => option.textContent) : [];
  const fromAddress = () => {
    const match = location.hash.match(/^#flight=(.*)$/);
    if (!match) return -1;
    try { return names.indexOf(decodeURIComponent(match[1])); } catch (error) { return -1; }
  };
  const finished = i => { document.documentElement.dataset.ready = i === null ? "none" : String(i); };

  function show(i) {
    chosen.value = String(i);
    const mine = ++turn;
    delete document.documentElement.dataset.ready;
    steps(nanobench.flight(i), () => mine === turn, () => finished(i));
  }

  function start() {
    if (!chosen) { finished(null); return; }
    const i = fromAddress();
    show(i >= 0 ? i : Number(chosen.value));
  }

  if (chosen) {
    const choose = i => {
      const wrapped = (i + names.length) % names.length;
      history.replaceState(null, "", `#flight=${encodeURIComponent(names[wrapped])}`);
      show(wrapped);
    };
    chosen.addEventListener("change", () => choose(Number(chosen.value)));
    document.getElementById("previous").addEventListener("click", () => choose(Number(chosen.value) - 1));
    document.getElementById("next").addEventListener("click", () => choose(Number(chosen.value) + 1));
    window.addEventListener("hashchange", () => {
      const i = fromAddress();
      if (i >= 0) { show(i); document.getElementById("flights").scrollIntoView(); }
    });
  }
  steps(nanobench.overview(nanobench.read("data-overview")), () => true, start);
})();
