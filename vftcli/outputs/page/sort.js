"use strict";
// A click on a table's head sorts its rows by that column: numbers by size, health by its sign.
for (const head of document.querySelectorAll("thead th")) {
  const table = head.closest("table"), column = head.cellIndex, body = table.tBodies[0];
  const signs = "✗△–✓";
  const value = (row) => {
    const text = row.cells[column].textContent.trim();
    const sign = text.length > 1 ? signs.indexOf(text[0]) : -1;
    return [sign >= 0 ? sign : parseFloat(text.replace(/^\D+(?=\d)/, "")), text];
  };
  head.style.cursor = "pointer";
  head.tabIndex = 0;
  const sort = () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of table.querySelectorAll("thead th")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    const words = column === 0;
    const rows = [...body.rows].map((row) => [value(row), row]);
    rows.sort(([[a, s]], [[b, t]]) => {
      if (words || (isNaN(a) && isNaN(b))) return (down ? -1 : 1) * s.localeCompare(t);
      if (isNaN(a) || isNaN(b)) return isNaN(a) - isNaN(b); // what is not known comes last
      return (down ? -1 : 1) * (a - b);
    });
    for (const [, row] of rows) body.append(row);
  };
  head.addEventListener("click", sort);
  head.addEventListener("keydown", (event) => {
    if (event.key === "Enter" || event.key === " ") { event.preventDefault(); sort(); }
  });
}
