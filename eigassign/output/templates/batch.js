// The rows of a batch: plots over what was swept and of any two columns, and a table, which is sorted
// by a click on a column's name. Words and verdicts filter all of them. A few hundred rows are in the
// table at a time, more as one asks for them.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent), { rows, links } = data;
  const columns = data.columns.map(([name, unit, kind]) => ({ name, unit, kind }));
  const head = document.querySelector("thead tr"), body = document.querySelector("tbody");
  const search = document.querySelector("input"), said = document.querySelector("[role=search] output");
  const more = document.querySelector(".more button"), chosen = new Set(), tones = {}, step = 200;
  const every = columns.map((_, k) => k), isNumber = every.map((k) => rows.some((row) => typeof row[k] === "number"));
  const shownColumns = every.filter((k) => columns[k].kind !== "hidden");
  const word = columns.findIndex((column) => column.kind === "word");
  const swept = every.filter((k) => columns[k].kind === "swept");
  const pictured = links.some((link) => link[1]);
  const title = (k) => columns[k].name + (columns[k].unit ? ` [${columns[k].unit}]` : "");
  const text = (k, row) => rows[row][k] === null ? "none" : `${rows[row][k]} ${columns[k].unit}`.trim();
  const label = (row) => ["case " + rows[row][0], ...swept.map((k) => `${columns[k].name} ${text(k, row)}`)].join("\n");
  const words = rows.map((row) => row.join(" ").toLowerCase());
  const compare = new Intl.Collator("en", { numeric: true }).compare;  // numbers in words by size
  const draws = [];
  let order = rows.map((_, k) => k), found = order, shown = 0, by = null, down = false;

  function element(name, content, className) {
    const made = document.createElement(name);
    if (className) made.className = className;
    if (content !== undefined) made.append(content);
    return made;
  }

  // --- The table

  function line(index) {
    const row = rows[index], made = element("tr"), [page, picture] = links[index];
    if (pictured) {
      const cell = element("td", undefined, "picture");
      if (picture) {
        const image = element("img"), link = element("a", image);
        image.src = picture; image.loading = "lazy"; image.alt = "Frequencies of case " + row[0];
        link.href = page || picture;
        cell.append(link);
      }
      made.append(cell);
    }
    for (const k of shownColumns) {
      const content = row[k] ?? "", long = columns[k].name === "message";
      const kind = isNumber[k] ? "number" : k === word ? tones[content] : long ? "long" : k ? "words" : "case";
      const into = element("td", k && !long ? String(content) : undefined, kind);
      if (long) into.append(element("div", content));
      if (k === 0) {
        const name = element(page ? "a" : "span");
        content.split(/(?<=[,;])/).forEach((part) => name.append(part, element("wbr")));
        if (page) { name.href = page; name.setAttribute("aria-label", label(index)); }
        into.append(name);
      }
      made.append(into);
    }
    return made;
  }

  function extend(count = step) {
    body.append(...found.slice(shown, shown + count).map(line));
    shown = Math.min(shown + count, found.length);
    more.hidden = shown === found.length;
    said.textContent = found.length === rows.length ? "" : found.length + " of " + rows.length;
  }

  function show() {
    const wanted = search.value.toLowerCase().split(/\s+/).filter(Boolean);
    found = order.filter((k) => (!chosen.size || chosen.has(rows[k][word])) && wanted.every((w) => words[k].includes(w)));
    body.replaceChildren();
    shown = 0;
    extend();
    draws.forEach((draw) => draw());
  }

  function sort(k) {  // what is empty comes last
    down = by === k && !down;
    by = k;
    const sign = down ? -1 : 1, key = (row) => isNumber[k] && typeof rows[row][k] !== "number" ? null : rows[row][k] || (rows[row][k] === 0 ? 0 : null);
    order.sort((a, b) => {
      const x = key(a), y = key(b);
      if (x === null || y === null) return (x === null) - (y === null) || a - b;
      return sign * (isNumber[k] ? x - y : compare(x, y)) || a - b;
    });
    for (const cell of head.querySelectorAll("th[data-column]")) {
      if (cell.dataset.column === columns[k].name) cell.setAttribute("aria-sort", down ? "descending" : "ascending");
      else cell.removeAttribute("aria-sort");
    }
    show();
  }

  if (pictured) head.append(element("th", undefined, "picture"));
  for (const k of shownColumns) {
    const button = element("button"), cell = element("th", button, isNumber[k] ? "number" : "");
    columns[k].name.split(/(?<=\.)/).forEach((part) => button.append(part, element("wbr")));
    if (columns[k].unit) button.append(element("small", columns[k].unit));
    button.type = "button"; cell.scope = "col"; cell.dataset.column = columns[k].name;
    button.addEventListener("click", () => sort(k));
    head.append(cell);
  }
  document.querySelectorAll("[data-word]").forEach((button) => {
    tones[button.dataset.word] = button.querySelector("strong").className;
    button.addEventListener("click", () => {
      const name = button.dataset.word, on = !chosen.has(name);
      if (on) chosen.add(name); else chosen.delete(name);
      button.setAttribute("aria-pressed", String(on));
      show();
    });
  });
  search.addEventListener("input", show);
  more.addEventListener("click", () => extend());
  addEventListener("beforeprint", () => extend(found.length));

  // --- Axes: from values to places, with a few of them to write

  const short = (value) => typeof value === "number" ? String(+value.toPrecision(4)) : value.length > 14 ? value.slice(0, 13) + "…" : value;

  function inDecades(values) {  // what is spread over them, and not evenly up to the largest
    const sorted = [...values].sort((a, b) => a - b), high = sorted[sorted.length - 1];
    return sorted[0] > 0 && high > 100 * sorted[0] && high > 10 * sorted[sorted.length >> 1];
  }

  function numeric(values, from, to, gap = 60) {
    let low = Math.min(...values), high = Math.max(...values);
    const logarithmic = inDecades(values), f = logarithmic ? Math.log10 : (v) => v, ticks = [];
    const margin = logarithmic ? 0 : (high - low) * 0.04 || Math.abs(high) * 0.05 || 1;
    if (logarithmic) { low /= 1.2; high *= 1.2; } else { low = low >= 0 ? Math.max(0, low - margin) : low - margin; high += margin; }
    const at = (v) => from + (f(v) - f(low)) / (f(high) - f(low)) * (to - from), room = Math.abs(to - from) / gap;
    if (logarithmic) {
      const digits = Math.log10(high / low) < 3 ? [1, 2, 5] : [1], every = Math.max(1, Math.ceil(Math.log10(high / low) / room));
      for (let p = Math.floor(Math.log10(low)); p <= Math.log10(high); p++) for (const d of digits) if (p % every === 0 && d * 10 ** p >= low && d * 10 ** p <= high) ticks.push(+(d * 10 ** p).toPrecision(2));
    } else {
      const rough = (high - low) / Math.max(2, room), size = 10 ** Math.floor(Math.log10(rough));
      const each = [1, 2, 5, 10].find((m) => m * size >= rough) * size;
      for (let v = Math.ceil(low / each) * each; v <= high; v += each) ticks.push(+v.toPrecision(10));
    }
    return { at, ticks };
  }

  function distinct(k, among) {
    const values = [...new Set(among.map((row) => rows[row][k]).filter((v) => v !== null))];
    return values.sort(isNumber[k] ? (a, b) => a - b : compare);
  }

  function listed(values, from, to, room) {
    const width = (to - from) / values.length, skip = Math.ceil(room / Math.abs(width)), places = new Map(values.map((v, k) => [v, from + (k + 0.5) * width]));
    return { at: (v) => places.get(v), ticks: values.filter((_, k) => k % skip === 0), width: Math.abs(width) };
  }

  const axis = (k, among, from, to, room) => isNumber[k]
    ? numeric(among.map((row) => rows[row][k]), from, to, room + 20) : listed(distinct(k, among), from, to, room);

  // --- Drawing

  function svg(parent, name, attributes, content) {
    const made = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (content !== undefined) made.textContent = content;
    parent.append(made);
    return made;
  }

  const marks = {  // a verdict's tone is told by shape too
    good: (x, y, r) => `M${x - r} ${y}a${r} ${r} 0 1 0 ${2 * r} 0a${r} ${r} 0 1 0 ${-2 * r} 0z`,
    fair: (x, y, r) => `M${x} ${y - 1.3 * r}l${1.3 * r} ${1.3 * r}l${-1.3 * r} ${1.3 * r}l${-1.3 * r} ${-1.3 * r}z`,
    bad: (x, y, r) => `M${x - r} ${y - r}l${2 * r} ${2 * r}m0 ${-2 * r}l${-2 * r} ${2 * r}`,
  };
  const glyphs = { good: "●", fair: "◆", bad: "✕" };

  function mark(parent, tone, x, y, r, colour) {
    const filled = tone === "bad" ? "none" : colour;
    return svg(parent, "path", { d: marks[tone](x, y, r), fill: filled, stroke: colour, "stroke-width": tone === "bad" ? 1.8 : 0 });
  }

  function legend(figure, among, more) {
    const rank = Object.keys(glyphs), there = [...new Set(among.map((row) => rows[row][word]))].sort((a, b) => rank.indexOf(tones[a]) - rank.indexOf(tones[b])), caption = figure.querySelector("figcaption");
    caption.replaceChildren();
    for (const one of there) {
      const item = element("span");
      item.append(element("b", glyphs[tones[one]], tones[one]), " " + one);
      caption.append(item, " ");
    }
    caption.append(more || "");
  }

  function sheet(figure, name, right, left, bottom = 44) {
    const box = figure.querySelector(".plot"), width = Math.max(280, box.clientWidth), height = Math.round(Math.min(420, Math.max(290, 0.62 * width)));
    box.replaceChildren();
    const root = svg(box, "svg", { viewBox: `0 0 ${width} ${height}`, tabindex: 0, role: "img", "aria-label": name + " The arrow keys go from one to the next, Enter opens its report." });
    return { box, root, width, height, left, right: width - right, top: 26, bottom: height - bottom };
  }

  function axes(s, x, y, kx, ky) {
    for (const v of y.ticks) {
      if (!y.width) svg(s.root, "line", { class: "line", x1: s.left, x2: s.right, y1: y.at(v), y2: y.at(v) });
      svg(s.root, "text", { x: s.left - 7, y: y.at(v) + 4, "text-anchor": "end" }, short(v));
    }
    for (const v of x.ticks) {
      svg(s.root, "line", { class: "axis", x1: x.at(v), x2: x.at(v), y1: s.bottom, y2: s.bottom + 4 });
      svg(s.root, "text", { x: x.at(v), y: s.bottom + 18, "text-anchor": "middle" }, short(v));
    }
    svg(s.root, "line", { class: "axis", x1: s.left, x2: s.right, y1: s.bottom, y2: s.bottom });
    svg(s.root, "text", { class: "soft", x: (s.left + s.right) / 2, y: s.bottom + 37, "text-anchor": "middle" }, title(kx));
    svg(s.root, "text", { class: "soft", x: 2, y: 13 }, title(ky));
  }

  const leftOf = (ticks) => 14 + 7 * Math.max(2, ...ticks.map((v) => short(v).length));

  // What lies under the pointer, or is reached by the arrow keys, is named; `points` have x, y, row and size.
  function live(s, points, saying) {
    const told = element("output"), ring = svg(s.root, "rect", { class: "chosen", visibility: "hidden" });
    told.setAttribute("aria-live", "polite");
    s.box.append(told);
    let at = null;
    function go(point) {
      at = point;
      ring.setAttribute("visibility", point ? "visible" : "hidden");
      told.textContent = point ? saying(point.row) : "";
      s.root.style.cursor = point && links[point.row][0] ? "pointer" : "";
      if (!point) return;
      const [w, h] = point.size || [13, 13], size = s.root.clientWidth / s.width;
      for (const [key, value] of Object.entries({ x: point.x - w / 2, y: point.y - h / 2, width: w, height: h, rx: point.size ? 0 : 7 })) ring.setAttribute(key, value);
      const wide = told.offsetWidth, tall = told.offsetHeight, x = point.x * size, y = point.y * size;
      told.style.left = Math.max(0, Math.min(s.box.clientWidth - wide, x - wide / 2)) + "px";
      told.style.top = (y - tall - 14 >= 0 ? y - tall - 14 : y + 16) + "px";
    }
    const open = () => { if (at && links[at.row][0]) location.href = links[at.row][0]; };
    s.root.addEventListener("pointermove", (event) => {
      const frame = s.root.getBoundingClientRect(), scale = s.width / frame.width;
      const x = (event.clientX - frame.left) * scale, y = (event.clientY - frame.top) * scale;
      let best = null, least = 400;
      for (const point of points) {
        const [w, h] = point.size || [0, 0];
        const far = Math.max(0, Math.abs(point.x - x) - w / 2) ** 2 + Math.max(0, Math.abs(point.y - y) - h / 2) ** 2;
        if (far < least) { least = far; best = point; }
      }
      go(best);
    });
    s.root.addEventListener("pointerleave", () => go(null));
    s.root.addEventListener("blur", () => go(null));
    s.root.addEventListener("click", (event) => { if (event.pointerType !== "touch") open(); });
    s.root.addEventListener("keydown", (event) => {
      const way = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowDown: [0, 1], ArrowUp: [0, -1] }[event.key];
      if (event.key === "Enter") open();
      if (event.key === "Escape") go(null);
      if (!way || !points.length) return;
      event.preventDefault();
      if (!at) { go(points[0]); return; }
      let best = null, least = Infinity;
      for (const point of points) {
        const along = (point.x - at.x) * way[0] + (point.y - at.y) * way[1], aside = Math.abs((point.x - at.x) * way[1]) + Math.abs((point.y - at.y) * way[0]);
        if (along > 0.5 && along + 3 * aside < least) { least = along + 3 * aside; best = point; }
      }
      if (best) go(best);
    });
  }

  function field(tools, name, options, start, draw) {
    const select = element("select"), made = element("label", name);
    for (const [value, shown] of options) select.append(new Option(shown, value, false, value === start));
    select.addEventListener("change", draw);
    made.append(select);
    tools.append(made);
    return select;
  }

  const VIRIDIS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
  function shade(share) {
    const k = Math.min(3, Math.floor(share * 4)), w = share * 4 - k;
    return `rgb(${VIRIDIS[k].map((c, i) => Math.round(c + w * (VIRIDIS[k + 1][i] - c)))})`;
  }
  const SERIES = ["var(--accent)", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "var(--ink)", "var(--soft)"];

  // --- Over the swept values: a map, points in two of them where they make no grid, or lines

  const numbers = every.filter((k) => isNumber[k] && columns[k].kind !== "swept");
  const worst = numbers.find((k) => columns[k].name === "worst error") ?? numbers[0];
  const keys = swept.filter((k) => distinct(k, order).length > 1).sort((a, b) => isNumber[b] - isNumber[a]);
  const over = document.getElementById("over"), asked = {};

  function drawOver() {
    const tools = over.querySelector(".tools"), options = (ks) => ks.map((k) => [String(k), columns[k].name]);
    const kept = Object.fromEntries(Object.entries(asked).map(([name, select]) => [name, select.value]));
    const pick = (name, label, choices, start) => {
      const value = choices.some(([v]) => v === kept[name]) ? kept[name] : start;
      asked[name] = field(tools, label, choices, value, drawOver);
      return value;
    };
    tools.replaceChildren();
    const value = +pick("value", "show", options(numbers), String(worst));
    const x = +pick("x", "over", options(keys), String(keys[0]));
    const others = keys.filter((k) => k !== x), pairs = new Set(order.map((row) => rows[row][x] + "\n" + rows[row][others[0]]));
    let y = null, grid = true, as = "lines";
    if (others.length) {
      y = +pick("y", "and", options(others), String(others[0]));
      pairs.clear();
      order.forEach((row) => pairs.add(rows[row][x] + "\n" + rows[row][y]));
      grid = distinct(x, order).length * distinct(y, order).length <= 4 * pairs.size;
      as = grid ? pick("as", "as", [["map", "map"], ["lines", "lines"]], "map") : "map";
    }
    let among = found;
    if (grid) for (const k of others.filter((k) => k !== y)) {
      const values = distinct(k, order), at = pick("held" + k, columns[k].name, values.map((v) => [String(v), `${v} ${columns[k].unit}`]), String(values[0]));
      among = among.filter((row) => String(rows[row][k]) === at);
    }
    among = among.filter((row) => rows[row][x] !== null && (y === null || rows[row][y] !== null));
    const known = among.filter((row) => rows[row][value] !== null);
    const saying = (row) => `${label(row)}\n${columns[value].name}: ${text(value, row)}\n${rows[row][word]}`;
    over.hidden = false;
    if (!known.length) { over.querySelector(".plot").replaceChildren(element("p", "Nothing to draw: no case that is shown has this number.")); legend(over, []); return; }
    (as === "lines" ? drawLines : grid ? drawMap : drawPoints)(value, x, y, among, known, saying);
  }

  function bar(s, value, known) {
    const x = s.right + 14, ends = known.map((row) => rows[row][value]), high = Math.max(...ends), low = Math.min(...ends);
    const logarithmic = inDecades(ends), f = logarithmic ? Math.log : (v) => v;
    for (let k = 0; k < 40; k++) svg(s.root, "rect", { x, width: 12, y: s.bottom - (k + 1) * (s.bottom - s.top) / 40, height: (s.bottom - s.top) / 40 + 0.5, fill: shade((k + 0.5) / 40) });
    for (let k = 0; k <= 4; k++) {
      const v = logarithmic ? low * (high / low) ** (k / 4) : low + (high - low) * k / 4;
      if (high > low || k === 2) svg(s.root, "text", { x: x + 17, y: s.bottom - k * (s.bottom - s.top) / 4 + 4 }, String(+v.toPrecision(3)));
    }
    svg(s.root, "text", { class: "soft", x: s.width - 2, y: 13, "text-anchor": "end" }, title(value));
    return (row) => high > low ? (f(rows[row][value]) - f(low)) / (f(high) - f(low)) : 0.5;
  }

  function drawMap(value, kx, ky, among, known, saying) {
    const s = sheet(over, `Map of ${title(value)} over ${title(kx)} and ${title(ky)}.`, 74, leftOf(distinct(ky, among)));
    const x = listed(distinct(kx, among), s.left, s.right, 40), y = listed(distinct(ky, among), s.bottom, s.top, 16), points = [];
    const share = bar(s, value, known), size = [x.width, y.width], said = (row) => String(rows[row][value] === null ? "" : +rows[row][value].toPrecision(3));
    const wide = size[1] >= 30 && size[0] >= 3 + 6.5 * Math.max(...known.map((row) => said(row).length));  // all numbers or none
    for (const row of among) {
      const cx = x.at(rows[row][kx]), cy = y.at(rows[row][ky]), number = rows[row][value], t = number === null ? 0 : share(row);
      const ink = t > 0.55 ? "#1a1a1a" : "#fff", tone = tones[rows[row][word]];
      points.push({ x: cx, y: cy, row, size });
      if (number === null) svg(s.root, "rect", { x: cx - size[0] / 2 + 1, y: cy - size[1] / 2 + 1, width: size[0] - 2, height: size[1] - 2, fill: "none", class: "axis", "stroke-dasharray": "3 3" });
      else svg(s.root, "rect", { x: cx - size[0] / 2, y: cy - size[1] / 2, width: size[0], height: size[1], fill: shade(t), stroke: "var(--page)", "stroke-width": 0.5 });
      if (wide) svg(s.root, "text", { x: cx, y: cy + 12, "text-anchor": "middle", style: `fill: ${ink}; font-size: 11px` }, said(row));
      if (Math.min(...size) >= 12) mark(s.root, tone, cx, cy - (wide ? 7 : 0), 3.5, number === null ? "var(--ink)" : ink);
    }
    axes(s, x, y, kx, ky);
    legend(over, among);
    live(s, points, saying);
  }

  function drawPoints(value, kx, ky, among, known, saying) {
    const s = sheet(over, `${title(value)} at ${title(kx)} and ${title(ky)}.`, 74, leftOf(axis(ky, known, 0, 420, 16).ticks));
    const x = axis(kx, known, s.left + 8, s.right - 8, 40), y = axis(ky, known, s.bottom - 8, s.top, 16), share = bar(s, value, known);
    axes(s, x, y, kx, ky);
    const points = known.map((row) => ({ x: x.at(rows[row][kx]), y: y.at(rows[row][ky]), row }));
    for (const p of points) svg(s.root, "path", { d: marks[tones[rows[p.row][word]]](p.x, p.y, 5), fill: tones[rows[p.row][word]] === "bad" ? "none" : shade(share(p.row)), stroke: shade(share(p.row)), "stroke-width": 2.2 });
    legend(over, known);
    live(s, points, saying);
  }

  function drawLines(value, kx, ky, among, known, saying) {
    const families = ky === null ? [null] : distinct(ky, known), named = families.length > 1;
    const end = named ? 12 + 7 * Math.max(...families.map((v) => short(v).length)) : 12;
    const s = sheet(over, `${title(value)} over ${title(kx)}${named ? `, a line for each ${title(ky)}` : ""}.`, end, leftOf(axis(value, known, 0, 420, 16).ticks));
    const x = axis(kx, known, s.left + 8, s.right - 8, 40), y = axis(value, known, s.bottom - 4, s.top, 16), points = [], ends = [];
    axes(s, x, y, kx, value);
    families.forEach((family, n) => {
      const own = known.filter((row) => family === null || rows[row][ky] === family).sort((a, b) => x.at(rows[a][kx]) - x.at(rows[b][kx]));
      const colour = families.length > SERIES.length ? shade(0.1 + 0.75 * n / (families.length - 1)) : SERIES[n];
      const places = own.map((row) => ({ x: x.at(rows[row][kx]), y: y.at(rows[row][value]), row }));
      svg(s.root, "path", { d: "M" + places.map((p) => `${p.x} ${p.y}`).join("L"), fill: "none", stroke: colour, "stroke-width": 2, "stroke-dasharray": n % 2 ? "6 3" : "none" });
      for (const p of places) mark(s.root, tones[rows[p.row][word]], p.x, p.y, 4, colour);
      points.push(...places);
      if (named && places.length) ends.push({ y: places[places.length - 1].y, family });
    });
    ends.sort((a, b) => a.y - b.y);
    let last = -Infinity;
    for (const one of ends) if (ends.length <= 12 || one.y - last >= 13) {
      last = Math.max(one.y, last + 13);
      svg(s.root, "text", { x: s.right + 2, y: last + 4 }, short(one.family));
    }
    legend(over, known, named ? `At the lines' ends: ${title(ky)}.` : "");
    live(s, points, saying);
  }

  // --- Any two columns

  const cloud = document.getElementById("cloud"), all = every.filter((k) => isNumber[k]);
  let abscissa, ordinate;

  function drawCloud() {
    const kx = +abscissa.value, ky = +ordinate.value, known = found.filter((row) => rows[row][kx] !== null && rows[row][ky] !== null);
    legend(cloud, known);
    if (!known.length) { cloud.querySelector(".plot").replaceChildren(element("p", "Nothing to draw: no case that is shown has both numbers.")); return; }
    const s = sheet(cloud, `${title(ky)} against ${title(kx)}, a point for each case.`, 12, leftOf(axis(ky, known, 0, 420, 16).ticks));
    const x = axis(kx, known, s.left + 8, s.right - 8, 40), y = axis(ky, known, s.bottom - 8, s.top, 16);
    axes(s, x, y, kx, ky);
    const points = known.map((row) => ({ x: x.at(rows[row][kx]), y: y.at(rows[row][ky]), row }));
    for (const p of points) mark(s.root, tones[rows[p.row][word]], p.x, p.y, 4.5, `var(--${tones[rows[p.row][word]]})`);
    live(s, points, (row) => [label(row), ...[kx, ky].filter((k) => !swept.includes(k)).map((k) => `${columns[k].name}: ${text(k, row)}`), rows[row][word]].join("\n"));
  }

  // --- What was swept, and the variant that is nearest to its target

  const few = (value, k) => `${typeof value === "number" ? +value.toPrecision(4) : value} ${columns[k].unit}`.trim();
  for (const k of swept) {
    const values = distinct(k, order), many = values.length > 100 ? "" : `, ${values.length} value${values.length > 1 ? "s" : ""}`;
    const ends = isNumber[k] && values.length > 1 ? ` from ${+values[0].toPrecision(4)} to ${few(values[values.length - 1], k)}` : "";
    document.getElementById("spans").append(element("li", columns[k].name + many + ends));
  }
  const least = swept.length ? order.filter((row) => rows[row][worst] > 0).sort((a, b) => rows[a][worst] - rows[b][worst])[0] : undefined;
  if (least !== undefined && rows.every((row) => row[worst] !== 0))
    document.getElementById("nearest").textContent = `Nearest to its target is case ${rows[least][0]}, ${text(worst, least)} off at worst: ${swept.map((k) => `${columns[k].name} ${few(rows[least][k], k)}`).join(", ")}.`;

  if (keys.length && numbers.length) draws.push(drawOver);
  if (all.length > 1 && rows.length > 1) {
    const tools = cloud.querySelector(".tools"), options = all.map((k) => [String(k), columns[k].name]);
    const design = numbers.find((k) => k > worst && columns[k].kind === "number" && !/error|mass|price|time/.test(columns[k].name));
    ordinate = field(tools, "show", options, String(worst), drawCloud);
    abscissa = field(tools, "against", options, String(design ?? all.find((k) => k !== worst)), drawCloud);
    cloud.hidden = false;
    draws.push(drawCloud);
  }
  show();
  let width = document.querySelector(".plots").clientWidth;
  new ResizeObserver(() => {
    const now = document.querySelector(".plots").clientWidth;
    if (now !== width) draws.forEach((draw) => draw());
    width = now;
  }).observe(document.querySelector(".plots"));
})();
