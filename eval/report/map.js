"use strict";
// The interactive maps of the report. No library, no network; text enters the page as textContent only.

const COLOURS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"]; // Okabe and Ito, as in the figures
const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const LOWEST_M = 0.1, HIGHEST_M = 100; // of the colour scale, the same on every map so that they compare
const REACH_PX = 18; // a finger's reach around a vertex
const dark = matchMedia("(prefers-color-scheme: dark)");

function make(name, text, properties) {
  return Object.assign(document.createElement(name), text === undefined ? {} : { textContent: text }, properties);
}

/** Large errors stand out: dark on white, bright on black. */
function ramp() {
  return dark.matches ? VIRIDIS : [...VIRIDIS].reverse();
}

function errorColour(error) {
  const share = Math.log(Math.max(error, LOWEST_M) / LOWEST_M) / Math.log(HIGHEST_M / LOWEST_M);
  const colours = ramp();
  return colours[Math.min(colours.length - 1, Math.floor(share * colours.length))];
}

/** Index of the last time not after t, in an ascending list. */
function before(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

function nearestInTime(times, t) {
  const i = before(times, t);
  return i + 1 < times.length && times[i + 1] - t < t - times[i] ? i + 1 : i;
}

function startMap(root) {
  const data = JSON.parse(root.querySelector("script").textContent);
  const stage = root.querySelector(".stage"), canvas = root.querySelector("canvas"), pen = canvas.getContext("2d");
  const tip = root.querySelector(".tip"), tile = root.querySelector(".tile"), words = root.querySelector(".vertex");
  const scrub = root.querySelector(".scrub"), byError = root.querySelector(".by-error");
  const layers = [
    { name: "roads", kind: "roads", shown: true },
    { name: "ground truth", kind: "truth", shown: true },
    ...data.methods.map((path, i) => ({ name: path.name, kind: "vertices", path, colour: COLOURS[i % COLOURS.length],
      shown: path.name === "semi-metric" || i === data.methods.length - 1 })),
    ...data.drives.map((path) => ({ name: `second drive in ${path.name}`, kind: "drive", path, colour: COLOURS[5], shown: false })),
  ];
  const bounds = truthBounds();
  let view = null, fitted = true, size = [0, 0], hovered = null, chosen = null, waiting = false;

  function truthBounds() {
    const { x_m: xs, y_m: ys } = data.truth;
    const least = (list) => list.reduce((a, b) => Math.min(a, b), Infinity);
    const most = (list) => list.reduce((a, b) => Math.max(a, b), -Infinity);
    return xs.length ? [least(xs), least(ys), most(xs), most(ys)] : [0, 0, 1, 1];
  }

  function fit() {
    const [x0, y0, x1, y1] = bounds, w = stage.clientWidth, h = stage.clientHeight;
    fitted = true;
    const scale = 0.86 * Math.min(w / Math.max(x1 - x0, 1), h / Math.max(y1 - y0, 1));
    view = { scale, x: w / 2 - scale * (x0 + x1) / 2, y: h / 2 + scale * (y0 + y1) / 2 };
  }

  const screen = (x, y) => [view.x + view.scale * x, view.y - view.scale * y];

  function draw() {
    waiting = false;
    const w = stage.clientWidth, h = stage.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!w || !h) return;
    if (!view) fit();
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    const style = getComputedStyle(root);
    for (const layer of layers) if (layer.shown) paint(layer, style);
    for (const spot of [hovered, chosen]) if (spot) mark(spot, style);
    drawScale();
  }

  function paint(layer, style) {
    if (layer.kind === "roads") {
      line(style.getPropertyValue("--road"), 1, () => data.roads.forEach((road) => {
        for (let i = 0; i < road.length; i += 2) stroke(i, road[i], road[i + 1]);
      }));
    } else if (layer.kind === "truth") {
      line(style.getPropertyValue("--truth"), 1.4, () => data.truth.t_s.forEach((_, i) => stroke(i, data.truth.x_m[i], data.truth.y_m[i])));
    } else if (layer.kind === "drive") {
      dots(layer, 0.85 * radius(), (i) => layer.path.localized[i] ? layer.colour : style.getPropertyValue("--soft"));
    } else {
      dots(layer, radius(), (i) => byError.checked && layer.path.error_m[i] !== null ? errorColour(layer.path.error_m[i]) : layer.colour);
    }
  }

  /** Vertices lie some 5 m apart: dots that nearly touch, and can be told apart once zoomed in. */
  function radius() {
    return Math.min(Math.max(1.4 * view.scale, 1.6), 5);
  }

  function line(colour, width, path) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.lineJoin = "round";
    pen.beginPath();
    path();
    pen.stroke();
  }

  function stroke(i, x, y) {
    if (i === 0) pen.moveTo(...screen(x, y)); else pen.lineTo(...screen(x, y));
  }

  function dots(layer, size, colour) {
    layer.path.t_s.forEach((_, i) => {
      const [x, y] = screen(layer.path.x_m[i], layer.path.y_m[i]);
      pen.fillStyle = colour(i);
      pen.beginPath();
      pen.arc(x, y, size, 0, 2 * Math.PI);
      pen.fill();
    });
  }

  /** A ring around a vertex, and a line to where the car truly was. */
  function mark({ layer, i }, style) {
    const [x, y] = screen(layer.path.x_m[i], layer.path.y_m[i]);
    if (layer.kind === "vertices") {
      const at = truthAt(layer.path.t_s[i]);
      line(style.getPropertyValue("--bad"), 1.6, () => { stroke(0, layer.path.x_m[i], layer.path.y_m[i]); stroke(1, ...at); });
    }
    line(style.getPropertyValue("--accent"), 2.4, () => pen.arc(x, y, 7, 0, 2 * Math.PI));
  }

  function truthAt(t) {
    const { t_s: times, x_m: xs, y_m: ys } = data.truth, i = before(times, t), j = Math.min(i + 1, times.length - 1);
    const share = j > i ? Math.min(1, Math.max(0, (t - times[i]) / (times[j] - times[i]))) : 0;
    return [xs[i] + share * (xs[j] - xs[i]), ys[i] + share * (ys[j] - ys[i])];
  }

  function drawScale() {
    const wanted = 110 / view.scale, power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((m) => m * power).find((m) => m <= wanted) || power;
    const bar = root.querySelector(".scalebar");
    bar.style.width = `${length * view.scale}px`;
    bar.textContent = length >= 1000 ? `${length / 1000} km` : `${length} m`;
  }

  function redraw() {
    if (!waiting) { waiting = true; requestAnimationFrame(draw); }
  }

  /** The vertex within reach of a place on the screen, the nearest of all layers shown. */
  function pick(px, py) {
    let best = null, reach = REACH_PX ** 2;
    for (const layer of layers) {
      if (!layer.shown || !layer.path) continue;
      layer.path.t_s.forEach((_, i) => {
        const [x, y] = screen(layer.path.x_m[i], layer.path.y_m[i]), gap = (x - px) ** 2 + (y - py) ** 2;
        if (gap <= reach) { reach = gap; best = { layer, i }; }
      });
    }
    return best;
  }

  function describe({ layer, i }) {
    const error = layer.path.error_m[i], seconds = layer.path.t_s[i].toFixed(1);
    const what = layer.kind === "drive" ? `step at ${seconds} s` : `vertex ${i} at ${seconds} s`;
    return `${layer.name}\n${what}\n${error === null ? "no truth near" : `${layer.kind === "drive" ? "error" : "APE"} ${error.toFixed(2)} m`}`;
  }

  function choose(spot) {
    chosen = spot;
    if (!spot) return redraw();
    const { layer, i } = spot;
    words.textContent = describe(spot);
    const drawn = layer.kind === "vertices" && tile;
    if (tile) tile.hidden = !drawn;
    if (drawn) showFrame(layer.path.t_s[i]);
    if (layer.kind === "vertices") { scrub.max = layer.path.t_s.length - 1; scrub.value = i; }
    redraw();
  }

  function showFrame(t) {
    const { t_s: times, columns } = data.thumbnails, number = nearestInTime(times, t), label = `camera frame at ${times[number].toFixed(1)} s`;
    tile.style.setProperty("--column", number % columns);
    tile.style.setProperty("--row", Math.floor(number / columns));
    tile.setAttribute("aria-label", label);
    words.textContent += `\n${label}`;
  }

  /** Step through the vertices of the chosen method, else of the last one. */
  function go(i, layer) {
    layer = layer || (chosen && chosen.layer.kind === "vertices" ? chosen.layer : layers.filter((one) => one.kind === "vertices").at(-1));
    if (!layer) return;
    choose({ layer, i: Math.min(Math.max(i, 0), layer.path.t_s.length - 1) });
  }

  function zoom(factor, x, y) {
    fitted = false;
    view = { scale: view.scale * factor, x: x + (view.x - x) * factor, y: y + (view.y - y) * factor };
    redraw();
  }

  function setUpControls() {
    const box = root.querySelector(".layers");
    for (const layer of layers) {
      const label = make("label"), input = make("input", undefined, { type: "checkbox", checked: layer.shown });
      const swatch = make("span", undefined, { className: "swatch" });
      swatch.style.background = layer.colour || `var(--${layer.kind === "roads" ? "road" : "truth"})`;
      input.addEventListener("change", () => { layer.shown = input.checked; redraw(); });
      layer.input = input;
      label.append(input, swatch, layer.name);
      box.append(label);
    }
    byError.addEventListener("change", redraw);
    scrub.addEventListener("input", () => go(Number(scrub.value)));
    const vertices = layers.filter((one) => one.kind === "vertices").at(-1);
    if (vertices) scrub.max = vertices.path.t_s.length - 1;
    for (const button of root.querySelectorAll("[data-zoom]")) button.addEventListener("click", () => {
      if (button.dataset.zoom === "fit") { view = null; redraw(); }
      else zoom(button.dataset.zoom === "in" ? 1.5 : 1 / 1.5, stage.clientWidth / 2, stage.clientHeight / 2);
    });
    colourBar();
  }

  function colourBar() {
    const strip = make("div", undefined, { className: "ramp" }), ends = make("div", undefined, { className: "ends" });
    strip.style.background = `linear-gradient(90deg, ${ramp().join(",")})`;
    ends.append(...[`${LOWEST_M} m`, "1 m", "10 m", `${HIGHEST_M} m`].map((text) => make("span", text)));
    root.querySelector(".colourbar").replaceChildren(strip, ends);
  }

  function setUpPointers() {
    const down = new Map();
    let moved = 0;
    const place = (event) => { const box = canvas.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      down.set(event.pointerId, place(event));
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const [x, y] = place(event), last = down.get(event.pointerId);
      if (!last) return hover(x, y);
      moved += Math.hypot(x - last[0], y - last[1]);
      if (down.size === 2) pinch(event.pointerId, [x, y]);
      else if (moved > 4) { fitted = false; view.x += x - last[0]; view.y += y - last[1]; canvas.classList.add("dragging"); redraw(); }
      down.set(event.pointerId, [x, y]);
    });
    function pinch(moving, now) {
      const still = [...down].find(([id]) => id !== moving)[1], last = down.get(moving);
      const gap = (at) => Math.max(Math.hypot(at[0] - still[0], at[1] - still[1]), 1);
      zoom(gap(now) / gap(last), ...still);
    }
    function release(event) {
      if (event.type === "pointerup" && down.size === 1 && moved <= 4) choose(pick(...place(event)) || chosen);
      down.delete(event.pointerId);
      canvas.classList.remove("dragging");
    }
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => hover(-1e6, -1e6));
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return; // the page scrolls until the map is clicked
      event.preventDefault();
      zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), ...place(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1, ArrowUp: 10, ArrowDown: -10 }[event.key];
      if (!step) return;
      event.preventDefault();
      go((chosen ? chosen.i : -1) + step);
    });
  }

  /** Show all again, or keep the middle of what the reader has moved to. */
  function resize() {
    const [w, h] = size;
    size = [stage.clientWidth, stage.clientHeight];
    if (fitted || !view) view = null;
    else view = { ...view, x: view.x + (size[0] - w) / 2, y: view.y + (size[1] - h) / 2 };
    draw();
  }

  function hover(x, y) {
    const spot = pick(x, y);
    tip.hidden = !spot;
    if (spot) {
      tip.textContent = describe(spot).split("\n").join(" · ");
      tip.style.left = `${Math.max(4, Math.min(x + 14, stage.clientWidth - tip.offsetWidth - 6))}px`;
      tip.style.top = `${Math.max(y - 36, 4)}px`;
    }
    if (spot?.layer !== hovered?.layer || spot?.i !== hovered?.i) { hovered = spot; redraw(); }
  }

  setUpControls();
  setUpPointers();
  new ResizeObserver(resize).observe(stage);
  dark.addEventListener("change", () => { colourBar(); redraw(); });
  root.dataset.ready = "yes";

  /** Show one vertex of a method from elsewhere on the page. */
  return (method, i) => {
    const layer = layers.find((one) => one.kind === "vertices" && one.name === method);
    if (!layer) return;
    layer.shown = layer.input.checked = true;
    go(i, layer);
    if (!view) fit();
    fitted = false;
    const wanted = Math.max(view.scale, 4); // px a metre: a street fills the map
    view = { scale: wanted, x: stage.clientWidth / 2 - wanted * layer.path.x_m[i], y: stage.clientHeight / 2 + wanted * layer.path.y_m[i] };
    root.scrollIntoView({ block: "center" });
    redraw();
  };
}

for (const root of document.querySelectorAll(".map")) {
  const show = startMap(root);
  for (const button of root.closest("section").querySelectorAll(".goto")) {
    button.addEventListener("click", () => show(button.dataset.method, Number(button.dataset.vertex)));
  }
}

const dialog = document.querySelector("dialog");
for (const button of document.querySelectorAll(".enlarge")) button.addEventListener("click", () => {
  dialog.querySelector("img").src = button.querySelector("img").src;
  dialog.querySelector("img").alt = button.querySelector("img").alt;
  dialog.showModal();
});
dialog.querySelector("button").addEventListener("click", () => dialog.close());
