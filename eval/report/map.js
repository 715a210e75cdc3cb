// The interactive map of a town: layers to switch, vertices to step through, a view to move with pointer, fingers and keys.

function startMap(root) {
  const data = JSON.parse(root.querySelector("script").textContent), layers = mapLayers(data);
  const stage = root.querySelector(".stage"), canvas = root.querySelector("canvas"), tip = root.querySelector(".tip");
  const tile = root.querySelector(".side > .tile"), words = root.querySelector(".vertex"), scrub = root.querySelector(".scrub");
  const byError = root.querySelector(".by-error"), look = { hovered: null, chosen: null, byError: () => byError.checked };
  const view = makeMapView(root, data, layers, look);

  function describe({ layer, i }) {
    const error = layer.path.error_m[i], seconds = layer.path.t_s[i].toFixed(1);
    const what = layer.kind === "drive" ? `step at ${seconds} s` : `vertex ${i} at ${seconds} s`;
    return `${layer.name}\n${what}\n${error === null ? "no truth near" : `${layer.kind === "drive" ? "error" : "APE"} ${error.toFixed(2)} m`}`;
  }

  function choose(spot) {
    look.chosen = spot;
    if (!spot) return view.redraw();
    const { layer, i } = spot;
    words.textContent = describe(spot);
    const drawn = layer.kind === "vertices" && tile;
    if (tile) tile.hidden = !drawn;
    if (drawn) showFrame(layer.path.t_s[i]);
    if (layer.kind === "vertices") { scrub.max = layer.path.t_s.length - 1; scrub.value = i; }
    view.redraw();
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
    const chosen = look.chosen;
    layer = layer || (chosen && chosen.layer.kind === "vertices" ? chosen.layer : layers.filter((one) => one.kind === "vertices").at(-1));
    if (!layer) return;
    choose({ layer, i: Math.min(Math.max(i, 0), layer.path.t_s.length - 1) });
  }

  function setUpControls() {
    const box = root.querySelector(".layers");
    for (const layer of [...layers.slice(0, 2), ...layers.slice(2).reverse()]) { // in the order of the tables
      const label = make("label"), input = make("input", undefined, { type: "checkbox", checked: layer.shown });
      const swatch = make("span", undefined, { className: "swatch" });
      layer.swatch = swatch;
      input.addEventListener("change", () => { layer.shown = input.checked; view.redraw(); });
      layer.input = input;
      label.append(input, swatch, layer.name);
      box.append(label);
    }
    byError.addEventListener("change", () => { colourSwatches(); view.redraw(); });
    scrub.addEventListener("input", () => go(Number(scrub.value)));
    const vertices = layers.filter((one) => one.kind === "vertices").at(-1);
    if (vertices) scrub.max = vertices.path.t_s.length - 1;
    for (const button of root.querySelectorAll("[data-zoom]")) button.addEventListener("click", () => {
      if (button.dataset.zoom === "fit") view.showAll();
      else view.zoom(button.dataset.zoom === "in" ? 1.5 : 1 / 1.5, stage.clientWidth / 2, stage.clientHeight / 2);
    });
    root.querySelector(".side").append(saveBox([[`map of ${root.closest("section").dataset.town}`, () => view.vector()]]));
    colourBar();
  }

  /** The signs beside the names have the colours that are seen on the map: those of the errors, if vertices are coloured by them. */
  function colourSwatches() {
    for (const layer of layers) {
      const own = layer.colour || `var(--${layer.kind === "roads" ? "road" : "truth"})`, ringed = layer.kind === "vertices" && byError.checked;
      layer.swatch.classList.toggle("ringed", ringed);
      layer.swatch.style.borderColor = own;
      layer.swatch.style.background = ringed ? `linear-gradient(90deg, ${ramp().join(",")}) padding-box` : own;
    }
  }

  function colourBar() {
    const strip = make("div", undefined, { className: "ramp" }), ends = make("div", undefined, { className: "ends" });
    colourSwatches();
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
      else if (moved > 4) { view.pan(x - last[0], y - last[1]); canvas.classList.add("dragging"); }
      down.set(event.pointerId, [x, y]);
    });
    function pinch(moving, now) {
      const still = [...down].find(([id]) => id !== moving)[1], last = down.get(moving);
      const gap = (at) => Math.max(Math.hypot(at[0] - still[0], at[1] - still[1]), 1);
      view.zoom(gap(now) / gap(last), ...still);
    }
    function release(event) {
      if (event.type === "pointerup" && down.size === 1 && moved <= 4) choose(view.pick(...place(event)) || look.chosen);
      down.delete(event.pointerId);
      canvas.classList.remove("dragging");
    }
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("pointerleave", () => hover(-1e6, -1e6));
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== canvas) return; // the page scrolls until the map is clicked
      event.preventDefault();
      view.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), ...place(event));
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1, ArrowUp: 10, ArrowDown: -10 }[event.key];
      if (!step) return;
      event.preventDefault();
      go((look.chosen ? look.chosen.i : -1) + step);
    });
  }

  function hover(x, y) {
    const spot = view.pick(x, y), last = look.hovered;
    tip.hidden = !spot;
    if (spot) {
      tip.textContent = describe(spot).split("\n").join(" · ");
      tip.style.left = `${Math.max(4, Math.min(x + 14, stage.clientWidth - tip.offsetWidth - 6))}px`;
      tip.style.top = `${Math.max(y - 36, 4)}px`;
    }
    look.hovered = spot;
    if (spot?.layer !== last?.layer || spot?.i !== last?.i) view.redraw();
  }

  setUpControls();
  setUpPointers();
  new ResizeObserver(view.resize).observe(stage);
  dark.addEventListener("change", () => { colourBar(); view.redraw(); });
  root.dataset.ready = "yes";

  /** Show one vertex of a method from elsewhere on the page. */
  return (method, i) => {
    const layer = layers.find((one) => one.kind === "vertices" && one.name === method);
    if (!layer) return;
    layer.shown = layer.input.checked = true;
    go(i, layer);
    view.centre(layer.path.x_m[i], layer.path.y_m[i], 4); // px a metre: a street fills the map
    root.scrollIntoView({ block: "center" });
  };
}

for (const root of document.querySelectorAll(".map")) {
  const show = startMap(root);
  for (const button of root.closest("section").querySelectorAll(".goto")) {
    button.addEventListener("click", () => show(button.dataset.method, Number(button.dataset.vertex)));
  }
}
