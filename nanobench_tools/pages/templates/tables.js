"use strict";
// Tables of every page: cards on a phone, and on a desk the columns that fit.
(() => {
  // On a phone a row is a card: every cell says the name of its column.
  function cards() {
    if (window.innerWidth > 600) return;
    for (const table of document.querySelectorAll("main table")) {
      table.classList.add("cards");
      const heads = [...table.querySelectorAll("thead th")].map(head => {
        const unit = head.querySelector(".unit");
        return unit ? `${head.textContent.slice(0, -unit.textContent.length)} [${unit.textContent}]` : head.textContent;
      });
      for (const row of table.tBodies[0].rows) [...row.cells].forEach((cell, i) => { if (i) cell.dataset.head = heads[i]; });
    }
  }

  // On a desk a table shows the columns that fit; a button shows the others.
  function fit(table) {
    const [box, columns] = [table.parentElement, table.tHead.rows[0].cells.length];
    const show = count => { for (const row of table.rows) [...row.cells].forEach((cell, i) => { cell.hidden = i >= count; }); };
    box.nextElementSibling?.classList.contains("more") && box.nextElementSibling.remove();
    show(columns);
    if (window.innerWidth <= 600 || !box.clientWidth || table.scrollWidth <= box.clientWidth + 1) return;
    let count = columns - 1;
    for (show(count); count > 2 && table.scrollWidth > box.clientWidth + 1; show(--count));
    const more = Object.assign(document.createElement("button"), { type: "button", className: "more", textContent: `Show ${columns - count} more column${columns - count > 1 ? "s" : ""}` });
    more.addEventListener("click", () => { show(columns); more.remove(); });
    box.after(more);
  }
  const tables = [...document.querySelectorAll("main .scroll > table")].filter(table => table.tHead);
  const refit = () => tables.forEach(fit);
  window.addEventListener("resize", refit);
  window.addEventListener("beforeprint", () => document.querySelectorAll("button.more").forEach(button => button.click()));
  document.querySelectorAll("details").forEach(part => part.addEventListener("toggle", () => part.querySelectorAll(".scroll > table").forEach(fit)));
  refit();
  nanobench.cards = cards;
  cards();
  window.addEventListener("resize", cards);
})();
