// A run while it goes on: asks once a second how far it is, and shows stages, frames as they are drawn, and figures.

const ASK_MS = 1000, FRAME_MS = 200;
const STAGES = { simulate: "drive through the town", render: "draw what the camera sees", seal: "check and close the recordings",
  evaluate: "map, refine, localize, score", refine: "lay the maps on the roads", map: "build the map", localize: "localize" };
const at = (name) => document.querySelector(`.live-${name}`);
const drives = new Map(), shown = new Set();

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** The stages of the plan, with those that have begun; done ones have their time, the last that has begun is at work. */
function showStages({ plan, stages }) {
  const names = [...new Set([...plan, ...stages.map((stage) => stage.name)])], list = at("stages"), current = stages.at(-1);
  while (list.children.length > names.length) list.lastChild.remove();
  names.forEach((name, i) => {
    const stage = stages.findLast((one) => one.name === name), row = list.children[i] || list.appendChild(make("li"));
    if (!row.children.length) row.append(make("strong"), make("progress"), make("span"));
    const [title, bar, words] = row.children, over = stage && (stage !== current || stage.done === stage.total);
    setText(title, STAGES[name] ? `${name}: ${STAGES[name]}` : name);
    bar.max = stage ? Math.max(stage.total, 1) : 1;
    bar.value = stage ? (stage.total ? stage.done : 1) : 0;
    bar.setAttribute("aria-label", name);
    row.classList.toggle("now", Boolean(stage) && !over);
    const told = !stage ? "to come" : !stage.total ? "was done before" : `${stage.done} of ${stage.total}, ${stage.seconds.toFixed(0)} s`;
    setText(words, told);
  });
}

function showDrives(found) {
  at("drives").parentElement.hidden = !found.length;
  for (const drive of found) {
    if (!drives.has(drive.name)) {
      const figure = make("figure"), image = make("img", undefined, { alt: `newest frames of ${drive.name}`, hidden: true });
      figure.append(image, make("figcaption"));
      at("drives").append(figure);
      drives.set(drive.name, { figure, image, frames: [], next: 0 });
    }
    const one = drives.get(drive.name);
    setText(one.figure.querySelector("figcaption"), `${drive.name}: ${drive.drawn} frames${drive.whole ? ", all" : " so far"}`);
    if (one.frames[0] !== drive.frames[0]) Object.assign(one, { frames: drive.frames, next: 0 });
  }
}

/** The next frame of each drive; the picture changes once it is there, so that nothing flickers. */
function step() {
  for (const one of drives.values()) {
    if (!one.frames.length) continue;
    const image = new Image(), address = one.frames[one.next % one.frames.length];
    one.next += 1;
    image.onload = () => { one.image.src = address; one.image.hidden = false; };
    image.src = address;
  }
}

function showFigures(found) {
  at("figures").parentElement.hidden = !found.length;
  for (const address of found) {
    if (shown.has(address)) continue;
    shown.add(address);
    const figure = make("figure"), words = decodeURIComponent(address).replace("/figure/", "").replace(".png", "").replace("/", ": ").replaceAll("-", " ");
    figure.append(make("img", undefined, { src: address, alt: words, loading: "lazy" }), make("figcaption", words));
    at("figures").append(figure);
  }
}

function show(found) {
  const { stages, pages } = found, busy = stages.length > 0, current = stages.at(-1);
  setText(at("state"), busy ? "under way" : pages.length ? "done" : found.missing ? "no such folder" : "waiting");
  at("state").classList.toggle("good", !busy && pages.length > 0);
  at("state").classList.toggle("bad", !busy && Boolean(found.missing));
  const next = busy && found.plan[found.plan.indexOf(current.name) + 1];
  setText(at("words"), busy ? `At work: ${current.name}, ${current.done} of ${current.total}.${next ? ` Next: ${next}.` : " Then the page is written."}`
    : pages.length ? "The run is over; its pages:" : found.missing ? `${found.missing}${found.missing.endsWith("?") ? "" : "."}` : "No run has begun in this folder yet. This page fills as soon as one does.");
  at("pages").replaceChildren(...(busy ? [] : pages.flatMap((name) => [make("a", name, { href: `/${name}` }), " "])));
  showStages(found);
  showDrives(found.drives);
  showFigures(found.figures);
  document.title = `${found.folder}: ${at("state").textContent}`;
}

async function ask() {
  try {
    show(await (await fetch("/state.json")).json());
  } catch {
    setText(at("state"), "nobody answers");
    setText(at("words"), "hippodrome serve has ended. What is shown is what it said last.");
  }
  setTimeout(ask, ASK_MS);
}

if (!matchMedia("(prefers-reduced-motion: reduce)").matches) setInterval(step, FRAME_MS);
else setInterval(step, 10 * ASK_MS);
ask();
