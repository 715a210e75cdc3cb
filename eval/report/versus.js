// Two runs side by side: the same method's map in both, and where its error changed. One place is marked in all three.

const SAME_M = 0.1, SAME_SHARE = 0.1; // changes below both are drawn grey
const BETTER = "#0072b2", WORSE = "#d55e00"; // blue and vermilion, which the colour-blind tell apart
const PANE_MARGIN_PX = 14;

function startVersus(root) {
  const data = JSON.parse(root.querySelector("script").textContent), canvases = [...root.querySelectorAll("canvas")];
  const choice = root.querySelector(".choice"), scrub = root.querySelector(".scrub"), said = root.querySelector(".said"), places = root.querySelector(".places");
  let both = data.methods.at(-1), at = null;

  const changed = (i) => both.after_m[i] - both.before_m[i];
  const same = (i) => Math.abs(changed(i)) <= Math.max(SAME_M, SAME_SHARE * both.before_m[i]);

  /** Where a pane draws a vertex, and in which colour. */
  function vertex(pane, i, inks) {
    const [x, y] = pane === "before" ? [both.x_before_m[i], both.y_before_m[i]] : [both.x_after_m[i], both.y_after_m[i]];
    const colour = pane === "change" ? (same(i) ? inks.road : changed(i) < 0 ? BETTER : WORSE) : errorColour((pane === "before" ? both.before_m : both.after_m)[i]);
    return { x, y, colour, size: pane === "change" && !same(i) ? 4 : 2.6 };
  }

  function fit(canvas) {
    const w = canvas.clientWidth, h = canvas.clientHeight, xs = [both.x_before_m, both.x_after_m].flat(), ys = [both.y_before_m, both.y_after_m].flat();
    const [x0, y0] = [xs, ys].map((list) => list.reduce((a, b) => Math.min(a, b))), [x1, y1] = [xs, ys].map((list) => list.reduce((a, b) => Math.max(a, b)));
    const scale = Math.min((w - 2 * PANE_MARGIN_PX) / Math.max(x1 - x0, 1), (h - 2 * PANE_MARGIN_PX) / Math.max(y1 - y0, 1));
    return { w, h, X: (x) => w / 2 + scale * (x - (x0 + x1) / 2), Y: (y) => h / 2 - scale * (y - (y0 + y1) / 2) };
  }

  function paint(pen, canvas) {
    const { X, Y } = fit(canvas), pane = canvas.dataset.pane, inks = inksOf(canvas, ["road", "ink"]);
    pen.strokeStyle = inks.road;
    pen.lineWidth = 1;
    pen.beginPath();
    for (const road of data.roads) for (let i = 0; i < road.length; i += 2) pen[i ? "lineTo" : "moveTo"](X(road[i]), Y(road[i + 1]));
    pen.stroke();
    const order = both.t_s.map((_, i) => i);
    if (pane === "change") order.sort((a, b) => !same(a) - !same(b)); // what changed lies on top
    for (const i of order) {
      const { x, y, colour, size } = vertex(pane, i, inks);
      pen.fillStyle = colour;
      pen.beginPath();
      pen.arc(X(x), Y(y), size, 0, 2 * Math.PI);
      pen.fill();
    }
    if (at === null) return;
    const { x, y } = vertex(pane, at, inks);
    pen.strokeStyle = inks.ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(X(x), Y(y), 9, 0, 2 * Math.PI);
    pen.stroke();
  }

  function draw() {
    for (const canvas of canvases) {
      const ratio = window.devicePixelRatio || 1, pen = canvas.getContext("2d");
      if (!canvas.clientWidth) continue;
      [canvas.width, canvas.height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      paint(pen, canvas);
    }
  }

  function go(i) {
    at = i;
    scrub.value = i;
    const change = Math.abs(changed(i)), words = same(i) ? "the same" : `${metres(change)} ${changed(i) < 0 ? "better" : "worse"}`;
    said.textContent = `at ${both.t_s[i].toFixed(0)} s: A ${metres(both.before_m[i])}, B ${metres(both.after_m[i])}: ${words}`;
    scrub.setAttribute("aria-valuetext", said.textContent);
    draw();
  }

  function choose(name) {
    both = data.methods.find((one) => one.name === name);
    at = null;
    scrub.max = both.t_s.length - 1;
    const worse = both.t_s.filter((_, i) => !same(i) && changed(i) > 0).length, better = both.t_s.filter((_, i) => !same(i) && changed(i) < 0).length;
    said.textContent = `${better} of ${both.t_s.length} vertices better, ${worse} worse`;
    places.replaceChildren(...both.largest.filter((i) => !same(i)).map((i) => {
      const button = make("button", `${both.t_s[i].toFixed(0)} s: ${changed(i) < 0 ? "−" : "+"}${metres(Math.abs(changed(i)))}`, { type: "button" });
      button.addEventListener("click", () => go(i));
      return button;
    }));
    if (places.children.length) places.prepend(make("span", "Largest changes: "));
    draw();
  }

  for (const { name } of data.methods) choice.append(make("option", name, { value: name, selected: name === both.name }));
  choice.addEventListener("change", () => choose(choice.value));
  scrub.addEventListener("input", () => go(Number(scrub.value)));
  for (const canvas of canvases) canvas.addEventListener("click", (event) => {
    const { X, Y } = fit(canvas), box = canvas.getBoundingClientRect(), pane = canvas.dataset.pane, inks = inksOf(canvas, ["road"]);
    const gaps = both.t_s.map((_, i) => { const { x, y } = vertex(pane, i, inks); return Math.hypot(X(x) - (event.clientX - box.left), Y(y) - (event.clientY - box.top)); });
    go(gaps.indexOf(gaps.reduce((a, b) => Math.min(a, b))));
  });
  /** What the colours of the maps of A and B stand for. */
  function scale() {
    const strip = make("span", undefined, { className: "ramp" });
    strip.style.background = `linear-gradient(90deg, ${ramp().join(",")})`;
    root.querySelector(".versus-scale").replaceChildren("Error in A and B: ", `${LOWEST_M} m `, strip, ` ${HIGHEST_M} m`);
  }

  const town = root.closest("section").dataset.town;
  root.append(saveBox(canvases.map((canvas) => [`${town}, ${canvas.dataset.pane}`, () => onPaper(canvas, canvas, (svg) => paint(svg, canvas))])));
  choose(both.name);
  new ResizeObserver(draw).observe(root);
  dark.addEventListener("change", () => { scale(); draw(); });
  scale();
}

for (const root of document.querySelectorAll(".versus")) startVersus(root);
