// Figures in the dark. What a figure's SVG draws in greys turns over, so that paper is dark and letters are light; the colours of
// methods stay what they are in tables and maps, and only those that would not be seen are made lighter.

const NIGHT_PAPER = [20, 24, 28], NIGHT_INK = [228, 232, 236]; // --paper and --ink of style.css in the dark
const GREY_SPREAD = 24; // largest difference of the channels of what is taken for a grey
const NIGHT_CONTRAST = 2.6; // of a colour with the dark paper, at least
const BAR_PX = 80; // width of a picture within a figure from which on it is no bar of colours but the figure itself, as a heat map
const AHEAD_PX = 1500; // figures are drawn so far before they come into sight

function luminance(colour) {
  const [r, g, b] = colour.map((level) => (level <= 10 ? level / 3295 : ((level / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r + 0.7152 * g + 0.0722 * b;
}

const mixed = (from, to, share) => from.map((level, i) => Math.round(level + share * (to[i] - level)));

/** A colour of a figure on white paper as it is on dark paper. */
function nightColour(colour) {
  if (Math.max(...colour) - Math.min(...colour) < GREY_SPREAD) return mixed(NIGHT_INK, NIGHT_PAPER, colour[1] / 255);
  const least = NIGHT_CONTRAST * (luminance(NIGHT_PAPER) + 0.05) - 0.05;
  for (let share = 0; share < 1; share += 0.05) {
    const lighter = mixed(colour, [255, 255, 255], share);
    if (luminance(lighter) >= least) return lighter;
  }
  return colour;
}

const hex = (colour) => `#${colour.map((level) => level.toString(16).padStart(2, "0")).join("")}`;
const rgb = (text) => [1, 3, 5].map((at) => parseInt(text.slice(at, at + 2), 16));

/** A picture within a figure, as the bar of colours beside a map, with the same change of its colours; null for a large one. */
async function nightPixels(address) {
  const image = await imageOf(address);
  if (Math.min(image.naturalWidth, image.naturalHeight) > BAR_PX) return null;
  const canvas = document.createElement("canvas"), pen = canvas.getContext("2d");
  [canvas.width, canvas.height] = [image.naturalWidth, image.naturalHeight];
  pen.drawImage(image, 0, 0);
  const pixels = pen.getImageData(0, 0, canvas.width, canvas.height), { data } = pixels;
  for (let i = 0; i < data.length; i += 4) data.set(nightColour([...data.slice(i, i + 3)]), i);
  pen.putImageData(pixels, 0, 0);
  return canvas.toDataURL();
}

/** The SVG of a figure for dark paper. What states no colour is black, and is ink there. Null if it is to stay as it is. */
async function nightSvg(svg) {
  const known = new Map(), embedded = [...svg.matchAll(/data:image\/png;base64,[A-Za-z0-9+/=\s]+/g)].map(([address]) => address);
  const recoloured = (text) => {
    if (!known.has(text)) known.set(text, hex(nightColour(rgb(text))));
    return known.get(text);
  };
  let text = svg.replace(/((?:fill|stroke)(?::\s*|="))(#[0-9a-f]{6})\b/g, (_, begin, colour) => begin + recoloured(colour));
  for (const address of embedded) {
    const pixels = await nightPixels(address.replace(/\s/g, ""));
    if (!pixels) return null; // letters upon it are in colours that are made for it
    text = text.replace(address, pixels);
  }
  return text.replace(/<svg /, `<svg fill="${hex(NIGHT_INK)}" `);
}

/** Put the figure for dark paper beside the one for white paper; the style shows one of them. */
async function drawForNight(figure) {
  const day = figure.querySelector("img"), night = new Image(day.getAttribute("width"), day.getAttribute("height"));
  const svg = await nightSvg(await unpacked(figure.querySelector("script").textContent));
  if (!svg) return figure.classList.add("photo");
  night.src = svgAddress(svg);
  await night.decode();
  night.alt = day.alt;
  night.className = "night";
  if (figure.classList.contains("flat")) night.style.width = `${night.width}px`; // as wide as the other, whose pixels are more
  day.after(night);
}

const drawnForNight = new IntersectionObserver((seen) => {
  for (const { target, isIntersecting } of seen) if (isIntersecting && dark.matches) {
    drawnForNight.unobserve(target);
    drawForNight(target).catch(() => {}); // the style turns the other over instead
  }
}, { rootMargin: `${AHEAD_PX}px` });

function watchFigures() {
  for (const figure of document.querySelectorAll(".gallery figure:has(script):not(:has(.night))")) drawnForNight.observe(figure);
}

if (dark.matches) watchFigures();
dark.addEventListener("change", () => { drawnForNight.disconnect(); if (dark.matches) watchFigures(); });
