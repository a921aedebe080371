// The range-azimuth map as a fan: forward up, left on the left.
let fanTable = null;
let fanPlot = null;
const fanImage = document.createElement("canvas");

function fanAxes(radar) {
  const m = radar.maps;
  const sine = m.azimuth_sine;
  const step = sine.length > 1 ? sine[1] - sine[0] : 2;
  const closed = sine.length > 1 && Math.abs(sine[sine.length - 1] + step + sine[0]) < 1e-6 * step;
  return { step, first: sine[0], count: sine.length, closed, side: Math.max(...sine.map(Math.abs)), reach: (m.n_range - 1) * m.range_step_m };
}

// For each pixel of the fan: its four cells and weights, or nothing outside. Made anew when the size or radar changes.
function tableFor(radar, w, h, map) {
  const key = `${radar.prefix} ${w} ${h}`;
  if (fanTable && fanTable.key === key) return fanTable;
  const { step, first, closed, side, reach } = fanAxes(radar);
  const [poolR, poolA] = radar.maps.ra.pool;
  const cell = new Int32Array(w * h).fill(-1), next = new Int32Array(w * h);
  const up = new Float32Array(w * h), across = new Float32Array(w * h);
  for (let py = 0; py < h; py++) {
    const x = reach * (1 - (py + 0.5) / h);
    for (let px = 0; px < w; px++) {
      const y = reach * side * (1 - (2 * (px + 0.5)) / w);
      const r = Math.hypot(x, y);
      const u = (r / radar.maps.range_step_m - (poolR - 1) / 2) / poolR;
      const v = ((y / r - first) / step - (poolA - 1) / 2) / poolA;
      const last = map.columns - (closed && poolA === 1 ? 0 : 1);
      if (r > reach || v < -0.5 || v > last + 0.5) continue;
      const i = Math.min(map.rows - 2, Math.max(0, Math.floor(u)));
      const j = Math.min(last - 1, Math.max(0, Math.floor(v)));
      const k = py * w + px;
      cell[k] = i * map.columns + j;
      next[k] = i * map.columns + ((j + 1) % map.columns);
      up[k] = Math.min(1, Math.max(0, u - i));
      across[k] = Math.min(1, Math.max(0, v - j));
    }
  }
  fanTable = { key, cell, next, up, across };
  return fanTable;
}

function paintFan(radar, map, w, h) {
  const { cell, next, up, across } = tableFor(radar, w, h, map);
  fanImage.width = w;
  fanImage.height = h;
  const ctx = fanImage.getContext("2d");
  const image = ctx.createImageData(w, h);
  const pixels = new Uint32Array(image.data.buffer);
  const lut = pixelLut(radar.maps.ra);
  const { codes, columns } = map;
  for (let k = 0; k < pixels.length; k++) {
    const a = cell[k];
    if (a < 0) continue;
    const b = next[k], s = across[k], t = up[k];
    const near = codes[a] * (1 - s) + codes[b] * s;
    const far = codes[a + columns] * (1 - s) + codes[b + columns] * s;
    pixels[k] = lut[(near * (1 - t) + far * t + 0.5) | 0];
  }
  ctx.putImageData(image, 0, 0);
}

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "span", "object", "pick")) return;
  const { ctx, width, height, ratio } = surface("ra");
  const radar = radarNow();
  const map = radar.maps && mapOf(radar, "ra", state.frame);
  if (!map || map.columns < 2 || map.rows < 2) {
    nothing(ctx, width, height, map ? "one channel in azimuth: no angle" : mapsMissing());
    fanPlot = null;
    return;
  }
  const { side, reach } = fanAxes(radar);
  const room = { w: width - 44 - 76, h: height - 16 - 38 };
  const pixel = Math.min(room.w / (2 * side * reach), room.h / reach);
  const box = { w: 2 * side * reach * pixel, h: reach * pixel };
  box.x = 44 + (room.w - box.w) / 2;
  box.y = 16 + room.h - box.h;
  const xs = scale(side * reach, -side * reach, box.x, box.x + box.w);
  const ys = scale(0, reach, box.y + box.h, box.y);
  paintFan(radar, map, Math.max(2, Math.round(box.w * ratio)), Math.max(2, Math.round(box.h * ratio)));
  ctx.drawImage(fanImage, box.x, box.y, box.w, box.h);
  fanRings(ctx, reach, side, xs, ys);
  const polar = (r, az) => [xs(r * Math.sin(az)), ys(r * Math.cos(az))];
  mapMarks(ctx, radar, (d) => polar(d.range, d.azimuth), (t) => (t.range_m > reach ? [NaN, NaN] : polar(t.range_m, (t.azimuth_deg * Math.PI) / 180)), box.x + box.w);
  axes(ctx, box, xs, ys, { x: "left  ←  y [m]  →  right", y: "x forward [m]" });
  const [low, high] = mapWindow(radar.maps.ra);
  const bar = { x: width - 64, y: box.y, w: 10, h: box.h };
  colourBar(ctx, bar, low, high, "beamformed [dBm]", levelColour);
  noiseMark(ctx, bar, low, high, radar.maps.ra.noise_dbm);
  fanPlot = { box, xs, ys, polar, reach };
});

function fanRings(ctx, reach, side, xs, ys) {
  ctx.save();
  ctx.strokeStyle = "rgba(255,255,255,0.28)";
  ctx.fillStyle = ink().muted;
  ctx.lineWidth = 0.8;
  const widest = Math.asin(Math.min(1, side));
  for (const r of ticks(0, reach, 5).filter((v) => v > 0 && v < reach)) {
    ctx.beginPath();
    for (let i = 0; i <= 60; i++) {
      const a = -widest + (2 * widest * i) / 60;
      ctx.lineTo(xs(r * Math.sin(a)), ys(r * Math.cos(a)));
    }
    ctx.stroke();
  }
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  for (const deg of [-60, -30, 0, 30, 60]) {
    const a = (deg * Math.PI) / 180;
    if (Math.abs(a) > widest) continue;
    line(ctx, xs(0), ys(0), xs(reach * Math.sin(a)), ys(reach * Math.cos(a)));
    ctx.fillText(`${deg > 0 ? "+" : ""}${fixed(deg, 0)}°`, xs(reach * Math.sin(a)) - 13 * Math.sin(a), ys(reach * Math.cos(a)) - 8 * Math.cos(a));
  }
  ctx.restore();
}

// Level at a range and an azimuth [rad], of the cell as stored [dBm]; NaN outside.
function raLevel(radar, frame, range, azimuth) {
  const map = radar.maps && mapOf(radar, "ra", frame);
  if (!map) return NaN;
  const { step, first, closed } = fanAxes(radar);
  const [poolR, poolA] = radar.maps.ra.pool;
  const i = Math.floor((range / radar.maps.range_step_m + 0.5) / poolR);
  let j = Math.floor(((Math.sin(azimuth) - first) / step + 0.5) / poolA);
  if (closed && j >= map.columns) j = 0; // the two ends of the grid are one direction
  if (i < 0 || j < 0 || i >= map.rows || j >= map.columns) return NaN;
  return radar.maps.ra.low_dbm + map.codes[i * map.columns + j] * radar.maps.ra.step_db;
}

byId("ra").addEventListener("pointermove", (event) => {
  if (!fanPlot) return;
  const [px, py] = pointerOn(event);
  const y = fanPlot.xs.back(px), x = fanPlot.ys.back(py);
  const range = Math.hypot(x, y), azimuth = Math.atan2(y, x);
  const level = raLevel(radarNow(), state.frame, range, azimuth);
  byId("ra-readout").textContent = x >= 0 && range <= fanPlot.reach && Number.isFinite(level)
    ? `${fixed(range, 1)} m, ${fixed(degrees(azimuth), 1)}°: ${fixed(level, 1)} dBm`
    : "";
});
byId("ra").addEventListener("pointerleave", () => (byId("ra-readout").textContent = ""));
byId("ra").addEventListener("click", (event) => {
  if (!fanPlot) return;
  const [x, y] = pointerOn(event);
  choose(nearestDetection(radarNow(), (d) => fanPlot.polar(d.range, d.azimuth), x, y));
});
