// The player of missions on drive.html: a car on the town's map, where the driver believed it was, and what it was doing.

const FASTER = 8; // seconds of driving in one of playing
const STATES = ["searching", "driving", "doubting", "halted", "arrived"];

for (const section of document.querySelectorAll("section.drives")) {
  const missions = JSON.parse(section.querySelector("script").textContent);
  const find = (name) => section.querySelector(name);
  const car = find(".car"), belief = find(".belief"), button = find(".play"), slider = find("input"), words = find("output"), choice = find("select");
  let mission = missions[0], now = 0, playing = 0, last = 0;

  function show() {
    const k = Math.min(Math.floor(now / mission.every_s), mission.x.length - 1);
    const known = mission.ex[k] !== null;
    car.setAttribute("transform", `translate(${mission.x[k]} ${-mission.y[k]}) rotate(${(-mission.heading[k] * 180) / Math.PI})`);
    belief.toggleAttribute("hidden", !known);
    belief.style.display = known ? "" : "none";
    if (known) { belief.setAttribute("cx", mission.ex[k]); belief.setAttribute("cy", -mission.ey[k]); }
    slider.value = k;
    words.textContent = `${(k * mission.every_s).toFixed(0)} s, ${(3.6 * mission.speed[k]).toFixed(0)} km/h, ${STATES[mission.state[k]] ?? ""}`;
  }

  function stop() {
    cancelAnimationFrame(playing);
    playing = 0;
    button.textContent = "▶ Play";
  }

  function tick(time) {
    now += (Math.max(time - last, 0) / 1000) * FASTER; // a first frame may have begun before the click
    last = time;
    show();
    if (now >= mission.every_s * (mission.x.length - 1)) return stop();
    playing = requestAnimationFrame(tick);
  }

  function choose(place) {
    stop();
    choice.value = place;
    mission = missions[place];
    now = 0;
    slider.max = mission.x.length - 1;
    for (const way of section.querySelectorAll(".ways")) way.style.display = way.dataset.row === mission.row ? "" : "none";
    for (const way of section.querySelectorAll(".one")) way.classList.toggle("chosen", Number(way.dataset.mission) === place);
    show();
  }

  button.addEventListener("click", () => {
    if (playing) return stop();
    if (now >= mission.every_s * (mission.x.length - 1)) now = 0;
    button.textContent = "❚❚ Pause";
    last = performance.now();
    playing = requestAnimationFrame(tick);
  });
  slider.addEventListener("input", () => { stop(); now = slider.value * mission.every_s; show(); });
  choice.addEventListener("change", () => choose(Number(choice.value)));
  for (const one of section.querySelectorAll("button.show")) {
    one.addEventListener("click", () => { choose(Number(one.dataset.mission)); find(".drive-controls").scrollIntoView({ block: "start" }); button.click(); });
  }
  choose(0);
}
