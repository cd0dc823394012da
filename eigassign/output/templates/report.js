// Draws what the page holds as data. Plotly plots; this chooses colours, plays the mode, saves numbers.
(function () {
  "use strict";
  const read = (id) => { const e = document.getElementById(id); return e ? JSON.parse(e.textContent) : null; };
  const figures = read("figures") || {}, moving = read("moving") || [];
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const config = { displaylogo: false, responsive: true, scrollZoom: false,
    modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"] };
  // A small screen has no room for buttons; nor is there any beside a colour bar.
  const touched = !matchMedia("(hover: hover)").matches || innerWidth < 600;
  if (touched) config.displayModeBar = false;
  const bare = { ...config, displayModeBar: touched ? false : "hover" };

  // --- Plots in the page's colours

  function themed(figure) {
    const copy = JSON.parse(JSON.stringify(figure).replaceAll("#1a1a1a", css("--ink")).replaceAll("#0072B2", css("--blue")));
    const axis = { gridcolor: css("--line"), zerolinecolor: css("--soft"), linecolor: css("--soft"), automargin: true };
    for (const key of Object.keys(copy.layout)) {
      if (/^[xy]axis/.test(key)) copy.layout[key] = { ...axis, ...copy.layout[key] };
    }
    const ends = (copy.layout.annotations || []).some((note) => note.xanchor === "left" && note.x === 1);
    copy.layout = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
      font: { color: css("--ink"), family: "system-ui, sans-serif", size: 12 },
      margin: { l: 10, r: ends ? (touched ? 58 : 92) : (touched ? 12 : 34), t: 10, b: 10 },
      modebar: { orientation: "v", bgcolor: "rgba(0,0,0,0)", color: css("--soft"), activecolor: css("--ink") },
      legend: { orientation: "h", yanchor: "bottom", y: 1.01, x: 0, xanchor: "left" },
      hoverlabel: { bgcolor: css("--page"), font: { color: css("--ink") } }, ...copy.layout };
    if (copy.layout.title) copy.layout.margin.t = 52;
    return copy;
  }

  const drawn = new Map();
  function draw(box) {
    const figure = themed(figures[box.dataset.figure][+box.dataset.part]);
    drawn.set(box, true);
    const mapped = figure.data.some((trace) => trace.type === "heatmap");
    return Plotly.react(box, figure.data, figure.layout, mapped ? bare : config);
  }
  const boxes = [...document.querySelectorAll(".plot[data-figure]")];
  const seen = new IntersectionObserver((entries) => {
    for (const entry of entries) if (entry.isIntersecting && !drawn.has(entry.target)) draw(entry.target);
  }, { rootMargin: "600px" });
  boxes.forEach((box) => seen.observe(box));
  const redraw = () => { drawn.forEach((_, box) => draw(box)); moved.forEach((one) => one.restyle()); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("beforeprint", () => boxes.forEach((box) => drawn.has(box) || draw(box)));

  // --- Numbers as files

  function save(name, text, type) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  }
  const quoted = (text) => '"' + String(text).replaceAll('"', '""') + '"';
  function csv(name) {
    const rows = ["panel,series,x,y,z"];
    figures[name].forEach((figure, part) => figure.data.forEach((trace) => {
      const panel = trace.yaxis || part + 1, label = quoted(trace.name || "");
      if (trace.z) trace.z.forEach((row, j) => row.forEach((z, i) => rows.push([panel, label, trace.x[i], trace.y[j], z ?? ""].join())));
      else trace.x.forEach((x, i) => rows.push([panel, label, quoted(x ?? ""), quoted(trace.y[i] ?? ""), ""].join()));
    }));
    return rows.join("\n") + "\n";
  }
  document.querySelectorAll("button[data-csv]").forEach((button) => button.addEventListener("click",
    () => save(button.dataset.csv + ".csv", csv(button.dataset.csv), "text/csv")));
  document.querySelectorAll("button[data-json]").forEach((button) => button.addEventListener("click",
    () => save(button.dataset.json, document.getElementById("results").textContent, "application/json")));

  // --- A mode along the trajectory

  const moved = [];
  function player(root) {
    const mode = moving[+root.dataset.moving], box = root.querySelector(".plot");
    const time = root.querySelector("input[name=time]"), phase = root.querySelector("input[name=phase]");
    const play = root.querySelector(".tools button"), said = root.querySelector("output");
    const space = mode.rest[0].length === 3, last = mode.time.length - 1;
    time.max = last;
    const axes = space ? ["x", "y", "z"] : ["x", "y"];
    const along = (k, part) => {  // between two poses, as the sliders say
      const a = Math.min(Math.floor(k), last), b = Math.min(a + 1, last), w = k - a;
      return mode[part][a].map((row, c) => row.map((v, i) => v === null ? null : v + w * (mode[part][b][c][i] - v)));
    };
    const shifted = (rest, motion, s) => rest.map((row, c) => row.map((v, i) => v === null ? null : v + s * motion[c][i]));
    const symbols = { fixed: "square", prismatic: "square", carriage: "square" };
    function traces() {
      const k = +time.value, s = Math.sin(+phase.value * Math.PI / 180);
      const rest = along(k, "rest"), shape = shifted(rest, along(k, "motion"), s);
      const marks = mode.marks.length ? shifted(along(k, "places"), along(k, "moves"), s) : null;
      const as = (points) => Object.fromEntries(axes.map((axis, c) => [axis, points[c]]));
      const type = space ? "scatter3d" : "scatter";
      const found = [];
      if (mode.tip) found.push({ type, mode: "lines", name: "tip path", ...as(mode.tip), line: { color: css("--line-strong"), width: 2 }, hoverinfo: "skip" });
      found.push({ type, mode: "lines", name: "rigid links", ...as(rest), line: { color: css("--soft"), width: 2 }, hoverinfo: "skip", connectgaps: false });
      found.push({ type, mode: "lines", name: mode.name, ...as(shape), line: { color: css("--accent"), width: 5 }, hoverinfo: "skip", connectgaps: false });
      if (marks) found.push({ type, mode: "markers", name: "joints and bodies", ...as(marks), text: mode.marks.map((m) => m.name), hovertemplate: "%{text}<extra></extra>",
        marker: { size: mode.marks.map((m) => m.kind === "body" ? (space ? 8 : 10) : (space ? 6 : 7)), symbol: mode.marks.map((m) => symbols[m.kind] || "circle"), color: mode.marks.map((m) => m.kind === "body" ? "#D55E00" : css("--ink")) } });
      return found;
    }
    const reach = axes.map((_, c) => {
      let low = Infinity, high = -Infinity;
      mode.rest.forEach((pose, k) => pose[c].forEach((v, i) => { if (v !== null) { const m = Math.abs(mode.motion[k][c][i]); low = Math.min(low, v - m); high = Math.max(high, v + m); } }));
      return [low, high];
    });
    const half = Math.max(...reach.map(([low, high]) => high - low)) * 0.54 || 1;
    function layout() {
      const quiet = { color: css("--soft"), gridcolor: css("--line"), zerolinecolor: css("--line") };
      const base = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: css("--ink"), family: "system-ui, sans-serif", size: 12 },
        margin: { l: 10, r: 10, t: 10, b: 10 }, height: 440, showlegend: true, legend: { orientation: "h", y: -0.08 }, uirevision: "kept",
        modebar: { orientation: "v", bgcolor: "rgba(0,0,0,0)", color: css("--soft"), activecolor: css("--ink") } };
      if (space) {
        const reaches = reach.map(([low, high]) => Math.max((high - low) * 0.54, half / 4));  // no axis without room for its numbers
        const of = (c) => ({ ...quiet, title: { text: axes[c] + " [m]" }, nticks: 4, range: [(reach[c][0] + reach[c][1]) / 2 - reaches[c], (reach[c][0] + reach[c][1]) / 2 + reaches[c]] });
        const size = 2.4 / Math.hypot(...reaches);
        const aspectratio = { x: reaches[0] * size, y: reaches[1] * size, z: reaches[2] * size };
        return { ...base, scene: { xaxis: of(0), yaxis: of(1), zaxis: of(2), aspectmode: "manual", aspectratio, camera: { eye: { x: 0.8, y: -0.95, z: 0.5 }, projection: { type: "orthographic" } } } };
      }
      const pad = 0.04 * half;
      return { ...base, xaxis: { ...quiet, title: { text: "x [m]" }, range: [reach[0][0] - pad, reach[0][1] + pad], constrain: "domain", automargin: true },
        yaxis: { ...quiet, title: { text: "y [m]" }, range: [reach[1][0] - pad, reach[1][1] + pad], scaleanchor: "x", constrain: "domain", automargin: true } };
    }
    const restyle = () => Plotly.react(box, traces(), layout(), config);
    function show() {
      const k = +time.value, a = Math.min(Math.floor(k), last), b = Math.min(a + 1, last), w = k - a;
      const mix = (list) => list[a] + w * (list[b] - list[a]);
      said.textContent = `${mix(mode.time).toPrecision(3)} s, ${mix(mode.hz).toPrecision(4)} Hz`;
      time.setAttribute("aria-valuetext", said.textContent);
      return restyle();
    }
    let running = false, before = 0, busy = false;
    function frame(now) {
      if (!running) return;
      const step = Math.min(now - before, 100) / 1000;
      before = now;
      if (!busy) {
        phase.value = (+phase.value + 360 * step) % 360;
        time.value = (+time.value + last * step / 10) % (last || 1);
        busy = true;
        Promise.resolve(show()).then(() => { busy = false; });
      }
      requestAnimationFrame(frame);
    }
    play.addEventListener("click", () => {
      running = !running;
      play.textContent = running ? "Pause" : "Play";
      play.setAttribute("aria-pressed", running);
      if (running) { before = performance.now(); requestAnimationFrame(frame); }
    });
    time.addEventListener("input", show);
    phase.addEventListener("input", show);
    moved.push({ restyle });
    const shown = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) { if (running) play.click(); return; }
      if (!box.dataset.ready) { box.dataset.ready = "yes"; show(); if (!still && root.dataset.auto) play.click(); }
    });
    shown.observe(box);
  }
  document.querySelectorAll("[data-moving]").forEach(player);
})();
