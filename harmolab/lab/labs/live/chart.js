// Axes, stems and marks on a canvas.
const COLOUR = {
  music: "#0072b2", dance: "#e69f00", hit: "#009e73", miss: "#b2182b", ink: "#222222", grey: "#767676", field: "#d3e6f1", rule: "#d9d9d9", paper: "#ffffff", faded: "#b9b9b9",
  pale: "#a8cbe2", bins: "#7fb8d8",
};
// A page of a lab's own may be dark, and names its colours; in JupyterLab nobody does.
function readColours() {
  const style = getComputedStyle(document.documentElement);
  for (const name of Object.keys(COLOUR)) COLOUR[name] = style.getPropertyValue(`--${name}`).trim() || COLOUR[name];
}
const WIDE = 620;  // pixels from which panels stand side by side

// Places of panels: rows of [left, top, width, height] in shares of the width and in pixels; wide and narrow.
const placed = (width, [wide, narrow]) => (width >= WIDE ? wide : narrow).map(([left, top, across, height]) => (
  { left: 46 + left * (width - 10), top, width: across * (width - 10) - 46, height }));

function sharpened(canvas, width, height) {
  const scale = window.devicePixelRatio || 1, [across, down] = [Math.round(width * scale), Math.round(height * scale)];
  if (canvas.width !== across || canvas.height !== down) { canvas.width = across; canvas.height = down; canvas.style.height = `${height}px`; }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.fillStyle = COLOUR.paper; pen.fillRect(0, 0, width, height);
  pen.font = "12px system-ui, sans-serif";
  return pen;
}

function tickStep(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  return power * [1, 2, 5, 10].find(factor => factor * power >= raw * (1 - 1e-9));
}

// Axes in a box: ticks and names are drawn; returns the scales and the pen.
function axes(pen, box, [x0, x1], [y0, y1], { x = "", y = "", xTicks = 6, yTicks = 3, side = "" } = {}) {
  const chart = { pen, box, x: value => box.left + (value - x0) / (x1 - x0) * box.width, y: value => box.top + (y1 - value) / (y1 - y0) * box.height };
  const bottom = box.top + box.height, [xStep, yStep] = [tickStep(x0, x1, box.width < 260 ? Math.min(xTicks, 4) : xTicks), tickStep(y0, y1, yTicks)];
  const text = (value, step) => (Math.abs(value) < step / 2 ? 0 : value).toFixed(Math.max(0, -Math.floor(Math.log10(step) + 1e-9)));
  pen.lineWidth = 1; pen.fillStyle = COLOUR.ink; pen.textBaseline = "middle";
  pen.textAlign = "center";
  if (xTicks) {
    for (let value = Math.ceil(x0 / xStep) * xStep; value <= x1 + 1e-9; value += xStep) {
      line(chart, [chart.x(value), chart.x(value)], [bottom, bottom + 4], COLOUR.grey);
      pen.fillText(text(value, xStep), chart.x(value), bottom + 12);
    }
  }
  pen.textAlign = "right";
  if (yTicks) {
    for (let value = Math.ceil(y0 / yStep) * yStep; value <= y1 + 1e-9; value += yStep) {
      line(chart, [box.left, box.left + box.width], [chart.y(value), chart.y(value)], COLOUR.rule);
      pen.fillText(text(value, yStep), box.left - 6, chart.y(value));
    }
  }
  line(chart, [box.left, box.left + box.width], [bottom, bottom], COLOUR.grey);
  pen.fillText(x, box.left + box.width, bottom + 28, box.left + box.width - 4);  // a long source is set closer, not cut
  if (side) pen.fillText(side, box.left + box.width, box.top - 11);
  pen.textAlign = "left";
  pen.fillText(y, Math.max(box.left - 40, 4), box.top - 14);
  return chart;
}

// A line through points of the canvas.
function line({ pen }, xs, ys, colour, { width = 1, dash = [] } = {}) {
  pen.strokeStyle = colour; pen.lineWidth = width; pen.setLineDash(dash);
  pen.beginPath();
  xs.forEach((x, index) => (index ? pen.lineTo(x, ys[index]) : pen.moveTo(x, ys[index])));
  pen.stroke();
  pen.setLineDash([]);
}

const curve = (chart, xs, ys, colour, look) => line(chart, xs.map(chart.x), ys.map(chart.y), colour, look);
const level = (chart, value, colour, dash = [5, 4]) => line(chart, [chart.box.left, chart.box.left + chart.box.width], [chart.y(value), chart.y(value)], colour, { width: 1.4, dash });
const stem = (chart, x, height, colour, look = { width: 2.4 }) => line(chart, [chart.x(x), chart.x(x)], [chart.y(0), chart.y(height)], colour, look);

// A bar for each name, between 0 and 1; returns the scales, the first bar at 0.
function bars(pen, box, names, heights, colours, { x = "", y = "" }) {
  const chart = axes(pen, box, [-0.6, Math.max(1, names.length) - 0.4], [0, 1.05], { x, y, xTicks: 0 });
  names.forEach((name, index) => {
    pen.fillStyle = colours[index];
    pen.fillRect(chart.x(index - 0.33), chart.y(heights[index]), chart.x(0.66) - chart.x(0), chart.y(0) - chart.y(heights[index]));
    pen.fillStyle = COLOUR.ink; pen.textAlign = "center";
    pen.fillText(name, chart.x(index), box.top + box.height + 12);
  });
  return chart;
}

// A circle (met), a dot, a cross (missed), a diamond, a triangle, a square or a ring at a place of the canvas.
function mark({ pen }, kind, x, y, colour, size = 5) {
  pen.strokeStyle = colour; pen.fillStyle = COLOUR.paper; pen.lineWidth = 2;
  pen.beginPath();
  if (["circle", "ring", "dot"].includes(kind)) pen.arc(x, y, size, 0, 2 * Math.PI);
  else if (kind === "square") pen.rect(x - size, y - size, 2 * size, 2 * size);
  else if (kind === "diamond") [[0, -1], [1, 0], [0, 1], [-1, 0], [0, -1]].forEach(([dx, dy], step) => (step ? pen.lineTo(x + dx * size, y + dy * size) : pen.moveTo(x + dx * size, y + dy * size)));
  else if (kind === "triangle") { pen.moveTo(x, y - 5); pen.lineTo(x + 4.5, y + 4); pen.lineTo(x - 4.5, y + 4); }
  else for (const way of [1, -1]) { pen.moveTo(x - size, y - way * size); pen.lineTo(x + size, y + way * size); }
  if (kind === "circle") pen.fill();
  if (["diamond", "triangle", "dot"].includes(kind)) { pen.fillStyle = colour; pen.fill(); }
  if (kind !== "triangle") pen.stroke();
}

const sampled = ({ start, step, values }) => ({ times: values.map((_, index) => start + index * step), values });
