const linear = (v) => v <= .03928 * 255 ? v / 255 / 12.92 : ((v / 255 + .055) / 1.055) ** 2.4;
const luminance = ([r, g, b]) => .2126 * linear(r) + .7152 * linear(g) + .0722 * linear(b);
const parse = (text) => text.match(/[\d.]+/g).map(Number);
const found = [];
const tags = "h1, h2, h3, p, a, td, th, li, dt, dd, span, strong, summary, button, label, output," +
  "figcaption, caption";
for (const e of document.querySelectorAll(tags)) {
  if (!e.offsetParent) continue;
  if (![...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim())) continue;
  let back = e, colour = [255, 255, 255, 0];
  while (back) {
    const c = parse(getComputedStyle(back).backgroundColor);
    if (c.length < 4 || c[3] > .99) { colour = c; break; }
    back = back.parentElement;
  }
  const own = luminance(parse(getComputedStyle(e).color));
  const [a, b] = [own, luminance(colour)].sort((x, y) => y - x);
  const ratio = (a + .05) / (b + .05);
  if (ratio < 4.5) found.push([e.tagName, e.textContent.trim().slice(0, 40), ratio]);
}
return found;
