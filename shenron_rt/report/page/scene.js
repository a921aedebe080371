// The scene: rings, echoes, detections, objects and tracks drawn over the meshes.
let scenePlot = null;
let fitted = null;
let cameraMoved = false;

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "colour", "trail", "echoes", "tracks", "view", "object", "pick", "camera")) return;
  const { ctx, width: w, height: h } = surface("scene");
  if (w < 10 || h < 10) return;
  const key = `${state.radar} ${w} ${h}`;
  if (fitted !== key && !cameraMoved) {
    fitCamera(w, h);
    fitted = key;
  }
  const radar = radarNow();
  const m = viewMatrix(w, h);
  if (radar.bodies.length) paintMeshes(m);
  const at = (x, y, z = 0) => projected(m, w, h, x, y, z);
  sceneRings(ctx, radar, at, w, h);
  if (state.echoes) sceneEchoes(ctx, radar, at);
  if (state.tracks) scenePaths(ctx, radar, at);
  sceneTrail(ctx, radar, at);
  sceneDetections(ctx, radar, at);
  sceneTruths(ctx, radar, at, w);
  sceneRadar(ctx, at);
  if (state.view === "top") sceneAxes(ctx, w, h);
  sceneLegend(ctx, radar, w, h);
  scenePlot = { at, w, h };
});

const rounded = (colour, alpha) => `${colour}${Math.round(alpha * 255).toString(16).padStart(2, "0")}`;

function sceneRings(ctx, radar, at, w, h) {
  const c = ink();
  const reach = radar.profile.max_range_m;
  const ground = state.view === "top" ? 0 : -radar.mount.xyz_m[2];
  ctx.save();
  ctx.lineWidth = 0.8;
  ctx.strokeStyle = rounded(c.muted, 0.45);
  ctx.fillStyle = c.muted;
  ctx.textAlign = "center";
  ctx.textBaseline = "middle";
  const shown = state.view === "top" ? Math.min(reach, Math.hypot(w, h) / camera.top.scale) : reach;
  for (const r of [...ticks(0, shown, 5).filter((v) => v > 0 && v < reach), reach]) {
    ctx.setLineDash(r === reach ? [6, 4] : []);
    ctx.beginPath();
    let pen = false;
    for (let i = 0; i <= 90; i++) {
      const a = ((i - 45) * 2 * Math.PI) / 180;
      const p = at(r * Math.cos(a), r * Math.sin(a), ground);
      if (p && pen) ctx.lineTo(p[0], p[1]);
      else if (p) ctx.moveTo(p[0], p[1]);
      pen = Boolean(p);
    }
    ctx.stroke();
    const p = at(r * Math.cos(0.5), r * Math.sin(0.5), ground);
    if (p && r !== reach) haloText(ctx, `${fixed(r, r % 1 ? 1 : 0)} m`, p[0], p[1], c.muted, c.stage);
  }
  const half = ((radar.profile.beamwidth_az_deg || 0) * Math.PI) / 360;
  if (half > 0 && half < Math.PI / 2) {
    ctx.setLineDash([2, 4]);
    ctx.strokeStyle = rounded(c.accent, 0.8);
    for (const a of [half, -half]) {
      const from = at(0.5 * Math.cos(a), 0.5 * Math.sin(a), ground), to = at(reach * Math.cos(a), reach * Math.sin(a), ground);
      if (from && to) line(ctx, from[0], from[1], to[0], to[1]);
    }
    const p = at(8 * Math.cos(half), 8 * Math.sin(half), ground);
    if (p) haloText(ctx, "−3 dB", p[0], p[1], c.accent, c.stage);
  }
  ctx.restore();
}

function sceneEchoes(ctx, radar, at) {
  const known = radar.echoes;
  if (!known || !array(`${radar.prefix}.echo_level`)) return;
  const xyz = array(`${radar.prefix}.echoes`).data, level = array(`${radar.prefix}.echo_level`).data;
  for (let i = known.start[state.frame]; i < known.start[state.frame + 1]; i++) {
    const p = at(xyz[3 * i] * known.step_m, xyz[3 * i + 1] * known.step_m, xyz[3 * i + 2] * known.step_m);
    if (!p) continue;
    ctx.fillStyle = css(sequentialLut, level[i]);
    ctx.fillRect(p[0] - 1, p[1] - 1, 2, 2);
  }
}

// A point of the world at mid-frame of "frame", in the frame of the radar there.
function fromWorld(radar, frame, x, y, z) {
  const e = eyeOf(radar, frame);
  const d = [x - e[9], y - e[10], z - e[11]];
  return [0, 1, 2].map((i) => e[i] * d[0] + e[3 + i] * d[1] + e[6 + i] * d[2]);
}

function toWorld(radar, frame, x, y, z) {
  const e = eyeOf(radar, frame);
  return [0, 1, 2].map((i) => e[3 * i] * x + e[3 * i + 1] * y + e[3 * i + 2] * z + e[9 + i]);
}

const placed = (radar) => Boolean(array(`${radar.prefix}.radar`));

// A point seen from the radar in an earlier frame, as the radar of this frame has it; where nothing is known, unmoved.
function carried(radar, from, x, y, z) {
  return placed(radar) ? fromWorld(radar, state.frame, ...toWorld(radar, from, x, y, z)) : [x, y, z];
}

function sceneTrail(ctx, radar, at) {
  for (let k = Math.max(0, state.frame - state.trail); k < state.frame; k++) {
    ctx.globalAlpha = 0.15 + (0.5 * (k - state.frame + state.trail + 1)) / state.trail;
    for (const d of detectionsOf(radar, k)) {
      const p = at(...carried(radar, k, d.x, d.y, d.z));
      if (!p) continue;
      ctx.fillStyle = detectionColour(radar, d, k);
      ctx.beginPath();
      ctx.arc(p[0], p[1], 2, 0, 2 * Math.PI);
      ctx.fill();
    }
  }
  ctx.globalAlpha = 1;
}

function sceneDetections(ctx, radar, at) {
  const c = ink();
  for (const d of detectionsOf(radar, state.frame).reverse()) {
    const p = at(d.x, d.y, d.z);
    if (!p) continue;
    const foot = state.view === "orbit" && at(d.x, d.y, -radar.mount.xyz_m[2]);
    if (foot) {
      ctx.strokeStyle = rounded(c.muted, 0.6);
      ctx.lineWidth = 0.8;
      line(ctx, p[0], p[1], foot[0], foot[1]);
    }
    const radius = Math.min(7.5, Math.max(3, 2 + d.snr_db / 8));
    ctx.beginPath();
    if (d.ghost) ctx.rect(p[0] - radius, p[1] - radius, 2 * radius, 2 * radius);
    else ctx.arc(p[0], p[1], radius, 0, 2 * Math.PI);
    ctx.fillStyle = detectionColour(radar, d, state.frame);
    ctx.fill();
    ctx.lineWidth = 1.2;
    ctx.strokeStyle = darkNow() ? "rgba(0,0,0,0.8)" : "rgba(20,30,40,0.75)";
    ctx.stroke();
    if (d.row === state.pick) {
      ctx.lineWidth = 2;
      ctx.strokeStyle = c.accent;
      ctx.beginPath();
      ctx.arc(p[0], p[1], radius + 4, 0, 2 * Math.PI);
      ctx.stroke();
    }
  }
}

function sceneTruths(ctx, radar, at, w) {
  const c = ink();
  const name = labeller(ctx, w, c.ink, c.stage);
  ctx.font = `600 ${FONT}`;
  for (const t of truthsOf(radar, state.frame)) {
    if (!(t.id > 0) || !Number.isFinite(t.x_m)) continue;
    const p = at(t.x_m, t.y_m, 0);
    if (!p) continue;
    ctx.strokeStyle = objectColour(radar, t.id);
    ctx.lineWidth = 2;
    for (const [dx, dy] of [[5, 5], [5, -5]]) line(ctx, p[0] - dx, p[1] - dy, p[0] + dx, p[1] + dy);
    name(t.name, p[0] + 2, p[1]);
  }
  ctx.font = FONT;
}

// Where objects truly go (thin) and where tracks have them (thick, up to now), in the world as the radar sees it now.
function scenePaths(ctx, radar, at) {
  if (!placed(radar)) return;
  const stroke = (points, colour, width, dash = []) => {
    ctx.strokeStyle = colour;
    ctx.lineWidth = width;
    ctx.setLineDash(dash);
    ctx.beginPath();
    let pen = false;
    for (const q of points) {
      const p = q && at(...q);
      if (p && pen) ctx.lineTo(p[0], p[1]);
      else if (p) ctx.moveTo(p[0], p[1]);
      pen = Boolean(p);
    }
    ctx.stroke();
    ctx.setLineDash([]);
  };
  radar.objects.forEach((object, i) => {
    if (!(object.id > 0) || !radar.bodies.some((b) => b.id === object.id && b.moves)) return;
    const path = radar.frames.map((_, k) => {
      const x = truthValue(radar, i, "x_m", k), y = truthValue(radar, i, "y_m", k);
      return Number.isFinite(x) ? carried(radar, k, x, y, 0) : null;
    });
    stroke(path, rounded(objectColour(radar, object.id), 0.75), 1.2, [5, 4]);
  });
  for (const track of tracksOf(radar)) {
    const rows = track.rows.filter((r) => r[0] <= frameNow().frame);
    if (!rows.length) continue;
    const flat = (r, dt = 0) => {
      const p = fromWorld(radar, state.frame, r[1] + dt * r[3], r[2] + dt * r[4], eyeOf(radar, state.frame)[11]);
      return [p[0], p[1], 0];
    };
    const colour = track.object_id > 0 ? objectColour(radar, track.object_id) : ink().muted;
    stroke(rows.map((r) => flat(r)), colour, 2.4);
    const last = rows[rows.length - 1];
    if (last[0] === frameNow().frame) {
      stroke([flat(last), flat(last, 1)], colour, 1.4);
      const p = at(...flat(last));
      if (p) haloText(ctx, `T${track.track}`, p[0] + 8, p[1] + 12, colour, ink().stage);
    }
  }
}

function sceneRadar(ctx, at) {
  const p = at(0, 0, 0), ahead = at(1, 0, 0);
  if (!p || !ahead) return;
  const a = Math.atan2(ahead[1] - p[1], ahead[0] - p[0]);
  ctx.save();
  ctx.translate(p[0], p[1]);
  ctx.rotate(a);
  ctx.beginPath();
  ctx.moveTo(9, 0);
  ctx.lineTo(-6, 6);
  ctx.lineTo(-6, -6);
  ctx.closePath();
  ctx.fillStyle = ink().accent;
  ctx.fill();
  ctx.strokeStyle = ink().stage;
  ctx.stroke();
  ctx.restore();
}
