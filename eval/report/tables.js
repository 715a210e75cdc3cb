// Every table can be sorted by its heads, filtered by words, and taken along as CSV, JSON, LaTeX or Markdown.

const FORMATS = { CSV: asCsv, JSON: asJson, LaTeX: asLatex, Markdown: asMarkdown };
const ENDINGS = { CSV: "csv", JSON: "json", LaTeX: "tex", Markdown: "md" };
const MIN_ROWS = 2; // a table of one row has nothing to sort
const FILTER_ROWS = 6; // from so many rows on, words to filter by are of use

/** The heads of the columns, those of a group with the group's name before them. */
function headsOf(table) {
  const rows = [...table.tHead.rows].map((row) => [...row.cells]);
  if (rows.length === 1) return rows[0].map((cell) => ({ cell, text: textOf(cell) }));
  const below = [...rows[1]];
  return rows[0].flatMap((cell) => cell.rowSpan > 1 ? [{ cell, text: textOf(cell) }]
    : below.splice(0, cell.colSpan).map((own) => ({ cell: own, text: `${textOf(cell)}: ${textOf(own)}` })));
}

const textOf = (cell) => cell.textContent.trim().replace(/\s+/g, " ");
const contentOf = (table) => [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => [...row.cells].map(textOf));

/** A cell as a number if it begins with one ("<0.001", "1,054 frames"), else null. */
function numberIn(text) {
  const found = text.replace(/,(?=\d{3})/g, "").match(/^[<>(]?\s*(-?\d+(\.\d+)?)/);
  return found ? Number(found[1]) : null;
}

function asCsv(heads, rows) {
  const quoted = (text) => `"${(/^[=+@\t]|^-(?!\d|$)/.test(text) ? `'${text}` : text).replaceAll('"', '""')}"`; // no formula in a spreadsheet
  return [heads, ...rows].map((cells) => cells.map(quoted).join(",")).join("\r\n") + "\r\n";
}

function asJson(heads, rows) {
  return `${JSON.stringify(rows.map((cells) => Object.fromEntries(cells.map((cell, i) => [heads[i], cell]))), null, 2)}\n`;
}

function asMarkdown(heads, rows) {
  const line = (cells) => `| ${cells.map((cell) => cell.replace(/[\\|]/g, "\\$&")).join(" | ")} |`;
  return [line(heads), `|---|${"---:|".repeat(heads.length - 1)}`, ...rows.map(line)].join("\n") + "\n";
}

function asLatex(heads, rows) {
  const marks = { "\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "†": "$^\\dagger$", "–": "--", "<": "$<$", ">": "$>$" };
  const safe = (text) => text.replace(/[\\~^†–<>]|[&%$#_{}]/g, (mark) => marks[mark] || `\\${mark}`);
  const line = (cells) => `${cells.map(safe).join(" & ")} \\\\`;
  return ["\\begin{tabular}{l" + "r".repeat(heads.length - 1) + "}", "\\hline", line(heads), "\\hline", ...rows.map(line), "\\hline", "\\end{tabular}", ""].join("\n");
}

/** What the figures under a head mean, from the definitions of the same section. */
function meaningOf(table, text) {
  const section = table.closest("section"), plain = [...(section ? section.querySelectorAll(".meanings li") : [])].find((one) => one.dataset.head === text);
  if (plain) return textOf(plain);
  const name = text.replace(/ (median|p95|max)\b/, "").replace(/ \((m|[ms] driven|ms|%)\)$/, "");
  const aliases = { Error: "localization", "Error p95": "localization", "First fix": "localization", Localized: "localization", "CPU of the first fix": "localization" };
  const wanted = (aliases[name] || name).toLowerCase();
  return [...(section ? section.querySelectorAll(".definitions li") : [])].map(textOf).filter((line) => line.toLowerCase().startsWith(`${wanted} (`)).join("; ");
}

function sortable(table, heads, said) {
  heads.forEach(({ cell, text }, column) => {
    if (!text) return;
    const button = make("button", undefined, { type: "button", className: "sort" });
    button.append(...cell.childNodes);
    cell.append(button);
    button.addEventListener("click", () => {
      const down = cell.getAttribute("aria-sort") === "ascending";
      for (const other of heads) other.cell.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", down ? "descending" : "ascending");
      sortRows(table.tBodies[0], column, down ? -1 : 1);
      said.textContent = meaningOf(table, text) || `sorted by ${text}`;
    });
  });
}

/** Sort by a column; cells without a number come last, and equal ones keep their order. */
function sortRows(body, column, direction) {
  const keyed = [...body.rows].map((row) => ({ row, text: textOf(row.cells[column]), value: numberIn(textOf(row.cells[column])) }));
  const numbers = keyed.some(({ value }) => value !== null);
  const order = (a, b) => {
    if (!numbers) return direction * a.text.localeCompare(b.text);
    if (a.value === null || b.value === null) return (a.value === null) - (b.value === null);
    return direction * (a.value - b.value);
  };
  body.append(...keyed.sort(order).map(({ row }) => row));
}

/** Mark the best of the measured rows in each column of errors: the least figure, of rows that neither failed nor are quoted. */
function markBest(table, heads) {
  const rows = [...table.tBodies[0].rows].filter((row) => !row.matches(".failed, .quoted"));
  heads.forEach(({ text }, column) => {
    if (!/\((m|rad|s|ms|%)\)|^(APE|RPE|Error)/.test(text) || /Right|Localized|share|Drive|Road/i.test(text)) return;
    const figures = rows.map((row) => [row.cells[column], numberIn(textOf(row.cells[column]))]).filter(([, value]) => value !== null);
    const least = Math.min(...figures.map(([, value]) => value));
    if (figures.length > 1) for (const [cell, value] of figures) if (value === least) cell.classList.add("best");
  });
}

function tools(box, table, heads) {
  const bar = make("div", undefined, { className: "table-tools" }), name = box.getAttribute("aria-label") || "table";
  const said = make("span", undefined, { className: "said" });
  said.setAttribute("role", "status");
  if (table.tBodies[0].rows.length >= FILTER_ROWS) {
    const input = make("input", undefined, { type: "search", placeholder: "Filter rows" });
    input.setAttribute("aria-label", `Filter rows of ${name}`);
    input.addEventListener("input", () => {
      const words = input.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const row of table.tBodies[0].rows) row.hidden = !words.every((word) => textOf(row).toLowerCase().includes(word));
    });
    bar.append(input);
  }
  for (const [format, write] of Object.entries(FORMATS)) {
    const button = make("button", format, { type: "button", title: `Save this table as ${format}` });
    button.setAttribute("aria-label", `Save ${name} as ${format}`);
    button.addEventListener("click", () => {
      const text = write(heads.map((head) => head.text), contentOf(table));
      saveAs(`${fileName(name)}.${ENDINGS[format]}`, new Blob([text], { type: "text/plain;charset=utf-8" }));
      navigator.clipboard?.writeText(text).then(() => { said.textContent = `${format}: saved, and copied`; }, () => { said.textContent = `${format}: saved`; });
    });
    bar.append(button);
  }
  bar.append(said);
  box.after(bar);
  return said;
}

/** Mark a table with columns beyond its right edge, which nothing else betrays where scroll bars hide. */
function showsMore(box) {
  const look = () => box.classList.toggle("more", box.scrollLeft + box.clientWidth < box.scrollWidth - 1);
  box.addEventListener("scroll", look, { passive: true });
  new ResizeObserver(look).observe(box);
}

for (const box of document.querySelectorAll(".scroll")) {
  showsMore(box);
  const table = box.querySelector("table");
  if (!table || table.tBodies[0].rows.length < MIN_ROWS) continue;
  const heads = headsOf(table);
  if (/: (mapping|localization)$/.test(box.getAttribute("aria-label"))) markBest(table, heads);
  sortable(table, heads, tools(box, table, heads));
}
