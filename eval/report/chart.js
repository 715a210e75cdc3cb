// Errors along the story on a logarithmic axis. The chart is the player's slider: pointer and keys move all that the player shows.

const CHART_LOW_M = 0.05, CHART_HIGH_M = 500; // a tyre's width, and a town's
const CHART_LEFT = 44, CHART_TOP = 16, CHART_BOTTOM = 18;
const PARTS = { map: "1 The map grows", roads: "2 It comes right", find: "3 Where am I?", follow: "4 Localized" }; // as on the buttons

function makeChart(canvas, story) {
  const pen = canvas.getContext("2d"), still = document.createElement("canvas");
  let size = null, segments = [], end = 1, name = null, inks = null;
  const X = (s) => CHART_LEFT + (s / end) * (size.w - CHART_LEFT - 6);
  const Y = (error) => {
    const share = Math.log(Math.min(Math.max(error, CHART_LOW_M), CHART_HIGH_M) / CHART_LOW_M) / Math.log(CHART_HIGH_M / CHART_LOW_M);
    return size.h - CHART_BOTTOM - share * (size.h - CHART_TOP - CHART_BOTTOM);
  };

  function tell(told, of) {
    [segments, name, end] = [told, of, told.length ? told.at(-1).s1 : 1];
    size = null;
  }

  function resize() {
    const w = canvas.clientWidth, h = canvas.clientHeight, ratio = window.devicePixelRatio || 1;
    if (!w || !h) return (size = null);
    size = { w, h, ratio };
    inks = inksOf(canvas, ["line", "soft", "ink", "panel", "accent", "bad"]);
    for (const one of [canvas, still]) { one.width = Math.round(w * ratio); one.height = Math.round(h * ratio); }
    drawStill(still.getContext("2d"));
    return size;
  }

  function drawStill(on) {
    on.setTransform(size.ratio, 0, 0, size.ratio, 0, 0);
    on.font = "12px system-ui, sans-serif";
    on.textBaseline = "middle";
    segments.forEach((one, i) => {
      const part = partOf(one.kind);
      if (["roads", "follow"].includes(part)) { on.fillStyle = inks.panel; on.fillRect(X(one.s0), CHART_TOP, X(one.s1) - X(one.s0), size.h - CHART_TOP - CHART_BOTTOM); }
      on.fillStyle = inks.soft;
      if (i && partOf(segments[i - 1].kind) === part) return seconds(on, one); // the part has its name already
      const words = partWords(one), room = X(segments.filter((other) => partOf(other.kind) === part).at(-1).s1) - X(one.s0);
      const fitting = [words, words.match(/^\d?/)[0]].find((text) => on.measureText(text).width < room - 4);
      if (fitting) on.fillText(fitting, X(one.s0) + 3, 8);
      seconds(on, one);
    });
    for (const value of [0.1, 1, 10, 100]) {
      on.strokeStyle = inks.line;
      on.lineWidth = 1;
      on.beginPath();
      on.moveTo(CHART_LEFT, Y(value));
      on.lineTo(size.w - 6, Y(value));
      on.stroke();
      on.fillStyle = inks.soft;
      on.textAlign = "right";
      on.fillText(`${value} m`, CHART_LEFT - 5, Y(value));
      on.textAlign = "left";
    }
    curves().forEach((curve) => drawCurve(on, curve));
    nameCurves(on);
  }

  /** The name of a part; on a phone the first part leaves its room to the names of the curves. */
  const partWords = (one) => (one.kind === "map" && size.w < 480 ? PARTS.map.slice(0, 1) : PARTS[partOf(one.kind)]);

  /** The names of the curves of the first drive in their colours, beside the name of its part, as far as there is room. */
  function nameCurves(on) {
    const first = segments.find((one) => one.kind === "map");
    let x = first ? X(first.s0) + on.measureText(partWords(first)).width + (size.w < 480 ? 4 : 10) : Infinity;
    for (const { path, drive, colour } of curves()) {
      const wide = on.measureText(path.name).width;
      if (drive !== 1 || x + wide + 12 > X(first.s1)) continue;
      on.fillStyle = colour;
      on.fillRect(x, 7, 10, 3);
      on.fillStyle = inks.soft;
      on.fillText(path.name, x + 13, 8);
      x += wide + 21;
    }
  }

  /** The time of the drive at the begin of a part and, if there is room, at its end. */
  function seconds(on, one) {
    if (one.kind === "roads" || X(one.s1) - X(one.s0) < 60) return;
    on.fillText(`${Math.round(one.t0)} s`, X(one.s0) + 3, size.h - 8);
    if (X(one.s1) - X(one.s0) < 110) return;
    on.textAlign = "right";
    on.fillText(`${Math.round(one.t1)} s`, X(one.s1) - 3, size.h - 8);
    on.textAlign = "left";
  }

  /** Error curves: the semi-metric map and the refined one along the first drive, the localizer along the second. */
  function curves() {
    const layers = [story.semi, layerOf(story, name)].filter(Boolean), drive = secondDrive(story, name);
    const first = layers.map((path) => ({ path, drive: 1, colour: story.colours[path.name] }));
    return drive ? [...first, { path: drive, drive: 2, colour: story.colours[name] }] : first;
  }

  function drawCurve(on, { path, drive, colour }) {
    on.strokeStyle = colour;
    on.lineWidth = 1.6;
    on.beginPath();
    let pen_down = false;
    path.t_s.forEach((t, i) => {
      if (path.error_m[i] === null) return (pen_down = false);
      on[pen_down ? "lineTo" : "moveTo"](X(storyTime(segments, drive, t)), Y(path.error_m[i]));
      pen_down = true;
    });
    on.stroke();
  }

  return {
    tell,
    forget() { size = null; },
    /** The curves as SVG; the screen is drawn anew afterwards. */
    vector() {
      return onPaper(canvas, canvas, (svg) => { resize(); drawStill(svg); size = null; });
    },
    draw(s) {
      if (!size && !resize()) return;
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.clearRect(0, 0, canvas.width, canvas.height);
      pen.drawImage(still, 0, 0);
      pen.setTransform(size.ratio, 0, 0, size.ratio, 0, 0);
      pen.fillStyle = inks.ink;
      pen.fillRect(X(s) - 1, CHART_TOP - 2, 2, size.h - CHART_TOP - CHART_BOTTOM + 4);
      pen.beginPath();
      pen.arc(X(s), size.h - CHART_BOTTOM + 1, 6, 0, 2 * Math.PI);
      pen.fill();
    },
    /** The story time at a place on the screen. */
    at(clientX) {
      const box = canvas.getBoundingClientRect();
      return Math.min(1, Math.max(0, (clientX - box.left - CHART_LEFT) / Math.max(box.width - CHART_LEFT - 6, 1))) * end;
    },
  };
}
