// Save a figure as PNG, SVG or PDF. All three are made of its SVG; the PDF is printed by the browser, and stays lines and letters.

const PRINT_SCALE = 3; // pixels of a PNG for each of the screen's: some 300 dots an inch in a column of a paper

const svgAddress = (text) => `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;

async function imageOf(address) {
  const image = new Image();
  image.src = address;
  await image.decode();
  return image;
}

async function asPng(image, scale) {
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  canvas.width = Math.round(scale * image.naturalWidth);
  canvas.height = Math.round(scale * image.naturalHeight);
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  return new Promise((done) => canvas.toBlob(done, "image/png"));
}

/** Print one figure on a page of its own size; "save as PDF" is what every browser's print offers. */
async function printFigure(image) {
  const { naturalWidth: w, naturalHeight: h } = image; // rounded: a page of exactly this height may be too low by a part of a pixel
  const size = make("style", `@page { size: ${w}px ${h + 1}px; margin: 0; }`);
  image.className = "print-figure";
  image.alt = "the figure that is printed";
  document.body.append(image);
  document.head.append(size);
  document.documentElement.classList.add("printing");
  addEventListener("afterprint", () => {
    document.documentElement.classList.remove("printing");
    image.remove();
    size.remove();
  }, { once: true });
  window.print();
}

const savers = {
  PNG: async (name, svg) => saveAs(`${name}.png`, await asPng(await imageOf(svgAddress(svg)), PRINT_SCALE)),
  SVG: async (name, svg) => saveAs(`${name}.svg`, new Blob([svg], { type: "image/svg+xml" })),
  PDF: async (name, svg) => printFigure(await imageOf(svgAddress(svg))),
};

/** Buttons for figures: names, and what gives the SVG of each when it is asked for. */
function saveBox(figures) {
  const box = make("details", undefined, { className: "save" }), list = make("div");
  box.append(make("summary", "Save picture"), list);
  for (const [name, vector] of figures) list.append(saveRow(name, Object.keys(savers), async (kind) => savers[kind](fileName(name), await vector())));
  box.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || !box.open) return;
    box.open = false;
    box.querySelector("summary").focus();
  });
  return box;
}

function saveRow(name, kinds, save) {
  const row = make("div", undefined, { className: "save-row" }), said = make("span");
  said.setAttribute("role", "status");
  row.append(make("span", name));
  for (const kind of kinds) {
    const button = make("button", kind, { type: "button" });
    button.setAttribute("aria-label", `Save ${name} as ${kind}`);
    button.addEventListener("click", async () => {
      try { await save(kind); said.textContent = kind === "PDF" ? "" : "saved"; } catch (error) { said.textContent = `not saved: ${error.message}`; }
    });
    row.append(button);
  }
  row.append(said);
  return row;
}

/** Text that was packed with gzip and base64. */
async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}

for (const figure of document.querySelectorAll(".gallery figure")) {
  const image = figure.querySelector("img"), packed = figure.querySelector("script"), words = figure.querySelector("figcaption");
  const name = `${figure.closest("section").dataset.town} ${image.alt}`, kinds = packed ? ["PNG", "SVG", "PDF"] : ["PNG", "PDF"];
  const row = saveRow(image.alt, kinds, async (kind) => {
    if (packed) return savers[kind](fileName(name), await unpacked(packed.textContent));
    if (kind === "PDF") return printFigure(await imageOf(image.src));
    return saveAs(`${fileName(name)}.png`, await asPng(image, 1));
  });
  row.firstChild.remove(); // the caption says the name
  words.append(row);
}

const dialog = document.querySelector("dialog");
for (const button of document.querySelectorAll(".enlarge")) button.addEventListener("click", () => {
  const seen = [...button.querySelectorAll("img")].find((one) => one.checkVisibility());
  dialog.querySelector("img").src = seen.src;
  dialog.querySelector("img").alt = seen.alt;
  dialog.classList.toggle("is-night", seen.className === "night");
  dialog.showModal();
});
dialog.querySelector("button").addEventListener("click", () => dialog.close());
