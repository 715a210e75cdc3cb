// How sure both populations of both networks were along the second drive (reliability, 1/sigma²), and when views were injected.

const TRACE_ROWS = [["head_reliability", "head direction", "heading"], ["grid_reliability", "grid cells", "a period's 360°"]];
const RISE = 1.02; // between injections reliabilities only fall: a calibration population that is surer than before was injected into
const LEGEND_PX = 760, LEGEND_ROOM_PX = 190; // width from which on there is room for the names of the lines, and theirs
const POPULATION_NAMES = ["integrator", "calibration"]; // in the order of POPULATIONS
const TRACE_LEFT = 8, TRACE_HEAD = 18;

/** Mean of a population's reliabilities in a sample: even entries of pairs are the integrator's, odd ones the calibration's. */
function sureness(values, population) {
  const width = values.length === 2 ? 1 : 2, own = values.filter((_, i) => Math.floor(i / width) % 2 === population);
  return own.reduce((a, b) => a + b, 0) / Math.max(own.length, 1);
}

/** Samples at which a view was injected since the sample before. */
function injections(belief) {
  const sure = belief.grid_reliability.map((values) => sureness(values, 1));
  return sure.flatMap((value, i) => (i > 0 && value > RISE * sure[i - 1] ? [i] : []));
}

function makeTraces(canvas) {
  const pen = canvas.getContext("2d"), still = document.createElement("canvas");
  let size = null, drawn = null, inks = null;
  const X = (t) => TRACE_LEFT + ((t - drawn.t_s[0]) / Math.max(drawn.t_s.at(-1) - drawn.t_s[0], 1e-9)) * (size.w - 2 * TRACE_LEFT);

  function resize(belief) {
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!w || !h) return (size = null);
    [size, drawn] = [{ w, h, ratio }, belief];
    inks = inksOf(canvas, ["line", "soft", "ink", "accent"]);
    for (const one of [canvas, still]) { one.width = Math.round(w * ratio); one.height = Math.round(h * ratio); }
    drawStill(still.getContext("2d"));
    return size;
  }

  function drawStill(on) {
    const tall = size.h / TRACE_ROWS.length;
    on.setTransform(size.ratio, 0, 0, size.ratio, 0, 0);
    on.font = "12px system-ui, sans-serif";
    TRACE_ROWS.forEach(([key, name, turn], row) => drawRow(on, key, name, turn, row * tall, tall));
  }

  function drawRow(on, key, name, turn, top, tall) {
    const series = [0, 1].map((population) => drawn[key].map((values) => Math.log10(Math.max(sureness(values, population), 1e-4))));
    const all = series.flat(), low = all.reduce((a, b) => Math.min(a, b)), high = all.reduce((a, b) => Math.max(a, b));
    const Y = (value) => top + tall - 6 - ((value - low) / Math.max(high - low, 1e-9)) * (tall - TRACE_HEAD - 10);
    const marks = injections(drawn);
    on.fillStyle = inks.soft;
    const over = top === 0 ? `; from left to right: the second drive, ${Math.round(drawn.t_s.at(-1) - drawn.t_s[0])} s` : "";
    const range = `${sigma(10 ** low)} to ${sigma(10 ** high)}`, wide = `${name}: certainty, from ${range} of ${turn}, on a log scale; ticks: the ${marks.length} injections`;
    const room = size.w - 2 * TRACE_LEFT - (top === 0 && size.w >= LEGEND_PX ? LEGEND_ROOM_PX : 0);
    const words = [wide + over, wide, `${name}: ${range}; ticks: the ${marks.length} injections`, `${name}: ${range}, ${marks.length} injections`];
    on.fillText(words.find((one) => on.measureText(one).width < room) ?? words.at(-1), TRACE_LEFT + 5, top + 12);
    if (size.w >= LEGEND_PX && top === 0) drawLegend(on);
    on.fillStyle = inks.accent;
    for (const i of marks) on.fillRect(X(drawn.t_s[i]), top + TRACE_HEAD, 1, 5);
    series.forEach((values, population) => {
      on.strokeStyle = `rgb(${POPULATIONS[population].join(",")})`;
      on.lineWidth = 1.6;
      on.beginPath();
      values.forEach((value, i) => on[i ? "lineTo" : "moveTo"](X(drawn.t_s[i]), Y(value)));
      on.stroke();
    });
  }

  /** Which line is which population, at the right. */
  function drawLegend(on) {
    let x = size.w - TRACE_LEFT;
    POPULATION_NAMES.forEach((words, population) => {
      x -= on.measureText(words).width;
      on.fillStyle = inks.soft;
      on.fillText(words, x, 12);
      on.fillStyle = `rgb(${POPULATIONS[population].join(",")})`;
      on.fillRect(x - 17, 7, 12, 3);
      x -= 32;
    });
  }

  const sigma = (reliability) => { const degrees = 180 / Math.PI / Math.sqrt(reliability); return degrees > 90 ? "none" : `±${degrees.toPrecision(2)}°`; };

  return {
    forget() { size = null; },
    /** Both rows as SVG; the screen is drawn anew afterwards. */
    vector(belief) {
      return onPaper(canvas, canvas, (svg) => { resize(belief); drawStill(svg); size = null; });
    },
    draw(belief, t) {
      if (belief !== drawn) size = null;
      if (!size && !resize(belief)) return;
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.clearRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(still, 0, 0);
      pen.setTransform(size.ratio, 0, 0, size.ratio, 0, 0);
      pen.fillStyle = inks.ink;
      pen.fillRect(X(t) - 1, 0, 2, size.h);
    },
    at(clientX) {
      const box = canvas.getBoundingClientRect(), share = (clientX - box.left - TRACE_LEFT) / Math.max(box.width - 2 * TRACE_LEFT, 1);
      return drawn ? drawn.t_s[0] + Math.min(1, Math.max(0, share)) * (drawn.t_s.at(-1) - drawn.t_s[0]) : 0;
    },
  };
}
