// Over time: when each object was seen, and range, range rate, azimuth and SNR of the chosen one.
const MOST_STRIPS = 24;
let stripPlot = null;
let chartPlot = null;
const VERDICT_COLOURS = {
  detected: "#2f9e6e", "below noise": "#9aa5b1", masked: "#d9822b", "outside the beam": "#7b68c8",
  "ambiguous in Doppler": "#c2479b", occluded: "#5a6b7b", "specular away": "#4b8fd0", blanked: "#6f5b4b", absent: "#cfd6de",
};
const MISSED = "missed", SILENT = "no echo", UNKNOWN = "";

// What became of an object in a frame: the verdict of explain, else whether it was detected.
function verdictOf(radar, object, frame) {
  const told = radar.explained && radar.explained.verdicts[object][frame];
  if (told) return told;
  const seen = truthValue(radar, object, "detected", frame);
  if (seen === 0 && !Number.isFinite(truthValue(radar, object, "power_dbm", frame))) return SILENT;
  return seen === 1 ? "detected" : seen === 0 ? MISSED : UNKNOWN;
}
const verdictColour = (name) => (name === MISSED ? "#d05a4e" : name === SILENT ? "#aab4be" : VERDICT_COLOURS[name] || ink().grid);

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "object")) return;
  const radar = radarNow();
  const listed = radar.objects.map((o, i) => ({ ...o, i })).filter((o) => o.id > 0).slice(0, MOST_STRIPS);
  const legend = [...new Set(listed.flatMap((o) => radar.frames.map((_, k) => verdictOf(radar, o.i, k))))].filter(Boolean);
  byId("strips").parentElement.style.height = `${Math.max(60, 17 * listed.length + 44)}px`;
  const { ctx, width, height } = surface("strips");
  if (!listed.length) {
    nothing(ctx, width, height, "the run knows of no objects");
    return;
  }
  const c = ink();
  const box = { x: 96, y: 2, w: width - 96 - 8, h: 17 * listed.length };
  const cell = box.w / radar.frames.length;
  ctx.textBaseline = "middle";
  listed.forEach((o, row) => {
    const y = box.y + 17 * row;
    ctx.fillStyle = o.id === state.object ? c.ink : c.muted;
    ctx.textAlign = "right";
    ctx.font = o.id === state.object ? `600 ${FONT}` : FONT;
    ctx.fillText(o.name.length > 14 ? `${o.name.slice(0, 13)}…` : o.name, box.x - 8, y + 8);
    for (let k = 0; k < radar.frames.length; k++) {
      ctx.fillStyle = verdictColour(verdictOf(radar, o.i, k));
      ctx.fillRect(box.x + k * cell, y + 1, Math.max(cell - (cell > 4 ? 1 : 0), 0.5), 14);
    }
  });
  ctx.font = FONT;
  ctx.strokeStyle = c.ink;
  ctx.lineWidth = 1.5;
  ctx.strokeRect(box.x + state.frame * cell, box.y, Math.max(cell - 1, 2), box.h);
  let x = box.x;
  ctx.textAlign = "left";
  for (const name of legend) {
    ctx.fillStyle = verdictColour(name);
    ctx.fillRect(x, box.y + box.h + 10, 10, 10);
    ctx.fillStyle = c.muted;
    ctx.fillText(name, x + 14, box.y + box.h + 15);
    x += ctx.measureText(name).width + 28;
  }
  stripPlot = { box, cell, listed };
});

// ---- four charts
const CHARTS = [
  { title: "range [m]", truth: "range_m", of: (d) => d.range, track: 5 },
  { title: "range rate [m/s]", truth: "velocity_mps", of: (d) => d.velocity, fold: true },
  { title: "azimuth [°]", truth: "azimuth_deg", of: (d) => degrees(d.azimuth), track: 6, least: 4 },
  { title: "SNR [dB]", truth: null, of: (d) => d.snr_db, least: 20 },
];
let series = { key: "" };

// Root mean square of what the strongest detection of each frame is off the truth; NaN without any.
function rmsError(radar, index, points, chart) {
  if (!chart.truth || index < 0) return NaN;
  const direct = points.filter((p) => !p.d.ghost);
  const strongest = direct.filter((p, i) => i === 0 || direct[i - 1].k !== p.k);
  const off = strongest.map((p) => {
    const truth = truthValue(radar, index, chart.truth, p.k);
    return chart.fold ? folded(radar, chart.of(p.d) - truth) : chart.of(p.d) - truth;
  }).filter(Number.isFinite);
  return off.length ? Math.sqrt(off.reduce((sum, v) => sum + v * v, 0) / off.length) : NaN;
}

// Scene time of each frame, or its number where the run does not say when it was.
function timesOf(radar) {
  const times = radar.frames.map((f) => f.mid_s);
  const rising = times.every((t, k) => k === 0 || t > times[k - 1]);
  return rising ? { times, label: "scene time [s]" } : { times: radar.frames.map((f) => f.frame), label: "frame" };
}

// All detections of an object; kept until radar or object change.
function seriesOf(radar) {
  const key = `${radar.prefix} ${state.object}`;
  if (series.key === key) return series;
  const points = [];
  radar.frames.forEach((_, k) => {
    for (const d of detectionsOf(radar, k)) if (d.object === state.object) points.push({ k, d });
  });
  const index = radar.objects.findIndex((o) => o.id === state.object);
  series = { key, points, index, errors: CHARTS.map((chart) => rmsError(radar, index, points, chart)) };
  return series;
}

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "object")) return;
  const { ctx, width, height } = surface("charts");
  const radar = radarNow();
  const { points, index, errors } = seriesOf(radar);
  const { times, label } = timesOf(radar);
  const pad = times.length > 1 ? 0 : 0.5;
  byId("history-note").textContent = index < 0 ? "" : `${radar.objects[index].name}: line truth, dots detections${tracksOf(radar).length ? ", thick line track" : ""}`;
  if (index < 0) {
    nothing(ctx, width, height, "choose an object");
    return;
  }
  const w = width / 2, h = height / 2;
  chartPlot = [];
  CHARTS.forEach((chart, n) => {
    const box = { x: (n % 2) * w + 46, y: Math.floor(n / 2) * h + 18, w: w - 58, h: h - 18 - (n > 1 ? 40 : 28) };
    const truth = chart.truth ? times.map((_, k) => truthValue(radar, index, chart.truth, k)) : [];
    const seen = chart.fold ? truth.map((v) => folded(radar, v)) : truth;
    const tracked = tracksOf(radar).filter((t) => t.object_id === state.object && chart.track);
    const values = [...seen, ...points.map((p) => chart.of(p.d))].filter(Number.isFinite);
    const [low, high] = spread(values, chart.least || 2);
    const xs = scale(times[0] - pad, times[times.length - 1] + pad, box.x, box.x + box.w);
    const ys = scale(low, high, box.y + box.h, box.y);
    chartFrame(ctx, box, xs, ys, chart, n, xs(times[state.frame]), errors[n], label);
    ctx.save();
    ctx.beginPath();
    ctx.rect(box.x, box.y - 1, box.w, box.h + 2);
    ctx.clip();
    polyline(ctx, times.map((t, k) => [xs(t), ys(seen[k])]), ink().muted, 1.4, chart.fold ? box.h / 2 : Infinity);
    for (const track of tracked) {
      const rows = track.rows.map((r) => [radar.frames.findIndex((f) => f.frame === r[0]), r[chart.track]]);
      polyline(ctx, rows.filter((r) => r[0] >= 0).map((r) => [xs(times[r[0]]), ys(r[1])]), rounded(objectColour(radar, state.object), 0.55), 3);
    }
    for (const p of points) {
      ctx.fillStyle = objectColour(radar, state.object);
      ctx.globalAlpha = p.k === state.frame ? 1 : 0.65;
      ctx.beginPath();
      ctx.arc(xs(times[p.k]), ys(chart.of(p.d)), p.k === state.frame ? 4 : 2.4, 0, 2 * Math.PI);
      ctx.fill();
    }
    ctx.restore();
    if (!values.length) nothing(ctx, 2 * box.x + box.w, 2 * box.y + box.h, "no detection of it");
    chartPlot.push({ box, xs });
  });
});

function spread(values, least) {
  let low = Math.min(...values), high = Math.max(...values);
  if (!values.length) [low, high] = [0, 1];
  const room = Math.max(0.08 * (high - low), (least - (high - low)) / 2, 1e-6);
  return [low - room, high + room];
}

function chartFrame(ctx, box, xs, ys, chart, n, now, error, label) {
  const c = ink();
  axes(ctx, box, xs, ys, { x: n > 1 ? label : "", grid: true, xCount: box.w / 60, yCount: box.h / 28 });
  ctx.fillStyle = c.ink;
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  ctx.fillText(chart.title, box.x, box.y - 6);
  if (Number.isFinite(error)) {
    ctx.fillStyle = c.muted;
    ctx.textAlign = "right";
    ctx.fillText(`rms off truth ${Number(error.toPrecision(2))}`, box.x + box.w, box.y - 6);
  }
  ctx.strokeStyle = c.accent;
  ctx.lineWidth = 1.2;
  line(ctx, now, box.y, now, box.y + box.h);
}

// A line that breaks where values are missing, or jump by more than "jump" pixels.
function polyline(ctx, points, colour, width, jump = Infinity) {
  ctx.strokeStyle = colour;
  ctx.lineWidth = width;
  ctx.beginPath();
  let last = null;
  for (const p of points) {
    if (!Number.isFinite(p[1])) last = null;
    else {
      if (last && Math.abs(p[1] - last[1]) < jump) ctx.lineTo(p[0], p[1]);
      else ctx.moveTo(p[0], p[1]);
      last = p;
    }
  }
  ctx.stroke();
}

byId("strips").addEventListener("click", (event) => {
  if (!stripPlot) return;
  const [x, y] = pointerOn(event);
  const { box, cell, listed } = stripPlot;
  const row = Math.floor((y - box.y) / 17), frame = Math.floor((x - box.x) / cell);
  const changes = {};
  if (listed[row]) changes.object = listed[row].id;
  if (frame >= 0 && frame < radarNow().frames.length) changes.frame = frame;
  set({ ...changes, pick: -1 });
});
byId("charts").addEventListener("click", (event) => {
  const [x, y] = pointerOn(event);
  const hit = (chartPlot || []).find(({ box }) => x >= box.x - 4 && x <= box.x + box.w + 4 && y >= box.y && y <= box.y + box.h);
  if (!hit) return;
  const t = hit.xs.back(x);
  let best = 0;
  const { times } = timesOf(radarNow());
  times.forEach((time, k) => {
    if (Math.abs(time - t) < Math.abs(times[best] - t)) best = k;
  });
  set({ frame: best, pick: -1 });
});
