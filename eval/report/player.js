// The first screen of a town: the drive playing on the map, what the camera sees, what the localizer believes, and the error.

const FULL_STORY_S = 45; // the whole story takes so long at speed 1
const KEYS = { ArrowRight: 0.005, ArrowUp: 0.005, ArrowLeft: -0.005, ArrowDown: -0.005, PageUp: 0.05, PageDown: -0.05, Home: -1, End: 1 };
const FALSE_FIX_M = 20; // declared localized farther off than this, a drive has a false fix (eval/metrics/localization.py)
const STATUS = ["nowhere yet: it could be anywhere", "localized", "off the map", "in doubt: the views speak for another place", "lost"];
const still = matchMedia("(prefers-reduced-motion: reduce)");

/** A sheet of frames that is decoded once; draws the frame nearest in time on a canvas and returns its time. */
function makeFilm(address, tiles) {
  const image = new Image();
  image.src = address.trim().replace(/^url\(["']?/, "").replace(/["']?\)$/, "");
  let drawn = new WeakMap();
  return (canvas, t) => {
    const number = nearestInTime(tiles.t_s, t), { width, height, columns } = tiles;
    if (image.complete && image.naturalWidth && drawn.get(canvas) !== number) {
      canvas.width = width;
      canvas.height = height;
      canvas.getContext("2d").drawImage(image, width * (number % columns), height * Math.floor(number / columns), width, height, 0, 0, width, height);
      drawn.set(canvas, number);
    }
    return tiles.t_s[number];
  };
}

/** The story of a town's section, read once from the data in it. */
const stories = new Map();
function storyOf(section) {
  if (!stories.has(section)) {
    const own = section.querySelector(".player > script"), data = JSON.parse(section.querySelector(".map script").textContent);
    stories.set(section, makeStory(data, own ? JSON.parse(own.textContent) : null));
  }
  return stories.get(section);
}

function startPlayer(root) {
  const find = (name) => root.querySelector(name), section = root.closest("section"), style = getComputedStyle(section);
  const story = storyOf(section), data = story.data;
  const scene = makeScene(find(".scene"), story), chart = makeChart(find(".chart canvas"), story), slider = find(".chart");
  const films = [["--sheet", data.thumbnails], ["--sheet2", story.second && story.second.frames]]
    .map(([key, tiles]) => tiles && style.getPropertyValue(key) ? makeFilm(style.getPropertyValue(key), tiles) : null);
  const brain = find(".brain") ? makeBrain(find(".brain")) : null, strip = section.querySelector(".traces canvas");
  const traces = strip ? makeTraces(strip) : null;
  let name = story.choices.at(-1) || null, segments = [], s = 0, playing = false, last = null, waiting = false;
  let finished = null; // the map of which a place was asked for: it is shown as it came out, and not while it grows

  const length = () => (segments.length ? segments.at(-1).s1 : 1);

  function choose(other) {
    const share = s / length();
    name = other;
    if (finished) finished = layerOf(story, name) || null;
    segments = makeSegments(story, name);
    chart.tell(segments, name);
    find(".mark.located").style.background = story.colours[(layerOf(story, name) || { name }).name];
    for (const button of root.querySelectorAll("[data-part]")) button.hidden = !segments.some((one) => partOf(one.kind) === button.dataset.part);
    for (const option of find(".speed").options) option.textContent = `${Number(((option.value * length()) / FULL_STORY_S).toPrecision(2))}× real time`;
    s = share * length();
    redraw();
  }

  const here = () => ({ ...momentAt(segments, s), finished });

  function redraw() {
    if (!waiting) { waiting = true; requestAnimationFrame(frame); }
  }

  function frame(now) {
    waiting = false;
    if (playing) {
      if (last !== null) s += (Math.min(now - last, 100) / 1000) * (length() / FULL_STORY_S) * Number(find(".speed").value);
      last = now;
      if (s >= length()) { s = length(); play(false); }
      if (!root.offsetParent) play(false); // another town is shown
    }
    show();
    if (playing) redraw();
  }

  function show() {
    if (!segments.length || !root.offsetParent) return;
    const moment = here();
    scene.draw(moment, name);
    performance.mark("first picture");
    chart.draw(s);
    const drive = secondDrive(story, name), second = SECOND.includes(moment.kind);
    if (traces && drive && drive.grid_rad && drive.grid_rad[0].length) traces.draw(drive, second ? moment.t : drive.t_s[0]);
    const told = tell(moment);
    slider.setAttribute("aria-valuenow", Math.round((1000 * s) / length()));
    slider.setAttribute("aria-valuetext", told.join(". "));
    find(".moment strong").textContent = told[0];
    find(".moment span").textContent = told.slice(1).join(" · ");
    for (const button of root.querySelectorAll("[data-part]")) button.setAttribute("aria-pressed", button.dataset.part === partOf(moment.kind) && !(finished && moment.kind === "map"));
  }

  /** Show frame, view and networks of a moment, and put it into words. */
  function tell({ kind, t }) {
    const second = SECOND.includes(kind), film = films[second ? 1 : 0], drive = secondDrive(story, name);
    root.dataset.part = second ? "find" : kind === "map" && finished ? "made" : kind;
    find(".film").hidden = kind === "roads" || !film;
    if (film && kind !== "roads") caption(".film", `${second ? "second" : "first"} drive, kept frame of`, film(find(".film canvas"), t) - (second ? drive.t_s[0] : 0));
    if (kind === "map") {
      const map = finished || story.semi, layer = layerOf(story, name);
      const later = !finished && layer && layer !== story.semi ? layer.error_m[nearestInTime(layer.t_s, t)] : null;
      const told = [`First drive, ${t.toFixed(1)} s`, map ? `${offBy(`${finished ? map.name : "the semi-metric map"} is`, map.error_m[before(map.t_s, t)])} here` : "no semi-metric map"];
      return typeof later === "number" ? [...told, `${layer.name}: ${metres(later)} off`] : told;
    }
    if (kind === "roads") return ["The map comes right", `every vertex is laid on the roads: ${name}`];
    const i = before(drive.t_s, t), elapsed = t - drive.t_s[0];
    const known = drive.status ? STATUS[drive.status[i]] : drive.localized[i] ? "localized" : "not localized";
    showBelief(drive, i);
    const spread = drive.covariance_m2 && drive.covariance_m2[i] && drive.localized[i] ? `, 95 % sure within ${metres(ellipseOf(drive.covariance_m2[i]).a)}` : "";
    return [`Second drive, ${elapsed.toFixed(1)} s`, `${known}${spread}`, offBy(drive.localized[i] ? "truly" : "its guess is", drive.error_m[i]) + (drive.localized[i] && drive.error_m[i] > FALSE_FIX_M ? ": a false fix" : "")];
  }

  function showBelief(drive, i) {
    const view = find(".fired"), view_s = drive.view_s ? drive.view_s[i] : null;
    view.hidden = view_s === null || !films[0];
    if (!view.hidden) caption(".fired", `view of ${view_s.toFixed(1)} s fired; kept frame of`, films[0](view.querySelector("canvas"), view_s));
    if (brain && drive.grid_rad && drive.grid_rad[i].length) brain.draw(drive, i);
  }

  function caption(figure, words, t) {
    find(`${figure} figcaption`).textContent = `${words} ${t.toFixed(1)}\u00a0s`;
  }

  function play(on) {
    playing = on && segments.length > 0;
    last = null;
    if (playing && s >= length()) s = 0;
    find(".play").textContent = playing ? "❚❚ Pause" : "▶ Play";
    find(".play").setAttribute("aria-pressed", playing);
    redraw();
  }

  function seek(to) {
    play(false);
    s = Math.min(length(), Math.max(0, to));
    redraw();
  }

  function forget() {
    find(".mark.ramp").style.background = `linear-gradient(90deg, ${ramp().join(",")})`;
    for (const one of [scene, chart, traces]) if (one) one.forget();
    redraw();
  }

  /** What of this town can be saved as a picture: the moment on the map, the curves, the networks. */
  function pictures() {
    const town = section.dataset.town, then = (svg) => { redraw(); return svg; };
    const drive = () => secondDrive(story, name);
    const found = [[`${town}, the moment`, () => then(scene.vector(here(), name, [`${town}: ${tell(here())[0]}`, tell(here()).slice(1).join("; ")]))], [`${town}, the errors`, () => then(chart.vector())]];
    if (brain) found.push([`${town}, the networks`, () => brain.vector(drive(), before(drive().t_s, ["map", "roads"].includes(here().kind) ? Infinity : here().t))]);
    return found;
  }

  function setUp() {
    find(".transport").append(saveBox(pictures()));
    if (traces) strip.parentElement.after(saveBox([[`${section.dataset.town}, certainty of the networks`, () => { const svg = traces.vector(secondDrive(story, name)); redraw(); return svg; }]]));
    const select = find(".choice");
    for (const choice of story.choices) select.append(make("option", choice, { value: choice, selected: choice === name }));
    if (!story.semi) for (const mark of root.querySelectorAll(".mark.own")) mark.parentElement.remove();
    for (const mark of root.querySelectorAll(".mark.own")) mark.style.background = story.colours[story.semi.name];
    select.closest("label").hidden = story.choices.length < 2;
    select.addEventListener("change", () => choose(select.value));
    const modules = find("input.modules");
    if (modules) modules.addEventListener("change", () => { showModules.on = modules.checked; redraw(); });
    if (!modules) find(".mark.modules").parentElement.remove();
    find(".play").addEventListener("click", () => play(!playing));
    for (const button of root.querySelectorAll("[data-part]")) button.addEventListener("click", () => {
      s = segments.find((one) => partOf(one.kind) === button.dataset.part).s0;
      finished = null;
      play(!still.matches);
    });
    slider.addEventListener("pointerdown", (event) => { slider.setPointerCapture(event.pointerId); seek(chart.at(event.clientX)); });
    slider.addEventListener("pointermove", (event) => { if (event.buttons) seek(chart.at(event.clientX)); });
    root.addEventListener("keydown", (event) => {
      if (event.target.matches("select")) return;
      if (event.key === " " && !event.target.matches("button")) { event.preventDefault(); return play(!playing); }
      if (!slider.contains(event.target) || !(event.key in KEYS)) return;
      event.preventDefault();
      seek(s + KEYS[event.key] * length());
    });
    if (strip) strip.addEventListener("pointerdown", (event) => seek(storyTime(segments, 2, traces.at(event.clientX))));
    new ResizeObserver(forget).observe(root);
    dark.addEventListener("change", forget);
  }

  setUp();
  choose(name);
  setTimeout(redraw, 200); // by then the frames are decoded
  root.dataset.ready = "yes";
  /** Show a time of one of the two drives, in the map of a method if one is named, and play or not. */
  return {
    at(drive, t, map) {
      if (story.choices.includes(map)) { find(".choice").value = map; choose(map); }
      finished = drive === 1 ? data.methods.find((layer) => layer.name === map) || null : null;
      seek(storyTime(segments, drive, t));
    },
    play,
    begin() { finished = null; if (!still.matches) { s = 0; play(true); } else seek(0.3 * length()); },
  };
}
