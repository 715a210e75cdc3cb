// The localizer's attractor networks at one time: the ring of head-direction cells and the sheets of grid cells.

const CELLS = 36; // along each side of a sheet: 10 degrees of phase a cell
const POPULATIONS = [[86, 180, 233], [230, 159, 0]]; // integrator sky blue, calibration orange, also told apart by the colour-blind
const SHARPEST = 30; // reliability in 1/rad^2 of a bump as wide as a cell: sharper ones are drawn as wide and brighter, not lost
const LOG_FLAT = Math.log(0.2), LOG_PEAK = Math.log(5000); // activities that are drawn black and full, natural logarithms

/** Log activity of a bump at an angle, of which a flat network has 0 and more a sharper one. */
function logBump(angle, mean, reliability) {
  const k = Math.max(reliability, 0);
  return 0.5 * Math.log(1 + 2 * Math.PI * k) + Math.min(k, SHARPEST) * (Math.cos(angle - mean) - 1);
}

function brightness(log) {
  return Math.min(1, Math.max(0, (log - LOG_FLAT) / (LOG_PEAK - LOG_FLAT)));
}

function makeBrain(root) {
  const ring = root.querySelector(".ring"), sheets = [...root.querySelectorAll(".sheet")];
  const images = sheets.map((sheet) => { sheet.width = sheet.height = CELLS; return sheet.getContext("2d").createImageData(CELLS, CELLS); });

  function showRing(belief, i) {
    const ratio = window.devicePixelRatio || 1, side = ring.clientWidth, pen = ring.getContext("2d");
    if (!side) return;
    ring.width = ring.height = Math.round(side * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    drawRing(pen, side, belief, i);
  }

  function drawRing(pen, side, belief, i) {
    const middle = side / 2;
    for (let population = 0; population < 2; population++) {
      const mean = belief.head_rad[i][population], reliability = belief.head_reliability[i][population];
      const inner = middle * (population ? 0.52 : 0.76), thick = middle * 0.22;
      for (let cell = 0; cell < CELLS; cell++) {
        const angle = (2 * Math.PI * cell) / CELLS, share = brightness(logBump(angle, mean, reliability));
        pen.fillStyle = `rgb(${POPULATIONS[population].map((c) => Math.round(c * share)).join(",")})`;
        pen.beginPath();
        pen.arc(middle, middle, inner + thick, -angle - Math.PI / CELLS, -angle + Math.PI / CELLS);
        pen.arc(middle, middle, inner, -angle + Math.PI / CELLS, -angle - Math.PI / CELLS, true);
        pen.fill();
      }
    }
    if (!belief.localized[i]) return;
    const ink = getComputedStyle(ring).getPropertyValue("--ink");
    pen.strokeStyle = ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(middle, middle);
    pen.lineTo(middle + 0.48 * middle * Math.cos(belief.heading_rad[i]), middle - 0.48 * middle * Math.sin(belief.heading_rad[i]));
    pen.stroke();
  }

  function drawSheet(module, belief, i) {
    const pixels = images[module].data, at = 4 * module, means = belief.grid_rad[i], sharp = belief.grid_reliability[i];
    const lines = [0, 1].map((population) => [0, 1].map((axis) => Array.from({ length: CELLS }, (_, cell) =>
      logBump((2 * Math.PI * cell) / CELLS - Math.PI, means[at + 2 * population + axis], sharp[at + 2 * population + axis]))));
    for (let y = 0; y < CELLS; y++) for (let x = 0; x < CELLS; x++) {
      const shares = lines.map(([along, across]) => brightness(along[x] + across[CELLS - 1 - y])), to = 4 * (CELLS * y + x);
      for (let c = 0; c < 3; c++) pixels[to + c] = Math.min(255, shares[0] * POPULATIONS[0][c] + shares[1] * POPULATIONS[1][c]);
      pixels[to + 3] = 255;
    }
    sheets[module].getContext("2d").putImageData(images[module], 0, 0);
  }

  const modulesOf = (belief, i) => Math.min(sheets.length, belief.grid_rad[i].length / 4);

  return {
    draw(belief, i) {
      showRing(belief, i);
      const modules = modulesOf(belief, i);
      sheets.forEach((sheet, module) => { sheet.closest("figure").hidden = module >= modules; });
      for (let module = 0; module < modules; module++) drawSheet(module, belief, i);
    },
    /** Ring and sheets in a row as SVG. */
    vector(belief, i) {
      const side = 150, gap = 12, modules = modulesOf(belief, i), size = { clientWidth: (modules + 1) * (side + gap) + gap, clientHeight: side + 40 };
      for (let module = 0; module < modules; module++) drawSheet(module, belief, i);
      return onPaper(ring, size, (svg) => {
        ["heading", ...sheets.slice(0, modules).map((_, module) => `grid module ${module + 1}`)].forEach((words, place) => {
          const x = gap + place * (side + gap);
          svg.fillStyle = "#333333";
          svg.fillText(words, x, side + 30);
          if (place) return svg.drawImage(sheets[place - 1], x, gap, side, side);
          svg.save();
          svg.translate(x, gap);
          drawRing(svg, side, belief, i);
          svg.restore();
        });
      });
    },
  };
}
