// Draws what the page holds as data: the mechanism on a canvas, plots with Plotly, and one cursor in time for both.
const eigassign = (function () {
  "use strict";
  const read = (id) => { const e = document.getElementById(id); return e ? JSON.parse(e.textContent) : null; };
  const figures = read("figures") || {}, moving = read("moving") || [];
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const all = (selector) => [...document.querySelectorAll(selector)];

  // --- One cursor in time: who sets it tells all others

  const clock = { along: moving.length ? moving[0].trajectory : "", time: null, heard: [] };
  function setTime(along, time) {
    clock.along = along; clock.time = time;
    clock.heard.forEach((hear) => hear());
  }
  // A figure of the only trajectory has no name of it.
  const sameClock = (own) => own === "" || own === clock.along;

  // --- Plots in the page's colours

  // These buttons and no other: Plotly's own set has one that sends the figure to a cloud.
  const config = { displaylogo: false, responsive: true, scrollZoom: false, showSendToCloud: false, plotlyServerURL: "",
    modeBarButtons: [["zoom2d", "pan2d", "resetScale2d", "toImage"]] };
  // A small screen has no room for buttons.
  const touched = !matchMedia("(hover: hover)").matches || innerWidth < 600;
  if (touched) config.displayModeBar = false;

  function themed(figure, whole) {
    const copy = JSON.parse(JSON.stringify(figure).replaceAll("#1a1a1a", css("--ink")).replaceAll("#0072B2", css("--blue")));
    const axis = { gridcolor: css("--line"), zerolinecolor: css("--soft"), linecolor: css("--soft"), automargin: true };
    for (const key of Object.keys(copy.layout)) {
      if (/^[xy]axis/.test(key)) copy.layout[key] = { ...axis, ...copy.layout[key] };
    }
    if (whole) {
      copy.layout.annotations = copy.layout.meta.ends;
      for (const [axis, range] of Object.entries(copy.layout.meta.whole)) copy.layout[axis].range = range;
    }
    const ends = (copy.layout.annotations || []).some((note) => note.xanchor === "left" && note.x === 1);
    if (innerWidth < 600) copy.data.forEach((trace) => { trace.mode = trace.mode.replace("+text", ""); });
    copy.layout = { paper_bgcolor: css("--page"), plot_bgcolor: css("--page"),
      font: { color: css("--ink"), family: "system-ui, sans-serif", size: 12 },
      margin: { l: 10, r: ends ? (touched ? 58 : 92) : (touched ? 12 : 34), t: 10, b: 10 },
      modebar: { orientation: "v", bgcolor: "rgba(0,0,0,0)", color: css("--soft"), activecolor: css("--ink") },
      legend: { orientation: "h", yanchor: "bottom", y: 1.01, x: 0, xanchor: "left" },
      hoverlabel: { bgcolor: css("--page"), font: { color: css("--ink") } }, ...copy.layout };
    return copy;
  }

  const drawn = new Set();
  function draw(box) {
    const figure = themed(figures[box.dataset.figure], box.matches(".whole")), meta = figure.layout.meta || {};
    const again = drawn.has(box);
    drawn.add(box);
    const save = { toImageButtonOptions: { filename: box.dataset.figure, scale: 2 } };
    return Plotly.react(box, figure.data, figure.layout, { ...config, ...save }).then(() => {
      if (again || meta.clock === undefined) return;
      const line = box.appendChild(document.createElement("div"));
      line.className = "cursor";
      const place = () => {
        const full = box._fullLayout, there = clock.time !== null && sameClock(meta.clock);
        line.hidden = !there;
        if (!there || !full) return;
        const x = full.xaxis.l2p(clock.time);
        line.hidden = x < 0 || x > full.xaxis._length;
        line.style.cssText = `left:${full.xaxis._offset + x}px;top:${full._size.t}px;height:${full._size.h}px`;
      };
      clock.heard.push(place);
      box.on("plotly_afterplot", place);
      box.on("plotly_click", (event) => { pause(); setTime(meta.clock || clock.along, event.points[0].x); });
      if (meta.whole && Object.keys(meta.whole).length) rest(box, figure.layout, meta.whole);
      place();
    });
  }
  function rest(box, layout, whole) {  // modes that the panels leave out, behind a click
    const axes = Object.keys(whole), inside = (a, b) => a[0] <= b[0] && a[1] >= b[1];
    if (axes.every((axis) => inside(layout[axis].range, whole[axis]))) return;
    const tools = box.insertAdjacentElement("afterend", document.createElement("div"));
    tools.className = "tools";
    const button = tools.appendChild(document.createElement("button"));
    button.type = "button"; button.textContent = "All modes"; button.setAttribute("aria-pressed", "false");
    const caption = box.closest("figure").querySelector("figcaption"), words = caption.innerHTML;
    button.addEventListener("click", () => {
      const on = box.classList.toggle("whole"); button.setAttribute("aria-pressed", on);
      caption.innerHTML = on ? words.replace(/ Kept from afar, outside the axis.*/s, "") : words; draw(box);
    });
  }
  function plots() {
    const boxes = all(".plot[data-figure]");
    const seen = new IntersectionObserver((entries) => {
      for (const entry of entries) if (entry.isIntersecting && !drawn.has(entry.target)) draw(entry.target);
    }, { rootMargin: "600px" });
    boxes.forEach((box) => seen.observe(box));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => drawn.forEach(draw));
    const open = () => boxes.filter((box) => !box.closest("details:not([open])"));
    // Paper is narrower or wider than the window: between margins of 14 mm A4 has 688 pixels. It has 1016 in height: 640 leave room for headings and captions.
    const paper = (on) => {
      document.documentElement.classList.toggle("paper", on);
      open().forEach((box) => {
        const height = Math.min(figures[box.dataset.figure].layout.height, 900), zoom = Math.min(1, 640 / height);
        draw(box);
        Plotly.relayout(box, on ? { autosize: false, width: 688, height: height * zoom, "font.size": 12 * zoom } : { autosize: true, width: null });
      });
    };
    addEventListener("beforeprint", () => paper(true));
    addEventListener("afterprint", () => paper(false));
  }

  // The page is seen before 5 MB of script are compiled.
  function begin() {
    requestAnimationFrame(() => setTimeout(() => {
      const script = document.createElement("script");
      script.textContent = document.getElementById("plotly").textContent;
      document.body.append(script);
      plots();
    }));
  }

  // --- Numbers as files

  function save(name, text, type) {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([text], { type }));
    link.download = name;
    link.click();
    URL.revokeObjectURL(link.href);
  }
  const quoted = (text) => /[",\n]/.test(text) ? '"' + String(text).replaceAll('"', '""') + '"' : String(text);
  function csv(name) {  // a column a curve over one abscissa; of named points a row a point
    const { data, layout } = figures[name], across = layout.xaxis.title.text || "x", columns = new Map(), points = data.filter((t) => t.hovertext);
    const axis = (trace) => layout[trace.yaxis.replace("y", "yaxis")].title.text;
    const lines = (rows) => rows.map((row) => row.map((cell) => quoted(cell ?? "")).join()).join("\n") + "\n", heat = data.find((t) => t.z); if (heat) return lines([[`${axis(heat)} / ${across}`, ...heat.x], ...heat.y.map((y, i) => [y, ...heat.z[i]])]);
    const ups = [...new Set(points.map(axis))].filter(Boolean);  // without a title: rows of a sheet
    if (points.length) return lines([["point", "series", across, ...ups], ...points.flatMap((t) => t.x.map((x, i) => [t.hovertext[i], t.name, x, ...ups.map((up) => up === axis(t) ? t.y[i] : "")]))]);
    const add = (head, x, y) => { if (!columns.has(head)) columns.set(head, new Map(x.map((at, i) => [at, y[i]]))); };
    for (const t of data.filter((trace) => trace.name && trace.yaxis)) {
      const n = t.x.length / 2, head = `${t.name}: ${axis(t)}`;
      if (!t.fill) add(head, t.x, t.y);
      if (t.fill && t.meta[0]) add(head + ", from", t.x.slice(0, n), t.y.slice(0, n));
      if (t.fill && t.meta[1]) add(head + ", to", t.x.slice(0, n), t.y.slice(n).reverse());
    }
    const every = [...new Set([...columns.values()].flatMap((own) => [...own.keys()]))].filter((x) => x !== null).sort((a, b) => a - b);
    return lines([[across, ...columns.keys()], ...every.map((x) => [x, ...[...columns.values()].map((own) => own.get(x))])]);
  }
  all("button[data-csv]").forEach((button) => button.addEventListener("click",
    () => save(button.dataset.csv + ".csv", csv(button.dataset.csv), "text/csv")));
  all("button[data-json]").forEach((button) => button.addEventListener("click",
    () => save(button.dataset.json, document.getElementById("results").textContent, "application/json")));

  // --- Contents: the section that is being read

  const links = new Map(all("nav a").map((link) => [link.getAttribute("href").slice(1), link]));
  const reading = new IntersectionObserver((entries) => entries.forEach((entry) => {
    if (!entry.isIntersecting) return;
    links.forEach((link, id) => id === entry.target.id ? link.setAttribute("aria-current", "true") : link.removeAttribute("aria-current"));
  }), { rootMargin: "-10% 0px -80% 0px" });
  all("main section[id]").forEach((section) => reading.observe(section));
  // What is linked to is open, even if it lies folded.
  addEventListener("hashchange", () => { const e = document.getElementById(location.hash.slice(1)); if (e) e.closest("details")?.setAttribute("open", ""); });

  // --- The mechanism in motion: the parts of the scene, projected and drawn

  let pause = () => {};
  function player(root) {
    const canvas = root.querySelector("canvas"), pen = canvas.getContext("2d");
    const field = (name) => root.querySelector(`[name=${name}]`);
    const time = field("time"), scale = field("scale"), modes = field("mode"), along = field("along"), play = field("play");
    const said = root.querySelector("output"), caption = root.querySelector("figcaption");
    let scene, view, middle, phase = 90, running = false, before = 0;

    function choose() {
      scene = moving[along ? +along.value : 0];
      view = scene.view.map((row) => [...row]);
      canvas.classList.toggle("spatial", scene.view[0].length === 3);
      const ends = scene.rest[0].map((_, c) => scene.rest.reduce(([low, high], pose) => [Math.min(low, ...pose[c]), Math.max(high, ...pose[c])], [Infinity, -Infinity]));
      middle = ends.map(([low, high]) => 0.5 * (low + high));
      time.max = scene.time.length - 1;
      time.value = Math.min(+time.value, +time.max);
      caption.textContent = "Grey: the rigid links. " + scene.words + (view[0].length === 3 ? " Drag to turn." : "");
    }
    const mix = (list, k) => { const a = Math.min(Math.floor(k), list.length - 1), b = Math.min(a + 1, list.length - 1), w = k - a; return (f) => f(list[a]) + w * (f(list[b]) - f(list[a])); };
    function flat(columns, i, s, motion) {  // a place on the sheet, m
      const u = [0, 0];
      for (let c = 0; c < middle.length; c++) {
        let x = columns((pose) => pose[c][i]) - middle[c];
        if (s) x += s * motion((pose) => pose[c][i]);
        u[0] += view[0][c] * x; u[1] += view[1][c] * x;
      }
      return u;
    }
    function show() {
      const ratio = devicePixelRatio || 1, W = canvas.clientWidth, H = canvas.clientHeight;
      if (canvas.width !== Math.round(W * ratio)) { canvas.width = Math.round(W * ratio); canvas.height = Math.round(H * ratio); }
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, W, H);
      pen.lineCap = pen.lineJoin = "round";
      const k = +time.value, mode = scene.modes[+modes.value], s = mode ? +scale.value * Math.sin(phase * Math.PI / 180) : 0;
      const rest = mix(scene.rest, k), motion = mode && mix(mode.motion, k), axes = scene.axes.length ? mix(scene.axes, k) : null;
      const pixels = Math.min((W - 40) / scene.size[0], (H - 110) / scene.size[1]);  // below it axes and scale
      const inch = 96 * Math.min(Math.max(scene.thick * pixels / 96 / scene.symbol[0], 1), scene.symbol[1]) * (W < 420 ? 0.8 : 1);
      const on = ([u, v]) => [W / 2 + pixels * u, H / 2 - 30 - pixels * v];
      const look = { body: "#d55e00", spring: css("--good"), ground: css("--soft") }, page = css("--page");
      const heading = (axis) => {
        if (axis === null) return [1, 0];
        const u = [0, 1].map((r) => view[r].reduce((sum, w, c) => sum + w * axes((pose) => pose[c][axis]), 0)), n = Math.hypot(...u);
        return n > 0.05 ? [u[0] / n, u[1] / n] : [1, 0];
      };
      function path(points, closed) {
        pen.beginPath();
        let broken = true;
        for (const p of points) {
          if (!p) { broken = true; continue; }
          if (broken) pen.moveTo(...p); else pen.lineTo(...p);
          broken = false;
        }
        if (closed) pen.closePath();
      }
      function stroke(points, colour, width) { path(points); pen.strokeStyle = colour; pen.lineWidth = width; pen.stroke(); }
      function thick(points, ends, colour) {
        const [a, b] = ends.map((e) => Math.max(e * pixels, scene.hair[0] * 4 / 3)), n = points.length - 1;
        const pieces = a === b ? 1 : 8;
        for (const [paint, wider] of [[page, scene.hair[1] * 4 / 3], [colour, 0]]) {
          for (let piece = 0; piece < pieces; piece++) {
            const at = (w) => { const x = w * n, i = Math.min(Math.floor(x), n - 1), f = x - i; return points[i].map((v, c) => v + f * (points[i + 1][c] - v)); };
            const own = pieces === 1 ? points : Array.from({ length: 5 }, (_, j) => at((piece + j / 4) / pieces));
            stroke(own, paint, (a + (b - a) * (piece + 0.5) / pieces) + wider);
          }
        }
      }
      const turned = (points, [c, d], at) => points.map(([x, y]) => x === null ? null : [at[0] + inch * (x * c - y * d), at[1] - inch * (x * d + y * c)]);
      function zigzag([x0, y0], [x1, y1]) {
        const dx = x1 - x0, dy = y1 - y0, n = Math.hypot(dx, dy) || 1, w = 0.05 * inch;
        return [[0, 0], [.2, 0], [.25, 1], [.35, -1], [.45, 1], [.55, -1], [.65, 1], [.75, -1], [.8, 0], [1, 0]].map(([t, side]) => [x0 + t * dx - side * w * dy / n, y0 + t * dy + side * w * dx / n]);
      }
      function rail(part, [p, q]) {
        let [c, d] = heading(part.axis);
        if (c < 0) [c, d] = [-c, -d];
        const half = 0.5 * Math.hypot(q[0] - p[0], q[1] - p[1]) / inch + 0.2, points = [[-half, -.09], [half, -.09], [null, null]];
        for (let x = -0.76 * half; x <= half; x += 0.055) points.push([x, -.09], [x - .05, -.15], [null, null]);
        stroke(turned(points, [c, d], [(p[0] + q[0]) / 2, (p[1] + q[1]) / 2]), look.ground, 1);
      }
      function part(one, colour, s) {
        const own = look[one.role] && colour !== ghost ? look[one.role] : colour;
        const points = [];
        for (let i = one.at[0]; i < one.at[1]; i++) points.push(on(flat(rest, i, s, motion)));
        if (one.kind === "line") { thick(points, one.ends, own); return; }
        if (one.kind === "spring") { stroke(zigzag(...points), own, 1.5); return; }
        if (one.kind === "rail") { rail(one, points); return; }
        for (const shape of one.shapes) {
          const fill = { own, page, ground: css("--line") }[shape.fill];
          if (shape.dot) { pen.beginPath(); pen.arc(...points[0], shape.dot * inch / 144, 0, 7); }
          else path(turned(shape.points, heading(one.axis), points[0]), Boolean(fill));
          if (fill) { pen.fillStyle = fill; pen.fill(); }
          pen.strokeStyle = own; pen.lineWidth = shape.width * 4 / 3; pen.stroke();
        }
      }
      const ghost = css("--line"), accent = css("--accent"), ground = scene.parts.filter((one) => one.role === "ground");
      ground.forEach((one) => part(one, look.ground, 0));
      if (mode) scene.parts.filter((one) => one.role === "link" || one.role === "rigid").forEach((one) => part(one, ghost, 0));
      if (scene.tip) {
        const tip = scene.tip[0].map((x, i) => x === null ? null : on([0, 1].map((r) => scene.tip.reduce((sum, column, c) => sum + view[r][c] * (column[i] - middle[c]), 0))));
        stroke(tip, css("--line-strong"), 1.6);
      }
      scene.parts.filter((one) => one.role !== "ground").forEach((one) => part(one, accent, s));
      bearings(pen, W, H, pixels);
      const now = mix(scene.time, k)((t) => t);
      said.textContent = `${now.toPrecision(3)} s` + (mode ? `, ${mix(mode.hz, k)((f) => f).toPrecision(4)} Hz` : "");
      time.setAttribute("aria-valuetext", said.textContent);
    }
    function bearings(pen, W, H, pixels) {  // a bar of round length
      const most = 80 / pixels, power = 10 ** Math.floor(Math.log10(most)), length = [5, 2, 1].find((n) => n * power <= most * 1.000001) * power;
      const text = length < 0.1 ? `${+(1000 * length).toPrecision(3)} mm` : `${+length.toPrecision(3)} m`;
      pen.strokeStyle = pen.fillStyle = css("--soft"); pen.lineWidth = 1.3; pen.font = "12px system-ui, sans-serif";
      pen.beginPath(); pen.moveTo(12, H - 12); pen.lineTo(12 + length * pixels, H - 12); pen.stroke();
      pen.fillText(text, 18 + length * pixels, H - 8);
      view[0].forEach((_, c) => {
        const [x, y] = [18 + 24 * view[0][c], H - 40 - 24 * view[1][c]];
        pen.beginPath(); pen.moveTo(18, H - 40); pen.lineTo(x, y); pen.stroke();
        pen.fillText("xyz"[c], x + 8 * view[0][c] - 3, y - 8 * view[1][c] + 4);
      });
    }
    const now = () => mix(scene.time, +time.value)((t) => t);
    const told = () => { show(); setTime(scene.trajectory, now()); };
    clock.heard.push(() => {  // a plot was clicked
      if (clock.along !== scene.trajectory || Math.abs(clock.time - now()) < 1e-9) return;
      const last = scene.time.length - 1;
      let k = scene.time.findIndex((t) => t >= clock.time);
      if (k < 0) k = last;
      const a = Math.max(k - 1, 0), width = scene.time[k] - scene.time[a];
      time.value = width > 0 ? a + (clock.time - scene.time[a]) / width : k;
      show();
    });
    function frame(at) {
      if (!running) return;
      const step = Math.min(at - before, 100) / 1000, last = scene.time.length - 1;
      before = at;
      phase = (phase + 360 * step) % 360;
      time.value = last ? (+time.value + last * step / 10) % last : 0;
      told();
      requestAnimationFrame(frame);
    }
    function run(on) {
      if (on === running) return;
      running = on;
      play.textContent = on ? "Pause" : "Play";
      play.setAttribute("aria-pressed", on);
      if (on) { before = performance.now(); requestAnimationFrame(frame); }
    }
    pause = () => run(false);
    play.addEventListener("click", () => run(!running));
    [time, scale, modes, along].forEach((one) => one?.addEventListener("pointerdown", pause));
    addEventListener("keydown", (event) => { if (event.target !== play) pause(); });
    time.addEventListener("input", () => { pause(); told(); });
    [scale, modes].forEach((one) => one.addEventListener("input", () => { pause(); phase = 90; show(); }));
    along?.addEventListener("input", () => { pause(); time.value = 0; choose(); told(); });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      if (step) { event.preventDefault(); time.value = +time.value + step * (+time.max / 40); told(); }
    });
    canvas.addEventListener("pointerdown", (event) => {
      pause();
      if (middle.length < 3) return;
      canvas.setPointerCapture(event.pointerId);
      let [x, y] = [event.clientX, event.clientY];
      const turn = (move) => { view = rotated(view, 0.008 * (move.clientX - x), 0.008 * (move.clientY - y)); [x, y] = [move.clientX, move.clientY]; show(); };
      canvas.addEventListener("pointermove", turn);
      canvas.addEventListener("pointerup", () => canvas.removeEventListener("pointermove", turn), { once: true });
    });
    canvas.addEventListener("dblclick", () => { choose(); show(); });
    addEventListener("resize", show);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
    choose();
    told();
    new IntersectionObserver((entries) => {
      const there = entries[entries.length - 1].isIntersecting;
      if (!there) pause();
      else if (!still && !root.dataset.seen) { root.dataset.seen = "yes"; run(true); }
    }).observe(canvas);
  }
  function rotated(view, across, up) {  // z stays upright
    const high = Math.asin(Math.max(-1, Math.min(1, Math.hypot(view[1][0], view[1][1]) * -Math.sign(view[1][0] * -view[0][1] + view[1][1] * view[0][0])))) ;
    const azimuth = Math.atan2(-view[0][0], view[0][1]) - across;
    const elevation = Math.max(-1.5, Math.min(1.5, -high + up));
    const [c, s, low, tall] = [Math.cos(azimuth), Math.sin(azimuth), Math.sin(elevation), Math.cos(elevation)];
    return [[-s, c, 0], [-low * c, -low * s, tall]];
  }
  all("#motion-player").forEach(player);
  return { begin, setTime, csv };
})();
