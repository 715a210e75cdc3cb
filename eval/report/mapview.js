// What the interactive map shows: its layers drawn in the reader's own view, which can be moved and zoomed.

const REACH_PX = 18; // a finger's reach around a vertex

function mapLayers(data) {
  return [
    { name: "roads", kind: "roads", shown: true },
    { name: "ground truth", kind: "truth", shown: true },
    ...data.methods.map((path, i) => ({ name: path.name, kind: "vertices", path, colour: COLOURS[i % COLOURS.length],
      shown: path.name === "semi-metric" || i === data.methods.length - 1 })),
    ...data.drives.map((path, i) => ({ name: `second drive in ${path.name}`, kind: "drive", path, colour: DRIVE_COLOURS[(data.drives.length - 1 - i) % DRIVE_COLOURS.length], shown: false })),
  ];
}

/** The picture of a map; ``look`` holds what is marked: hovered, chosen, and whether vertices are coloured by their error. */
function makeMapView(root, data, layers, look) {
  const stage = root.querySelector(".stage"), canvas = root.querySelector("canvas"), bar = root.querySelector(".scalebar");
  const bounds = truthBounds();
  let pen = canvas.getContext("2d"), view = null, fitted = true, size = [0, 0], waiting = false, inks = null;

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
    paintAll();
    const [length, words] = scale();
    bar.style.width = `${length * view.scale}px`;
    bar.textContent = words;
  }

  function paintAll() {
    inks = inksOf(root, ["road", "truth", "soft", "bad", "accent"]);
    for (const layer of layers) if (layer.shown) paint(layer);
    for (const spot of [look.hovered, look.chosen]) if (spot) mark(spot);
  }

  function paint(layer) {
    if (layer.kind === "roads") {
      line(inks.road, 1, () => data.roads.forEach((road) => {
        for (let i = 0; i < road.length; i += 2) stroke(i, road[i], road[i + 1]);
      }));
    } else if (layer.kind === "truth") {
      line(inks.truth, 1.4, () => data.truth.t_s.forEach((_, i) => stroke(i, data.truth.x_m[i], data.truth.y_m[i])));
    } else if (layer.kind === "drive") {
      dots(layer, 0.85 * radius(), (i) => layer.path.localized[i] ? layer.colour : inks.soft);
    } else {
      if (look.byError() && layers.filter((one) => one.kind === "vertices" && one.shown).length > 1) dots(layer, 1.35 * radius(), () => layer.colour); // rims tell maps apart
      dots(layer, radius(), (i) => look.byError() && layer.path.error_m[i] !== null ? errorColour(layer.path.error_m[i]) : layer.colour);
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
  function mark({ layer, i }) {
    const [x, y] = screen(layer.path.x_m[i], layer.path.y_m[i]);
    if (layer.kind === "vertices") {
      const at = placeAt(data.truth, layer.path.t_s[i]);
      line(inks.bad, 1.6, () => { stroke(0, layer.path.x_m[i], layer.path.y_m[i]); stroke(1, ...at); });
    }
    line(inks.accent, 2.4, () => pen.arc(x, y, 7, 0, 2 * Math.PI));
  }

  /** Length in metres of the bar that tells the scale, and what stands above it. */
  function scale() {
    const wanted = 110 / view.scale, power = 10 ** Math.floor(Math.log10(wanted));
    const length = [5, 2, 1].map((m) => m * power).find((m) => m <= wanted) || power;
    return [length, length >= 1000 ? `${length / 1000} km` : `${length} m`];
  }

  function redraw() {
    if (!waiting) { waiting = true; requestAnimationFrame(draw); }
  }

  return {
    redraw,
    get scale() { return view.scale; },
    showAll() { view = null; redraw(); },
    /** The vertex within reach of a place on the screen, the nearest of all layers shown. */
    pick(px, py) {
      let best = null, reach = REACH_PX ** 2;
      for (const layer of layers) {
        if (!layer.shown || !layer.path) continue;
        layer.path.t_s.forEach((_, i) => {
          const [x, y] = screen(layer.path.x_m[i], layer.path.y_m[i]), gap = (x - px) ** 2 + (y - py) ** 2;
          if (gap <= reach) { reach = gap; best = { layer, i }; }
        });
      }
      return best;
    },
    zoom(factor, x, y) {
      fitted = false;
      view = { scale: view.scale * factor, x: x + (view.x - x) * factor, y: y + (view.y - y) * factor };
      redraw();
    },
    pan(x, y) {
      fitted = false;
      view = { ...view, x: view.x + x, y: view.y + y };
      redraw();
    },
    /** Put a place in metres into the middle, at least so large that a metre takes ``least`` pixels. */
    centre(x_m, y_m, least) {
      if (!view) fit();
      fitted = false;
      const wanted = Math.max(view.scale, least);
      view = { scale: wanted, x: stage.clientWidth / 2 - wanted * x_m, y: stage.clientHeight / 2 + wanted * y_m };
      redraw();
    },
    /** Show all again, or keep the middle of what the reader has moved to. */
    resize() {
      const [w, h] = size;
      size = [stage.clientWidth, stage.clientHeight];
      if (fitted || !view) view = null;
      else view = { ...view, x: view.x + (size[0] - w) / 2, y: view.y + (size[1] - h) / 2 };
      draw();
    },
    /** What is seen now as SVG, with the bar that tells the scale. */
    vector() {
      return onPaper(root, canvas, (svg) => {
        const screenPen = pen, [length, words] = scale(), y = stage.clientHeight - 14;
        pen = svg;
        paintAll();
        line(inks.soft, 2, () => { svg.moveTo(14, y); svg.lineTo(14 + length * view.scale, y); });
        svg.fillStyle = inks.soft;
        svg.font = "12px sans-serif";
        svg.fillText(words, 14, y - 6);
        pen = screenPen;
      });
    },
  };
}
