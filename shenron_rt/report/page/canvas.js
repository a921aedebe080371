// Canvases in CSS pixels, axes with units, colour bars.
const FONT = '11px system-ui, -apple-system, "Segoe UI", Roboto, sans-serif';
const surfaces = new Map();

// The 2-D context of a canvas, cleared and scaled to CSS pixels, with its size.
function surface(id) {
  const canvas = byId(id);
  const ratio = Math.min(window.devicePixelRatio || 1, 2);
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const w = Math.max(1, Math.round(width * ratio)), h = Math.max(1, Math.round(height * ratio));
  if (canvas.width !== w || canvas.height !== h) {
    canvas.width = w;
    canvas.height = h;
  }
  const ctx = canvas.getContext("2d");
  ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  ctx.font = FONT;
  ctx.lineWidth = 1;
  if (!surfaces.has(id)) {
    surfaces.set(id, true);
    new ResizeObserver(() => redraw()).observe(canvas);
  }
  return { ctx, width, height, ratio, canvas };
}

// Round numbers between two values, about "count" of them.
function ticks(low, high, count) {
  const raw = (high - low) / Math.max(1, count);
  if (!(raw > 0) || !Number.isFinite(raw)) return [];
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw * 0.999);
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
  found.digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  return found;
}

// A linear scale from values to pixels, and back.
function scale(low, high, from, to) {
  const at = (value) => from + ((value - low) / (high - low)) * (to - from);
  at.back = (pixel) => low + ((pixel - from) / (to - from)) * (high - low);
  at.low = low;
  at.high = high;
  return at;
}

// Ticks, labels and a frame around box {x, y, w, h}; xs and ys are scales.
function axes(ctx, box, xs, ys, { x = "", y = "", grid = false, xCount = box.w / 70, yCount = box.h / 42 } = {}) {
  const c = ink();
  ctx.save();
  ctx.strokeStyle = grid ? c.grid : c.line;
  ctx.fillStyle = c.muted;
  ctx.lineWidth = 1;
  const xt = ticks(Math.min(xs.low, xs.high), Math.max(xs.low, xs.high), xCount);
  const yt = ticks(Math.min(ys.low, ys.high), Math.max(ys.low, ys.high), yCount);
  ctx.textAlign = "center";
  ctx.textBaseline = "top";
  for (const v of xt) {
    const px = Math.round(xs(v)) + 0.5;
    line(ctx, px, grid ? box.y : box.y + box.h, px, box.y + box.h + 4);
    ctx.fillText(fixed(v, xt.digits), px, box.y + box.h + 6);
  }
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  for (const v of yt) {
    const py = Math.round(ys(v)) + 0.5;
    line(ctx, box.x - 4, py, grid ? box.x + box.w : box.x, py);
    ctx.fillText(fixed(v, yt.digits), box.x - 7, py);
  }
  ctx.strokeStyle = c.line;
  ctx.strokeRect(Math.round(box.x) - 0.5, Math.round(box.y) - 0.5, Math.round(box.w) + 1, Math.round(box.h) + 1);
  ctx.textAlign = "center";
  ctx.textBaseline = "alphabetic";
  if (x) ctx.fillText(x, box.x + box.w / 2, box.y + box.h + 31);
  if (y) rotated(ctx, y, box.x - 36, box.y + box.h / 2);
  ctx.restore();
}

function rotated(ctx, text, x, y) {
  ctx.save();
  ctx.translate(x, y);
  ctx.rotate(-Math.PI / 2);
  ctx.textAlign = "center";
  ctx.fillText(text, 0, 0);
  ctx.restore();
}

function line(ctx, x0, y0, x1, y1) {
  ctx.beginPath();
  ctx.moveTo(x0, y0);
  ctx.lineTo(x1, y1);
  ctx.stroke();
}

// A vertical colour bar; colour(share) gives its colours from bottom (0) to top (1).
function colourBar(ctx, box, low, high, label, colour) {
  const c = ink();
  ctx.save();
  const steps = Math.max(2, Math.round(box.h));
  for (let i = 0; i < steps; i++) {
    ctx.fillStyle = colour(i / (steps - 1));
    ctx.fillRect(box.x, box.y + box.h - i - 1, box.w, 1.5);
  }
  ctx.strokeStyle = c.line;
  ctx.strokeRect(box.x - 0.5, box.y - 0.5, box.w + 1, box.h + 1);
  ctx.fillStyle = c.muted;
  ctx.textBaseline = "middle";
  ctx.textAlign = "left";
  const marks = ticks(low, high, box.h / 40);
  for (const v of marks) {
    const y = box.y + box.h - ((v - low) / (high - low)) * box.h;
    ctx.fillText(fixed(v, marks.digits), box.x + box.w + 4, y);
  }
  rotated(ctx, label, box.x + box.w + 44, box.y + box.h / 2);
  ctx.restore();
}

// Text with a halo, so that it can be read on any map.
function haloText(ctx, text, x, y, colour, halo) {
  ctx.save();
  ctx.lineJoin = "round";
  ctx.lineWidth = 3;
  ctx.strokeStyle = halo;
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour;
  ctx.fillText(text, x, y);
  ctx.restore();
}

const MOST_NAMES = 60;

// Names beside points: right, left or higher up, where no other one stands yet; one labeller a picture.
function labeller(ctx, right, colour, halo) {
  const taken = [];
  return (text, x, y) => {
    if (taken.length >= MOST_NAMES) return;
    const width = ctx.measureText(text).width;
    const free = (x0, y0) => x0 >= 2 && x0 + width <= right && !taken.some((t) => Math.abs(t.y - y0) < 13 && x0 < t.x1 + 4 && x0 + width > t.x0 - 4);
    const places = [0, -13, 13, -26, 26, -39].flatMap((dy) => [[x + 9, y - 4 + dy], [x - 9 - width, y - 4 + dy]]);
    const [x0, y0] = places.find(([px, py]) => free(px, py)) || places[0];
    taken.push({ x0, x1: x0 + width, y: y0 });
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    haloText(ctx, text, x0, y0, colour, halo);
  };
}

// A ring around a detection, a square around a ghost; dark around light, so that it is seen on every colour of a map.
function ring(ctx, x, y, radius, colour, width, ghost) {
  ctx.beginPath();
  if (ghost) ctx.rect(x - radius, y - radius, 2 * radius, 2 * radius);
  else ctx.arc(x, y, radius, 0, 2 * Math.PI);
  ctx.lineWidth = width + 1.8;
  ctx.strokeStyle = "rgba(0,0,0,0.55)";
  ctx.stroke();
  ctx.lineWidth = width;
  ctx.strokeStyle = colour;
  ctx.stroke();
}

function cross(ctx, x, y, size, colour) {
  for (const [width, stroke] of [[3.2, "rgba(0,0,0,0.55)"], [1.5, colour]]) {
    ctx.lineWidth = width;
    ctx.strokeStyle = stroke;
    line(ctx, x - size, y, x + size, y);
    line(ctx, x, y - size, x, y + size);
  }
}
