// The towns as tabs, and addresses that open a place: #town=NAME&drive=1&t=42&map=METHOD&play=1, or #scenario-1 for a town.

const panels = [...document.querySelectorAll("section.panel")], links = [...document.querySelectorAll("nav.tabs a")];
const players = new Map();

function playerOf(panel) {
  const root = panel.querySelector(".player, .towns");
  if (root && !players.has(root)) players.set(root, root.matches(".towns") ? startCards(root) : startPlayer(root));
  return root ? players.get(root) : null;
}

function openPanel(panel) {
  for (const one of panels) one.hidden = one !== panel;
  for (const link of links) {
    const own = link.hash === `#${panel.id}`;
    link.setAttribute("aria-selected", own);
    link.tabIndex = own ? 0 : -1;
    const row = link.parentElement; // of tabs that do not all fit, the one that is shown is in sight
    if (own) row.scrollLeft = link.offsetLeft - row.offsetLeft - (row.clientWidth - link.offsetWidth) / 2;
  }
}

/** What a town's page has, as links to its headings: the page is long. */
function addContents(panel) {
  const heads = [...panel.querySelectorAll("h3")], title = panel.querySelector("h2");
  if (heads.length < 3 || !panel.dataset.town) return;
  const nav = make("nav", undefined, { className: "contents" });
  nav.setAttribute("aria-label", `On this page, ${panel.dataset.town}`);
  heads.forEach((head, i) => {
    head.id = `${panel.id}-${i + 1}`;
    nav.append(make("a", head.textContent.replace(/ \(.*| from .*|[:?].*/, ""), { href: `#${head.id}` }));
  });
  title.after(nav);
}

/** Open what the address names; the first panel, or the only town, if it names nothing. */
function follow(first) {
  const words = new URLSearchParams(location.hash.slice(1)), town = words.get("town"), t = Number(words.get("t") ?? NaN);
  const named = panels.find((one) => town !== null ? one.dataset.town === town : `#${one.id}` === location.hash);
  const head = named || town !== null ? null : panels.flatMap((one) => [...one.querySelectorAll("h3[id]")]).find((one) => `#${one.id}` === location.hash);
  if (head) {
    const own = head.closest("section.panel");
    if (first || own.hidden) { openPanel(own); playerOf(own); }
    return head.scrollIntoView();
  }
  if (!named && !first) return;
  const panel = named || (panels.length === 2 ? panels[1] : panels[0]);
  openPanel(panel);
  const player = playerOf(panel);
  if (player && Number.isFinite(t)) {
    player.at(Number(words.get("drive") ?? 1), t, words.get("map"));
    if (words.has("play") && !still.matches) player.play(true);
  } else if (player) player.begin();
  if (!first || named) window.scrollTo(0, 0);
}

if (panels.length) {
  document.querySelector("nav.tabs").setAttribute("role", "tablist");
  for (const link of links) {
    link.setAttribute("role", "tab");
    link.setAttribute("aria-controls", link.hash.slice(1));
    link.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step && event.key !== " ") return;
      event.preventDefault();
      const next = step ? links[(links.indexOf(link) + step + links.length) % links.length] : link;
      next.click();
      next.focus();
    });
  }
  for (const panel of panels) panel.setAttribute("role", "tabpanel");
  panels.forEach(addContents);
  for (const button of document.querySelectorAll(".copy")) button.addEventListener("click", () => {
    const text = button.parentElement.querySelector(".command").textContent;
    navigator.clipboard?.writeText(text).then(() => { button.textContent = "Copied"; }, () => { button.textContent = "Not allowed to copy"; });
  });
  addEventListener("hashchange", () => follow(false));
  document.addEventListener("click", (event) => { // a place that was opened before is opened again, though the address stays
    const link = event.target.closest('a[href^="#town="]');
    if (link && link.hash === location.hash) { event.preventDefault(); follow(false); }
  });
  follow(true);
}
