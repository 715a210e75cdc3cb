"use strict";
// What every script of the report uses. No library, no network; text enters the page as textContent only.

const COLOURS = ["#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#5b3a9e"]; // Okabe and Ito, as in the figures
const DRIVE_COLOURS = ["#56b4e9", "#8a63d2"]; // of the second drive, from the last method on
const VIRIDIS = ["#440154", "#482878", "#3e4989", "#31688e", "#26828e", "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725"];
const LOWEST_M = 0.1, HIGHEST_M = 100; // of the colour scale, the same on every map so that they compare
const dark = matchMedia("(prefers-color-scheme: dark)");

function make(name, text, properties) {
  return Object.assign(document.createElement(name), text === undefined ? {} : { textContent: text }, properties);
}

/** Whether figures are drawn for paper just now, in light colours whatever the screen has. */
const paper = { on: false };

/** Large errors stand out: dark on white, bright on black. */
function ramp() {
  return dark.matches && !paper.on ? VIRIDIS.slice(2) : [...VIRIDIS].reverse(); // the darkest two are not seen on black
}

function errorColour(error) {
  const share = Math.log(Math.max(error, LOWEST_M) / LOWEST_M) / Math.log(HIGHEST_M / LOWEST_M);
  const colours = ramp();
  return colours[Math.min(colours.length - 1, Math.floor(share * colours.length))];
}

/** Index of the last time not after t, in an ascending list. */
function before(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}

function nearestInTime(times, t) {
  const i = before(times, t);
  return i + 1 < times.length && times[i + 1] - t < t - times[i] ? i + 1 : i;
}

/** The colours of the page that a figure is drawn in, by their names in style.css. */
function inksOf(element, names) {
  const style = getComputedStyle(element);
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Save text or bytes as a file of the reader's. */
function saveAs(name, blob) {
  const link = make("a", undefined, { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

const fileName = (name) => name.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").slice(0, 60) || "figure";
