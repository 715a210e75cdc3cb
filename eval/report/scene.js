// The player's map: one moment of a story, drawn. Roads and truth are drawn once per view and copied afterwards.

const HEAD_PX = 62, FOOT_PX = 30; // above and below a large map, for its words and its legend
const NARROW_PX = 520, NARROW_HEAD_PX = 78, NARROW_FOOT_PX = 66; // on a phone both take more lines
const MODULE_COLOURS = ["#cc79a7", "#0072b2", "#d55e00"]; // of the grid modules' places
const INFORMED = 5; // reliability in 1/rad^2 below which a module's phase means nothing
const showModules = { on: true };
const ANYWHERE_M = 150; // half axis of a belief that covers a town: drawn as a veil over all of it

function storyBounds(story) {
  const second = story.second ? [story.second.truth, ...story.second.beliefs.filter((one) => story.choices.includes(one.name)).map(localizedPart)] : [];
  const paths = [story.data.truth, story.semi, ...story.refined, ...second].filter((path) => path && path.t_s.length);
  const all = (key, pick) => paths.reduce((worst, path) => path[key].reduce((a, b) => pick(a, b), worst), pick === Math.min ? Infinity : -Infinity);
  return paths.length ? [all("x_m", Math.min), all("y_m", Math.min), all("x_m", Math.max), all("y_m", Math.max)] : [0, 0, 1, 1];
}

/** What a localizer said from its first fix on: before, its guesses may lie anywhere. */
function localizedPart(drive) {
  const kept = drive.t_s.flatMap((_, i) => (drive.localized[i] ? [i] : []));
  return { t_s: kept, x_m: kept.map((i) => drive.x_m[i]), y_m: kept.map((i) => drive.y_m[i]) };
}

function makeScene(canvas, story) {
  let pen = canvas.getContext("2d");
  const still = document.createElement("canvas"), bounds = storyBounds(story);
  let view = null, inks = null;
  const X = (x) => view.x + view.scale * x, Y = (y) => view.y - view.scale * y;

  /** Room for words above and below the map. */
  function margins(w) {
    if (!canvas.matches(".scene")) return [0, 0];
    return w < NARROW_PX ? [NARROW_HEAD_PX, NARROW_FOOT_PX] : [HEAD_PX, FOOT_PX];
  }

  function resize() {
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!w || !h) return (view = null);
    const [x0, y0, x1, y1] = bounds, [head, foot] = margins(w), room = h - head - foot;
    const scale = 0.9 * Math.min(w / Math.max(x1 - x0, 1), room / Math.max(y1 - y0, 1));
    view = { w, h, ratio, scale, x: w / 2 - scale * (x0 + x1) / 2, y: head + room / 2 + scale * (y0 + y1) / 2 };
    inks = inksOf(canvas, ["road", "truth", "soft", "accent", "bad", "good", "paper", "ink"]);
    for (const one of [canvas, still]) { one.width = Math.round(w * ratio); one.height = Math.round(h * ratio); }
    drawStill(still.getContext("2d"));
    return view;
  }

  function drawStill(on) {
    on.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
    on.lineJoin = on.lineCap = "round";
    on.strokeStyle = inks.road;
    on.lineWidth = Math.min(Math.max(2.6 * view.scale, 1), 6);
    on.beginPath();
    for (const road of story.data.roads) for (let i = 0; i < road.length; i += 2) on[i ? "lineTo" : "moveTo"](X(road[i]), Y(road[i + 1]));
    on.stroke();
  }

  /** The path up to a time, as a line. */
  function trail(path, t, colour, width, from = -Infinity) {
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.beginPath();
    let begun = false;
    for (let i = 0; i < path.t_s.length && path.t_s[i] <= t; i++) {
      if (path.t_s[i] < from) continue;
      pen[begun ? "lineTo" : "moveTo"](X(path.x_m[i]), Y(path.y_m[i]));
      begun = true;
    }
    pen.stroke();
  }

  /** Vertices as dots; place(i) gives where, colour(i) its colour. Dots of one colour are filled together. */
  function dots(count, place, colour, size) {
    const groups = new Map();
    for (let i = 0; i < count; i++) {
      const key = colour(i);
      if (!groups.has(key)) groups.set(key, []);
      groups.get(key).push(i);
    }
    for (const [key, members] of groups) {
      pen.fillStyle = key;
      pen.beginPath();
      for (const i of members) {
        const [x, y] = place(i);
        pen.moveTo(X(x) + size, Y(y));
        pen.arc(X(x), Y(y), size, 0, 2 * Math.PI);
      }
      pen.fill();
    }
  }

  function disc(x, y, size, fill, edge) {
    pen.beginPath();
    pen.arc(X(x), Y(y), size, 0, 2 * Math.PI);
    pen.fillStyle = fill;
    pen.fill();
    pen.lineWidth = 2;
    pen.strokeStyle = edge;
    pen.stroke();
  }

  function link(from, to, colour) {
    pen.strokeStyle = colour;
    pen.lineWidth = 1.4;
    pen.setLineDash([4, 3]);
    pen.beginPath();
    pen.moveTo(X(from[0]), Y(from[1]));
    pen.lineTo(X(to[0]), Y(to[1]));
    pen.stroke();
    pen.setLineDash([]);
  }

  const dotSize = () => Math.min(Math.max(1.3 * view.scale, 1.7), 4);

  /** The first drive: the semi-metric map grows from its vertices, beside where the car truly is. */
  function drawMapping(t) {
    const { data, semi } = story;
    trail(data.truth, t, inks.truth, 1.6);
    const now = placeAt(data.truth, t);
    if (semi && semi.t_s.length && semi.t_s[0] <= t) {
      dots(before(semi.t_s, t) + 1, (i) => [semi.x_m[i], semi.y_m[i]], () => story.colours[semi.name], dotSize());
      const mapped = placeAt(semi, t);
      link(mapped, now, inks.bad);
      disc(...mapped, 5, story.colours[semi.name], inks.paper);
    }
    disc(...now, 5, inks.truth, inks.paper);
  }

  /** The first drive once more in a finished map: its vertices by their errors, and how far off it is where the car passes. */
  function drawFinished(t, layer) {
    trail(story.data.truth, t, inks.truth, 1.6);
    dots(layer.t_s.length, (i) => [layer.x_m[i], layer.y_m[i]], (i) => (layer.error_m[i] === null ? inks.soft : errorColour(layer.error_m[i])), dotSize());
    const now = placeAt(story.data.truth, t), mapped = placeAt(layer, t);
    link(mapped, now, inks.bad);
    disc(...mapped, 5, story.colours[layer.name], inks.paper);
    disc(...now, 5, inks.truth, inks.paper);
  }

  /** The map comes right: every vertex moves from its semi-metric place to its place on the roads, the first ones first. */
  function drawRoads(share, layer) {
    const { semi } = story, moving = semi && semi.t_s.length === layer.t_s.length, count = layer.t_s.length;
    trail(story.data.truth, Infinity, inks.truth, 1);
    const eased = (i) => { const u = Math.min(1, Math.max(0, 1.8 * share - 0.8 * i / count)); return u * u * (3 - 2 * u); };
    const place = (i) => {
      const u = moving ? eased(i) : 1, from = moving ? semi : layer;
      return [from.x_m[i] + u * (layer.x_m[i] - from.x_m[i]), from.y_m[i] + u * (layer.y_m[i] - from.y_m[i])];
    };
    dots(count, place, (i) => (!moving || eased(i) > 0.97) && layer.error_m[i] !== null ? errorColour(layer.error_m[i]) : story.colours[moving ? semi.name : layer.name], dotSize());
  }

  function drawVeil(colour, strength) {
    pen.globalAlpha = strength;
    pen.fillStyle = colour;
    pen.fillRect(0, 0, view.w, view.h);
    pen.globalAlpha = 1;
  }

  /** The second drive in the finished map: the belief with its ellipse, from anywhere to the fix. */
  function drawSecond(t, layer, drive) {
    dots(layer.t_s.length, (i) => [layer.x_m[i], layer.y_m[i]], () => inks.soft, 0.6 * dotSize());
    const i = before(drive.t_s, t), known = drive.localized[i], colour = known ? inks.good : inks.bad;
    const truth = story.second && story.second.truth;
    if (truth && truth.t_s.length) trail(truth, t, inks.truth, 1.8);
    const first = drive.localized.indexOf(true);
    if (first >= 0 && drive.t_s[first] <= t) trail(drive, t, story.colours[layer.name], 3, drive.t_s[first]);
    const stated = drive.covariance_m2 && drive.covariance_m2[i], spread = stated && ellipseOf(stated);
    if (!known && (!spread || spread.a > ANYWHERE_M)) drawVeil(colour, 0.13);
    else if (spread) drawEllipse([drive.x_m[i], drive.y_m[i]], spread, colour);
    const whole = canvas.matches(".scene"), view_m = drive.view_m && drive.view_m[i]; // a card has no legend for all signs
    if (whole && view_m) {
      pen.strokeStyle = inks.accent;
      pen.lineWidth = 2;
      pen.strokeRect(X(view_m[0]) - 6, Y(view_m[1]) - 6, 12, 12);
    }
    if (truth && truth.t_s.length) disc(...placeAt(truth, t), 5, inks.truth, inks.paper);
    if (whole && showModules.on) drawModules(drive, i);
    if (known) arrow(drive, i, placeAt(drive, t), colour);
  }

  /** Where each grid module alone says that the car may be: the same place once a period, in each direction. */
  function drawModules(drive, i) {
    const periods = drive.periods_m || [], phases = drive.grid_rad ? drive.grid_rad[i] : [];
    if (phases.length !== 4 * periods.length) return;
    const [x0, y0, x1, y1] = bounds;
    periods.forEach((period, module) => {
      const sure = drive.grid_reliability[i].slice(4 * module, 4 * module + 4), population = sure[0] >= sure[2] ? 0 : 1; // the surer one
      if (!(Math.min(sure[2 * population], sure[2 * population + 1]) > INFORMED)) return;
      const places = [0, 1].map((axis) => {
        const [low, high] = axis ? [y0, y1] : [x0, x1], offset = (phases[4 * module + 2 * population + axis] / (2 * Math.PI)) * period, found = [];
        for (let at = offset + Math.ceil((low - offset) / period) * period; at <= high; at += period) found.push(at);
        return found;
      });
      pen.strokeStyle = MODULE_COLOURS[module % MODULE_COLOURS.length];
      pen.lineWidth = 1.8;
      pen.beginPath();
      for (const x of places[0]) for (const y of places[1]) outline(X(x), Y(y), module, 6 + 3 * module);
      pen.stroke();
    });
  }

  /** A sign of its own for each module: square, diamond, circle, so that colours are not needed to tell them apart. */
  function outline(x, y, module, size) {
    if (module > 1) { pen.moveTo(x + size, y); pen.arc(x, y, size, 0, 2 * Math.PI); return; }
    const corners = module ? [[0, -1], [1, 0], [0, 1], [-1, 0]] : [[-0.8, -0.8], [0.8, -0.8], [0.8, 0.8], [-0.8, 0.8]];
    corners.forEach(([u, v], k) => pen[k ? "lineTo" : "moveTo"](x + size * u, y + size * v));
    pen.closePath();
  }

  function drawEllipse([x, y], { a, b, turn }, colour) {
    const least = 7; // pixels: a belief of half a metre would not be seen
    pen.beginPath();
    pen.ellipse(X(x), Y(y), Math.max(a * view.scale, least), Math.max(b * view.scale, least), -turn, 0, 2 * Math.PI);
    pen.globalAlpha = 0.25;
    pen.fillStyle = colour;
    pen.fill();
    pen.globalAlpha = 1;
    pen.strokeStyle = colour;
    pen.lineWidth = 2;
    pen.stroke();
  }

  function arrow(drive, i, [x, y], colour) {
    const heading = drive.heading_rad ? drive.heading_rad[i] : null;
    if (heading === null) return disc(x, y, 5, colour, inks.paper);
    pen.save();
    pen.translate(X(x), Y(y));
    pen.rotate(-heading);
    pen.beginPath();
    for (const [along, across] of [[11, 0], [-7, 6], [-3, 0], [-7, -6]]) pen.lineTo(along, across);
    pen.closePath();
    pen.fillStyle = colour;
    pen.fill();
    pen.lineWidth = 1.5;
    pen.strokeStyle = inks.paper;
    pen.stroke();
    pen.restore();
  }

  function drawMoment(moment, name) {
    pen.lineJoin = "round";
    const layer = layerOf(story, name);
    if (moment.kind === "map") moment.finished ? drawFinished(moment.t, moment.finished) : drawMapping(moment.t);
    else if (moment.kind === "roads") drawRoads(moment.t, layer);
    else drawSecond(moment.t, layer, secondDrive(story, name));
  }

  /** Draw the moment of a story told with one of its refined maps. */
  return {
    resize,
    draw(moment, name) {
      if (!view && !resize()) return;
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.clearRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(still, 0, 0);
      pen.setTransform(view.ratio, 0, 0, view.ratio, 0, 0);
      drawMoment(moment, name);
    },
    forget() { view = null; },
    /** The moment as SVG with lines of words above it; the screen is drawn anew afterwards. */
    vector(moment, name, words = []) {
      return onPaper(canvas, canvas, (svg) => {
        const screenPen = pen;
        resize();
        drawStill(svg);
        pen = svg;
        drawMoment(moment, name);
        svg.fillStyle = inks.ink;
        words.forEach((line, i) => { svg.font = i ? "13px sans-serif" : "700 16px sans-serif"; svg.fillText(line, 16, 26 + 20 * i); });
        [pen, view] = [screenPen, null];
      });
    },
  };
}
