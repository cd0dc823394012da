// The rows of a batch: sorted by a click on a column's name, filtered by words and by status. A few
// hundred are on the page at a time, more as one asks for them.
(() => {
  const { columns, rows } = JSON.parse(document.getElementById("data").textContent);
  const head = document.querySelector("thead tr"), body = document.querySelector("tbody");
  const search = document.querySelector("input"), said = document.querySelector("output");
  const more = document.querySelector(".more button"), chosen = new Set(), step = 200;
  const status = columns.indexOf("status") + 1, message = columns.indexOf("message") + 1;
  const isNumber = columns.map((_, k) => rows.some((row) => Array.isArray(row[k + 1])));
  const pictured = rows.some((row) => row[0][1]);
  const text = (cell) => Array.isArray(cell) ? cell[0] : cell;
  const words = rows.map((row) => row.slice(1).map(text).join(" ").toLowerCase());
  const tones = {};
  let order = rows.map((_, k) => k), found = order, shown = 0, by = null, down = false;

  function element(name, content, className) {
    const made = document.createElement(name);
    if (className) made.className = className;
    if (content !== undefined) made.append(content);
    return made;
  }

  function line(row) {
    const made = element("tr"), [page, picture] = row[0];
    if (pictured) {
      const cell = element("td", undefined, "picture");
      if (picture) {
        const image = element("img"), link = element("a", image);
        image.src = picture; image.loading = "lazy"; image.alt = "Frequencies of " + text(row[1]);
        link.href = page || picture;
        cell.append(link);
      }
      made.append(cell);
    }
    row.slice(1).forEach((cell, k) => {
      const at = k + 1, content = text(cell);
      const kind = isNumber[k] ? "number" : at === status ? tones[content] : at === message ? "message" : k === 0 ? "case" : "";
      const shown = k === 0 ? undefined : at === message ? element("div", content) : content;
      const into = element("td", shown, kind);
      if (k === 0) {
        const name = element(page ? "a" : "span");
        content.split(/(?<=[,;])/).forEach((part) => name.append(part, element("wbr")));
        if (page) name.href = page;
        into.append(name);
      }
      made.append(into);
    });
    return made;
  }

  function extend() {
    body.append(...found.slice(shown, shown + step).map((k) => line(rows[k])));
    shown = Math.min(shown + step, found.length);
    more.hidden = shown === found.length;
    said.textContent = found.length === rows.length ? "" : found.length + " of " + rows.length;
  }

  function show() {
    const wanted = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    found = order.filter((k) => (!chosen.size || chosen.has(rows[k][status])) && wanted.every((w) => words[k].includes(w)));
    body.replaceChildren();
    shown = 0;
    extend();
  }

  // Numbers by size, words by the alphabet with the numbers in them by size; what is empty comes last.
  const compare = new Intl.Collator("en", { numeric: true }).compare;
  function sort(k) {
    down = by === k && !down;
    by = k;
    const key = (row) => Array.isArray(row[k + 1]) ? row[k + 1][1] : isNumber[k] ? null : row[k + 1] || null;
    const keys = rows.map(key), sign = down ? -1 : 1;
    order.sort((a, b) => {
      const x = keys[a], y = keys[b];
      if (x === null || y === null) return (x === null) - (y === null) || a - b;
      return sign * (typeof x === "number" ? x - y : compare(x, y)) || a - b;
    });
    [...head.querySelectorAll("th[data-column]")].forEach((cell, i) => {
      if (i === k) cell.setAttribute("aria-sort", down ? "descending" : "ascending");
      else cell.removeAttribute("aria-sort");
    });
    show();
  }

  if (pictured) head.append(element("th"));
  columns.forEach((name, k) => {
    const button = element("button", name), cell = element("th", button, isNumber[k] ? "number" : "");
    button.type = "button"; cell.scope = "col"; cell.dataset.column = name;
    button.addEventListener("click", () => sort(k));
    head.append(cell);
  });
  document.querySelectorAll("[data-status]").forEach((button) => {
    tones[button.dataset.status] = button.querySelector("strong").className;
    button.addEventListener("click", () => {
      const name = button.dataset.status, on = !chosen.has(name);
      if (on) chosen.add(name); else chosen.delete(name);
      button.setAttribute("aria-pressed", String(on));
      show();
    });
  });
  search.addEventListener("input", show);
  more.addEventListener("click", extend);
  show();
})();
