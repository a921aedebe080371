// Cameras of the scene, in the radar frame (x forward, y left, z up). Matrices are 4 x 4, column after column.
const camera = {
  top: { x: 40, y: 0, scale: 6 }, // middle of the picture [m], pixels a metre
  orbit: { x: 25, y: 0, z: 0, azimuth: 0, elevation: 0.42, distance: 60 }, // 0 looks along +x from behind
};

function multiply(a, b) {
  const m = new Float64Array(16);
  for (let c = 0; c < 4; c++) {
    for (let r = 0; r < 4; r++) {
      for (let k = 0; k < 4; k++) m[4 * c + r] += a[4 * k + r] * b[4 * c + k];
    }
  }
  return m;
}

// Rigid matrix of rotation (9 numbers, row after row) and origin (3).
function rigid(pose) {
  const r = pose;
  return Float64Array.of(r[0], r[3], r[6], 0, r[1], r[4], r[7], 0, r[2], r[5], r[8], 0, r[9], r[10], r[11], 1);
}

function inverseRigid(pose) {
  const r = pose;
  const t = [0, 1, 2].map((i) => -(r[i] * r[9] + r[3 + i] * r[10] + r[6 + i] * r[11]));
  return Float64Array.of(r[0], r[1], r[2], 0, r[3], r[4], r[5], 0, r[6], r[7], r[8], 0, t[0], t[1], t[2], 1);
}

const NEAR = 0.5, FAR = 3000, HALF_VIEW = Math.tan((40 * Math.PI) / 360);

// From the radar frame to clip coordinates, for a picture of w x h pixels.
function viewMatrix(w, h) {
  if (state.view === "top") {
    const { x, y, scale: s } = camera.top;
    const sx = (2 * s) / w, sy = (2 * s) / h;
    return Float64Array.of(0, sy, 0, 0, -sx, 0, 0, 0, 0, 0, -1 / 500, 0, sx * y, -sy * x, 0, 1);
  }
  const o = camera.orbit;
  const ca = Math.cos(o.azimuth), sa = Math.sin(o.azimuth), ce = Math.cos(o.elevation), se = Math.sin(o.elevation);
  const forward = [ca * ce, sa * ce, -se], right = [sa, -ca, 0], up = [ca * se, sa * se, ce];
  const eye = [o.x - o.distance * forward[0], o.y - o.distance * forward[1], o.z - o.distance * forward[2]];
  const dot = (a) => a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2];
  const look = Float64Array.of(
    right[0], up[0], -forward[0], 0, right[1], up[1], -forward[1], 0, right[2], up[2], -forward[2], 0,
    -dot(right), -dot(up), dot(forward), 1,
  );
  const f = 1 / HALF_VIEW, depth = 1 / (NEAR - FAR);
  const perspective = Float64Array.of((f * h) / w, 0, 0, 0, 0, f, 0, 0, 0, 0, (FAR + NEAR) * depth, -1, 0, 0, 2 * FAR * NEAR * depth, 0);
  return multiply(perspective, look);
}

// Pixel of a point; null behind the camera.
function projected(m, w, h, x, y, z) {
  const cw = m[3] * x + m[7] * y + m[11] * z + m[15];
  if (cw < NEAR / 2) return null;
  const cx = m[0] * x + m[4] * y + m[8] * z + m[12], cy = m[1] * x + m[5] * y + m[9] * z + m[13];
  return [(0.5 + (0.5 * cx) / cw) * w, (0.5 - (0.5 * cy) / cw) * h];
}

// Show what the radar sees: its range, and as far to the sides as clear detections and objects lie.
function fitCamera(w, h) {
  const radar = radarNow();
  const table = array(`${radar.prefix}.detections`);
  const n = table.shape[1];
  let far = 20, wide = 10;
  for (let i = 0; i < n; i++) {
    if (table.data[DETECTION.snr_db * n + i] < 15) continue;
    far = Math.max(far, table.data[DETECTION.x * n + i]);
    wide = Math.max(wide, Math.abs(table.data[DETECTION.y * n + i]));
  }
  radar.objects.forEach((object, i) => {
    if (!(object.id > 0)) return;
    radar.frames.forEach((_, k) => {
      const x = truthValue(radar, i, "x_m", k), y = truthValue(radar, i, "y_m", k);
      if (Number.isFinite(x) && Math.hypot(x, y) < radar.profile.max_range_m) [far, wide] = [Math.max(far, x), Math.max(wide, Math.abs(y))];
    });
  });
  far = Math.min(far * 1.08, radar.profile.max_range_m);
  const scaleUp = Math.min((h - 56) / (far * 1.06), (w - 60) / (2 * Math.max(wide, far * 0.18)));
  Object.assign(camera.top, { scale: scaleUp, x: (h / 2 - 44) / scaleUp - far * 0.04, y: 0 });
  Object.assign(camera.orbit, { x: far * 0.34, y: 0, z: -1, azimuth: 0, elevation: 0.42, distance: far * 0.72 });
}

function zoom(factor, px, py, w, h) {
  if (state.view === "orbit") {
    camera.orbit.distance = Math.min(800, Math.max(3, camera.orbit.distance / factor));
    return;
  }
  const c = camera.top;
  const ahead = (h / 2 - py) / c.scale, left = (w / 2 - px) / c.scale;
  const next = Math.min(400, Math.max(0.4, c.scale * factor));
  c.x += ahead - (h / 2 - py) / next;
  c.y += left - (w / 2 - px) / next;
  c.scale = next;
}

function pan(dx, dy, h) {
  if (state.view === "top") {
    camera.top.x += dy / camera.top.scale;
    camera.top.y += dx / camera.top.scale;
    return;
  }
  const o = camera.orbit;
  const metre = (2 * HALF_VIEW * o.distance) / h;
  const ca = Math.cos(o.azimuth), sa = Math.sin(o.azimuth);
  o.x += metre * (dy * ca - dx * sa);
  o.y += metre * (dy * sa + dx * ca);
}

function turn(dx, dy) {
  const o = camera.orbit;
  o.azimuth -= dx * 0.006;
  o.elevation = Math.min(1.5, Math.max(0.03, o.elevation + dy * 0.005));
}
