// The range-Doppler map: range rate to the right, range up.
const MAP_RING = "#ffffff";
const BELOW_NOISE_DB = 5;
const PICKED = "#ff9d2e";

// Codes of a map of a frame as {codes, rows, columns}, or null.
function mapOf(radar, short, frame) {
  const found = array(`${radar.prefix}.${short}.${frame}`);
  return found && { codes: found.data, rows: found.shape[0], columns: found.shape[1] };
}

// Level of code 0 shown, and of the top [dBm].
// What lies well below the noise gets no colours of its own, unless all is asked for.
function mapWindow(map) {
  const low = Math.max(map.low_dbm, map.top_dbm - state.span, Math.min(map.noise_dbm - BELOW_NOISE_DB, map.top_dbm - 20));
  return [state.span ? low : map.low_dbm, map.top_dbm];
}

// Colours of the 256 codes of a map as 32-bit pixels.
function pixelLut(map) {
  const [low, high] = mapWindow(map);
  const lut = new Uint32Array(256);
  for (let code = 0; code < 256; code++) {
    const share = (map.low_dbm + code * map.step_db - low) / (high - low);
    const i = 3 * Math.round(255 * Math.min(1, Math.max(0, share)));
    lut[code] = (255 << 24) | (sequentialLut[i + 2] << 16) | (sequentialLut[i + 1] << 8) | sequentialLut[i];
  }
  return lut;
}

// An axis after pooling: where its first cell begins, how wide its cells are, how many there are.
function pooledAxis(first, step, count, pool) {
  const cells = Math.ceil(count / pool);
  return { begin: first - step / 2, width: step * pool, cells, end: first - step / 2 + step * pool * cells };
}

function rdAxes(radar) {
  const m = radar.maps;
  const v = m.velocity_mps;
  const step = v.length > 1 ? v[1] - v[0] : 2 * radar.profile.max_velocity_mps;
  return {
    range: pooledAxis(0, m.range_step_m, m.n_range, m.rd.pool[0]),
    velocity: pooledAxis(v[0], step, v.length, m.rd.pool[1]),
  };
}

// Level at a range and a range rate, of the cell as stored [dBm]; NaN outside.
function rdLevel(radar, frame, range, velocity) {
  const map = radar.maps && mapOf(radar, "rd", frame);
  if (!map) return NaN;
  const { range: r, velocity: v } = rdAxes(radar);
  const i = Math.floor((range - r.begin) / r.width), j = Math.floor((velocity - v.begin) / v.width);
  if (i < 0 || j < 0 || i >= map.rows || j >= map.columns) return NaN;
  return radar.maps.rd.low_dbm + map.codes[i * map.columns + j] * radar.maps.rd.step_db;
}

const rdImage = document.createElement("canvas");
let rdPlot = null;

function paintMapImage(map, coding, target) {
  target.width = map.columns;
  target.height = map.rows;
  const ctx = target.getContext("2d");
  const image = ctx.createImageData(map.columns, map.rows);
  const pixels = new Uint32Array(image.data.buffer);
  const lut = pixelLut(coding);
  for (let i = 0; i < map.rows; i++) {
    const from = i * map.columns, to = (map.rows - 1 - i) * map.columns;
    for (let j = 0; j < map.columns; j++) pixels[to + j] = lut[map.codes[from + j]];
  }
  ctx.putImageData(image, 0, 0);
}

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "span", "object", "pick")) return;
  const { ctx, width, height } = surface("rd");
  const radar = radarNow();
  const map = radar.maps && mapOf(radar, "rd", state.frame);
  if (!map) {
    nothing(ctx, width, height, mapsMissing());
    rdPlot = null;
    return;
  }
  const box = { x: 48, y: 6, w: width - 48 - 76, h: height - 6 - 38 };
  const at = rdAxes(radar);
  const xs = scale(at.velocity.begin, at.velocity.end, box.x, box.x + box.w);
  const most = Math.min(at.range.end, (radar.maps.n_range - 0.5) * radar.maps.range_step_m);
  const ys = scale(0, most, box.y + box.h, box.y);
  paintMapImage(map, radar.maps.rd, rdImage);
  ctx.save();
  ctx.beginPath();
  ctx.rect(box.x, box.y, box.w, box.h);
  ctx.clip();
  ctx.imageSmoothingEnabled = false;
  ctx.drawImage(rdImage, box.x, ys(at.range.end), box.w, ys(at.range.begin) - ys(at.range.end));
  restLine(ctx, radar, box, xs);
  mapMarks(ctx, radar, (d) => [xs(d.velocity), ys(d.range)], (t) => [xs(folded(radar, t.velocity_mps)), ys(t.range_m)], box.x + box.w);
  ctx.restore();
  axes(ctx, box, xs, ys, { x: "range rate [m/s], receding +", y: "range [m]" });
  const [low, high] = mapWindow(radar.maps.rd);
  const bar = { x: box.x + box.w + 12, y: box.y, w: 10, h: box.h };
  colourBar(ctx, bar, low, high, "mean of channels [dBm]", levelColour);
  noiseMark(ctx, bar, low, high, radar.maps.rd.noise_dbm);
  rdPlot = { box, xs, ys };
});

const mapsMissing = () => (document.readyState === "loading" ? "reading the page …" : "the run has kept no maps of this frame");

function nothing(ctx, width, height, text) {
  ctx.fillStyle = ink().muted;
  ctx.textAlign = "center";
  ctx.fillText(text, width / 2, height / 2);
}

// Where noise stands on the colour bar.
function noiseMark(ctx, bar, low, high, noise) {
  const y = bar.y + bar.h - ((noise - low) / (high - low)) * bar.h;
  if (y < bar.y || y > bar.y + bar.h) return;
  ctx.strokeStyle = ink().bad;
  ctx.lineWidth = 1.5;
  line(ctx, bar.x - 3, y, bar.x + bar.w + 2, y);
}

// What stands straight ahead has minus the radar's own speed, folded.
function restLine(ctx, radar, box, xs) {
  const own = radarVelocity(radar, state.frame)[0];
  if (Math.abs(own) < 0.1) return;
  const x = Math.round(xs(folded(radar, -own))) + 0.5;
  ctx.save();
  ctx.setLineDash([4, 4]);
  ctx.strokeStyle = "rgba(255,255,255,0.65)";
  line(ctx, x, box.y, x, box.y + box.h);
  ctx.restore();
  ctx.textAlign = "left";
  ctx.textBaseline = "top";
  haloText(ctx, "at rest, ahead", x + 4, box.y + 4, "rgba(255,255,255,0.9)", "rgba(0,0,0,0.55)");
}

// Detections as rings and objects as crosses; placeD and placeT give their pixels.
function mapMarks(ctx, radar, placeD, placeT, right) {
  const name = labeller(ctx, right, "#ffffff", "rgba(0,0,0,0.6)");
  for (const d of detectionsOf(radar, state.frame)) {
    const [x, y] = placeD(d);
    const chosen = d.row === state.pick;
    ring(ctx, x, y, chosen ? 7.5 : 5.5, chosen || (state.object > 0 && d.object === state.object) ? PICKED : MAP_RING, chosen ? 2.4 : 1.4, d.ghost);
  }
  for (const t of truthsOf(radar, state.frame)) {
    if (!(t.id > 0) || !t.echoes) continue;
    const [x, y] = placeT(t);
    if (!Number.isFinite(x) || !Number.isFinite(y)) continue;
    cross(ctx, x, y, 5, t.id === state.object ? PICKED : "#ffffff");
    name(t.name, x, y);
  }
}

function nearestDetection(radar, place, x, y, reach = 12) {
  let best = null, least = reach;
  for (const d of detectionsOf(radar, state.frame)) {
    const [px, py] = place(d);
    const away = Math.hypot(px - x, py - y);
    if (away < least) [best, least] = [d, away];
  }
  return best;
}

function detectionWords(radar, d) {
  return `${nameOf(radar, d.object)}: ${fixed(d.range)} m, ${fixed(degrees(d.azimuth), 1)}°, ${fixed(d.velocity)} m/s, SNR ${fixed(d.snr_db, 1)} dB, ${fixed(d.rcs_dbsm, 1)} dBsm`;
}

function pointerOn(event) {
  const bounds = event.currentTarget.getBoundingClientRect();
  return [event.clientX - bounds.left, event.clientY - bounds.top];
}

byId("rd").addEventListener("pointermove", (event) => {
  if (!rdPlot) return;
  const [x, y] = pointerOn(event);
  const { box, xs, ys } = rdPlot;
  const inside = x >= box.x && x <= box.x + box.w && y >= box.y && y <= box.y + box.h;
  const radar = radarNow();
  const range = ys.back(y), velocity = xs.back(x);
  const level = rdLevel(radar, state.frame, range, velocity);
  byId("rd-readout").textContent = inside
    ? `${fixed(range, 1)} m, ${fixed(velocity)} m/s: ${fixed(level, 1)} dBm, ${fixed(level - radar.maps.rd.noise_dbm, 1)} dB over noise`
    : "";
});
byId("rd").addEventListener("pointerleave", () => (byId("rd-readout").textContent = ""));
byId("rd").addEventListener("click", (event) => {
  if (!rdPlot) return;
  const [x, y] = pointerOn(event);
  choose(nearestDetection(radarNow(), (d) => [rdPlot.xs(d.velocity), rdPlot.ys(d.range)], x, y));
});

// Choose a detection, and the object it is of.
function choose(d) {
  if (!d) set({ pick: -1 });
  else set(d.object > 0 ? { pick: d.row, object: d.object } : { pick: d.row });
}
