// A pen that understands what our figures ask of a canvas and writes it down as SVG, for print.

const XML_MARKS = { "&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;" };
const inXml = (text) => String(text).replace(/[&<>"]/g, (mark) => XML_MARKS[mark]);
const short = (value) => Number(value.toFixed(2));

class SvgPen {
  constructor(width, height, background) {
    Object.assign(this, { width, height, parts: [], stack: [], path: "", moves: [1, 0, 0, 1, 0, 0], dash: [] });
    Object.assign(this, { fillStyle: "#000", strokeStyle: "#000", lineWidth: 1, lineJoin: "miter", lineCap: "butt", globalAlpha: 1 });
    Object.assign(this, { font: "12px sans-serif", textAlign: "left", textBaseline: "alphabetic" });
    this.parts.push(`<rect width="${width}" height="${height}" fill="${inXml(background)}"/>`);
  }

  text() {
    const size = `width="${this.width}" height="${this.height}" viewBox="0 0 ${this.width} ${this.height}"`;
    return `<svg xmlns="http://www.w3.org/2000/svg" ${size}>\n${this.parts.join("\n")}\n</svg>\n`;
  }

  // The screen's own scale does not matter on paper.
  setTransform() { this.moves = [1, 0, 0, 1, 0, 0]; }
  clearRect() {}
  save() { this.stack.push([...this.moves]); }
  restore() { this.moves = this.stack.pop() || this.moves; }
  translate(x, y) {
    const [a, b, c, d, e, f] = this.moves;
    this.moves = [a, b, c, d, a * x + c * y + e, b * x + d * y + f];
  }
  rotate(angle) {
    const [a, b, c, d, e, f] = this.moves, cos = Math.cos(angle), sin = Math.sin(angle);
    this.moves = [a * cos + c * sin, b * cos + d * sin, c * cos - a * sin, d * cos - b * sin, e, f];
  }
  setLineDash(dash) { this.dash = dash; }

  beginPath() { this.path = ""; }
  moveTo(x, y) { this.path += `M${short(x)} ${short(y)}`; }
  lineTo(x, y) { this.path += `${this.path ? "L" : "M"}${short(x)} ${short(y)}`; }
  closePath() { this.path += "Z"; }
  arc(x, y, r, from, to, back = false) { this.ellipse(x, y, r, r, 0, from, to, back); }
  ellipse(x, y, rx, ry, turn, from, to, back = false) {
    const at = (angle) => {
      const [u, v] = [rx * Math.cos(angle), ry * Math.sin(angle)];
      return `${short(x + u * Math.cos(turn) - v * Math.sin(turn))} ${short(y + u * Math.sin(turn) + v * Math.cos(turn))}`;
    };
    const sweep = back ? 0 : 1, size = `${short(rx)} ${short(ry)} ${short((180 * turn) / Math.PI)}`;
    if (Math.abs(to - from) >= 2 * Math.PI - 1e-9) {
      const half = from + (back ? -Math.PI : Math.PI);
      this.path += `M${at(from)}A${size} 1 ${sweep} ${at(half)}A${size} 1 ${sweep} ${at(from)}Z`;
      return;
    }
    const span = (((back ? from - to : to - from) % (2 * Math.PI)) + 2 * Math.PI) % (2 * Math.PI);
    this.path += `${this.path ? "L" : "M"}${at(from)}A${size} ${span > Math.PI ? 1 : 0} ${sweep} ${at(to)}`;
  }

  look(more) {
    const moved = this.moves.some((value, i) => value !== [1, 0, 0, 1, 0, 0][i]);
    const place = moved ? ` transform="matrix(${this.moves.map((value) => Number(value.toFixed(4))).join(" ")})"` : "";
    return `${place}${this.globalAlpha < 1 ? ` opacity="${this.globalAlpha}"` : ""} ${more}`;
  }
  lines() {
    const dash = this.dash.length ? ` stroke-dasharray="${this.dash.join(" ")}"` : "";
    return `fill="none" stroke="${inXml(this.strokeStyle)}" stroke-width="${this.lineWidth}" stroke-linejoin="${this.lineJoin}" stroke-linecap="${this.lineCap}"${dash}`;
  }
  fill() { if (this.path) this.parts.push(`<path d="${this.path}"${this.look(`fill="${inXml(this.fillStyle)}"`)}/>`); }
  stroke() { if (this.path) this.parts.push(`<path d="${this.path}"${this.look(this.lines())}/>`); }
  box(x, y, w, h) { return `<rect x="${short(x)}" y="${short(y)}" width="${short(w)}" height="${short(h)}"`; }
  fillRect(x, y, w, h) { this.parts.push(`${this.box(x, y, w, h)}${this.look(`fill="${inXml(this.fillStyle)}"`)}/>`); }
  strokeRect(x, y, w, h) { this.parts.push(`${this.box(x, y, w, h)}${this.look(this.lines())}/>`); }

  measureText(text) {
    SvgPen.measure ??= document.createElement("canvas").getContext("2d");
    SvgPen.measure.font = this.font;
    return SvgPen.measure.measureText(text);
  }
  fillText(text, x, y) {
    const [, size] = this.font.match(/([\d.]+)px/) || [0, 12], bold = /bold|[67]00/.test(this.font) ? ' font-weight="700"' : "";
    const anchor = { right: "end", center: "middle" }[this.textAlign] || "start", drop = this.textBaseline === "middle" ? 0.35 * size : 0;
    const place = `x="${short(x)}" y="${short(y + drop)}" font-size="${size}" font-family="sans-serif" text-anchor="${anchor}"${bold}`;
    this.parts.push(`<text ${place}${this.look(`fill="${inXml(this.fillStyle)}"`)}>${inXml(text)}</text>`);
  }
  /** Another canvas, as pixels: frames and the sheets of grid cells. */
  drawImage(image, x, y, w = image.width, h = image.height) {
    const place = `x="${short(x)}" y="${short(y)}" width="${short(w)}" height="${short(h)}" preserveAspectRatio="none"`;
    this.parts.push(`<image ${place} style="image-rendering:pixelated" href="${image.toDataURL("image/png")}"/>`);
  }
}

/** A canvas's figure as SVG, in the colours of paper; ``root`` is the element whose colours it is drawn in. */
function onPaper(root, canvas, paint) {
  root.classList.add("on-paper");
  paper.on = true;
  try {
    const svg = new SvgPen(canvas.clientWidth || 600, canvas.clientHeight || 400, "#ffffff");
    paint(svg);
    return svg.text();
  } finally {
    paper.on = false;
    root.classList.remove("on-paper");
  }
}
