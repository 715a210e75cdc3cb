// The first tab: all towns at once, each telling its own story, so that they compare at a look.

const CARD_STORY_S = 20; // all of them are told in so long

function startCards(root) {
  const button = root.querySelector(".play-all");
  const cards = [...root.querySelectorAll("[data-place]")].map((card) => {
    const section = document.getElementById(card.dataset.place), story = storyOf(section), name = story.choices.at(-1) || null;
    return { scene: makeScene(card.querySelector("canvas"), story), segments: makeSegments(story, name), name, words: card.querySelector("small") };
  }).filter((card) => card.segments.length);
  let share = 0, playing = false, last = null, waiting = false;

  function frame(now) {
    waiting = false;
    if (playing) {
      if (last !== null) share = Math.min(1, share + Math.min(now - last, 100) / 1000 / CARD_STORY_S);
      last = now;
      if (share === 1 || !root.offsetParent) play(false);
    }
    if (root.offsetParent) for (const { scene, segments, name, words } of cards) {
      const moment = momentAt(segments, share * segments.at(-1).s1);
      scene.draw(moment, name);
      performance.mark("first picture");
      words.textContent = { map: "mapping", roads: "the map comes right", find: "where am I?", follow: "localized" }[moment.kind];
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

  button.addEventListener("click", () => play(!playing));
  new ResizeObserver(() => { cards.forEach(({ scene }) => scene.forget()); redraw(); }).observe(root);
  dark.addEventListener("change", () => { cards.forEach(({ scene }) => scene.forget()); redraw(); });
  return { begin() { if (still.matches) { share = 0.5; redraw(); } else play(true); }, at() {}, play };
}
