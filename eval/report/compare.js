// The first tab: all towns at once, each telling its own story, so that they compare at a look.

const CARD_STORY_S = 20; // all of them are told in so long

function startCards(root) {
  const button = root.querySelector(".play-all");
  const cards = [...root.querySelectorAll("[data-place]")].map((card) => {
    const section = document.getElementById(card.dataset.place), story = storyOf(section), name = story.choices.at(-1) || null;
    return { story, scene: makeScene(card.querySelector("canvas"), story), segments: makeSegments(story, name), name, words: card.querySelector("small") };
  }).filter((card) => card.segments.length);
  let share = 0, playing = false, last = null, waiting = false;

  /** What a town's story is at: of the second drive, what its localizer says. */
  function stateOf({ kind, t }, drive) {
    if (!SECOND.includes(kind)) return { map: "mapping", roads: "the map comes right" }[kind];
    if (drive.localized[before(drive.t_s, t)]) return "localized";
    return kind === "find" ? "where am I?" : "in doubt again";
  }

  function frame(now) {
    waiting = false;
    if (playing) {
      if (last !== null) share = Math.min(1, share + Math.min(now - last, 100) / 1000 / CARD_STORY_S);
      last = now;
      if (share === 1 || !root.offsetParent) play(false);
    }
    if (root.offsetParent) for (const { story, scene, segments, name, words } of cards) {
      const moment = momentAt(segments, share * segments.at(-1).s1);
      scene.draw(moment, name);
      performance.mark("first picture");
      words.textContent = stateOf(moment, secondDrive(story, name));
    }
    if (playing) redraw();
  }

  function redraw() {
    if (!waiting) { waiting = true; requestAnimationFrame(frame); }
  }

  function play(on) {
    playing = on && cards.length > 0;
    last = null;
    if (playing && share === 1) share = 0;
    button.textContent = playing ? "❚❚ Pause" : "▶ Play all";
    button.setAttribute("aria-pressed", playing);
    redraw();
  }

  const stories = cards.map((card) => card.story), semi = stories.find((story) => story.semi);
  for (const mark of root.querySelectorAll(".mark.semi")) {
    if (semi) mark.style.background = semi.colours[semi.semi.name]; else mark.parentElement.remove();
  }
  button.addEventListener("click", () => play(!playing));
  const showRamp = () => { for (const mark of root.querySelectorAll(".mark.ramp")) mark.style.background = `linear-gradient(90deg, ${ramp().join(",")})`; };
  showRamp();
  dark.addEventListener("change", showRamp);
  new ResizeObserver(() => { cards.forEach(({ scene }) => scene.forget()); redraw(); }).observe(root);
  dark.addEventListener("change", () => { cards.forEach(({ scene }) => scene.forget()); redraw(); });
  return { begin() { if (still.matches) { share = 0.5; redraw(); } else play(true); }, at() {}, play };
}
