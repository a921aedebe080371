// Around the scene: its axes, its legend, and what mouse and keys do to it.
function sceneAxes(ctx, w, h) {
  const c = ink();
  const { x, y, scale: s } = camera.top;
  const ys = scale(y + w / 2 / s, y - w / 2 / s, 0, w), xs = scale(x - h / 2 / s, x + h / 2 / s, h, 0);
  ctx.save();
  ctx.fillStyle = rounded(c.stage, 0.82);
  ctx.fillRect(0, h - 32, w, 32);
  ctx.fillRect(0, 0, 40, h - 32);
  ctx.fillStyle = c.muted;
  ctx.strokeStyle = c.muted;
  ctx.textAlign = "center";
  ctx.textBaseline = "top";
  const across = ticks(ys.high, ys.low, w / 80), along = ticks(xs.low, xs.high, h / 60);
  for (const v of across) {
    if (ys(v) < 44 || ys(v) > w - 14) continue;
    line(ctx, ys(v), h - 32, ys(v), h - 28);
    ctx.fillText(fixed(v, across.digits), ys(v), h - 27);
  }
  ctx.fillText("left  ←  y [m]  →  right", w / 2, h - 14);
  ctx.textAlign = "right";
  ctx.textBaseline = "middle";
  for (const v of along) {
    if (xs(v) > h - 36 || xs(v) < 8) continue;
    line(ctx, 36, xs(v), 40, xs(v));
    ctx.fillText(fixed(v, along.digits), 34, xs(v));
  }
  ctx.textBaseline = "alphabetic";
  rotated(ctx, "x forward [m]", 11, (h - 32) / 2);
  ctx.restore();
}

function sceneLegend(ctx, radar, w, h) {
  const c = ink();
  ctx.save();
  if (state.colour === "object") {
    const listed = [...radar.objects.filter((o) => o.id > 0), { id: 0, name: "static, noise" }].slice(0, 12);
    ctx.fillStyle = rounded(c.stage, 0.8);
    ctx.fillRect(w - 142, 8, 134, 16 * listed.length + 8);
    ctx.textAlign = "left";
    ctx.textBaseline = "middle";
    listed.forEach((o, i) => {
      ctx.fillStyle = objectColour(radar, o.id);
      ctx.beginPath();
      ctx.arc(w - 130, 20 + 16 * i, 4.5, 0, 2 * Math.PI);
      ctx.fill();
      ctx.fillStyle = c.ink;
      ctx.fillText(o.name.length > 16 ? `${o.name.slice(0, 15)}…` : o.name, w - 120, 20 + 16 * i);
    });
  } else {
    const rule = COLOURINGS[state.colour];
    const [low, high] = colourLimits(radar, state.colour);
    ctx.fillStyle = rounded(c.stage, 0.8);
    ctx.fillRect(w - 78, 4, 74, 178);
    const colour = rule.signed ? (share) => signedColour(2 * share - 1) : levelColour;
    colourBar(ctx, { x: w - 70, y: 14, w: 10, h: 158 }, low, high, rule.label, colour);
  }
  ctx.fillStyle = c.muted;
  ctx.textAlign = "left";
  ctx.textBaseline = "top";
  const ghosts = array(`${radar.prefix}.detection_ghost`).data.includes(1);
  const echoes = state.echoes && radar.echoes ? `   ▪ echo, ${fixed(radar.echoes.top_dbm - radar.echoes.span_db, 0)} (dark) to ${fixed(radar.echoes.top_dbm, 0)} dBm` : "";
  const marks = `● detection, larger with SNR${ghosts ? "   ■ ghost" : ""}   × truth${state.tracks ? "   - - path" : ""}${echoes}`;
  haloText(ctx, marks, state.view === "top" ? 48 : 8, 8, c.muted, c.stage);
  ctx.restore();
}

const sceneCanvas = byId("scene");
let dragged = null;
function moved() {
  cameraMoved = true;
  redraw(["camera"]);
}

sceneCanvas.addEventListener("pointerdown", (event) => {
  sceneCanvas.setPointerCapture(event.pointerId);
  dragged = { x: event.clientX, y: event.clientY, far: 0 };
});
sceneCanvas.addEventListener("pointermove", (event) => {
  if (!dragged) return;
  const dx = event.clientX - dragged.x, dy = event.clientY - dragged.y;
  dragged = { x: event.clientX, y: event.clientY, far: dragged.far + Math.abs(dx) + Math.abs(dy) };
  if (dragged.far < 4) return;
  if (state.view === "orbit" && !event.shiftKey && event.buttons === 1) turn(dx, dy);
  else pan(dx, dy, scenePlot.h);
  moved();
});
sceneCanvas.addEventListener("pointerup", (event) => {
  const still = dragged && dragged.far < 4;
  dragged = null;
  if (!still || !scenePlot) return;
  const [x, y] = pointerOn(event);
  choose(nearestDetection(radarNow(), (d) => scenePlot.at(d.x, d.y, d.z) || [-1e9, 0], x, y));
});
sceneCanvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  const [x, y] = pointerOn(event);
  zoom(Math.exp(-event.deltaY * 0.0015), x, y, scenePlot.w, scenePlot.h);
  moved();
}, { passive: false });
sceneCanvas.addEventListener("keydown", (event) => {
  const { w, h } = scenePlot;
  const moves = { ArrowLeft: [40, 0], ArrowRight: [-40, 0], ArrowUp: [0, 40], ArrowDown: [0, -40] };
  if (event.key === "+" || event.key === "=") zoom(1.25, w / 2, h / 2, w, h);
  else if (event.key === "-") zoom(0.8, w / 2, h / 2, w, h);
  else if (event.key === "0") {
    fitCamera(w, h);
    cameraMoved = false;
  } else if (event.shiftKey && moves[event.key]) {
    if (state.view === "orbit") turn(...moves[event.key]);
    else pan(...moves[event.key], h);
  } else return;
  event.preventDefault();
  event.stopPropagation();
  if (event.key === "0") redraw(["camera"]);
  else moved();
});

// Tracks of a radar; rows are frame, x, y, vx, vy in the world, range [m], azimuth [deg], coasting.
const tracksOf = (radar) => (about.tracks[radar.name] ? about.tracks[radar.name].tracks : []);
