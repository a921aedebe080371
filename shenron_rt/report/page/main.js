// Controls of the page, and its start.
const VIEWS = ["top", "orbit"];

function changeRadar(index) {
  const now = frameNow().frame;
  const frames = about.radars[index].frames;
  const same = frames.findIndex((f) => f.frame >= now);
  set({ radar: index, frame: same < 0 ? frames.length - 1 : same, pick: -1 });
}

// The object one would look at first: a vehicle or a person with the strongest echo, else whatever has a name.
function firstObject() {
  const radar = radarNow();
  const moving = ["Car", "Truck", "Bus", "Motorcycle", "Bicycle", "Pedestrians", "Rider"];
  const ranked = radar.objects.map((o, i) => {
    const snr = Math.max(...radar.frames.map((_, k) => truthValue(radar, i, "snr_db", k)).filter(Number.isFinite), -999);
    return { id: o.id, rank: (moving.includes(o.tag) ? 1e4 : 0) + snr };
  }).filter((o) => o.id > 0).sort((a, b) => b.rank - a.rank);
  return ranked.length ? ranked[0].id : null;
}

function start() {
  const choice = byId("radar");
  choice.append(...about.radars.map((r, i) => el("option", { value: String(i) }, `${r.name} · ${r.profile.name}`)));
  if (about.radars.length < 2) choice.disabled = true;
  choice.addEventListener("change", () => changeRadar(Number(choice.value)));
  for (const id of ["colour", "trail", "span"]) {
    byId(id).addEventListener("change", (event) => set({ [id]: id === "colour" ? event.target.value : Number(event.target.value) }));
  }
  byId("show-echoes").addEventListener("change", (event) => set({ echoes: event.target.checked }));
  byId("show-echoes").disabled = !about.radars.some((r) => r.echoes);
  byId("show-tracks").addEventListener("change", (event) => set({ tracks: event.target.checked }));
  for (const view of VIEWS) byId(`view-${view}`).addEventListener("click", () => set({ view }));
  byId("view-fit").addEventListener("click", () => {
    cameraMoved = false;
    fitted = null;
    redraw(["camera"]);
  });
  byId("theme").addEventListener("click", () => applyScheme({ auto: darkNow() ? "light" : "dark", light: "dark", dark: "light" }[scheme]));
  systemDark.addEventListener("change", () => applyScheme(scheme));
  painters.push((what) => {
    if (!changedAny(what, "radar", "view", "colour", "trail", "span", "echoes", "tracks")) return;
    choice.value = String(state.radar);
    for (const id of ["colour", "trail", "span"]) byId(id).value = String(state[id]);
    byId("show-echoes").checked = state.echoes;
    byId("show-tracks").checked = state.tracks;
    for (const view of VIEWS) byId(`view-${view}`).setAttribute("aria-pressed", String(state.view === view));
  });
  Object.assign(state, fromAddress());
  if (state.object === null) state.object = firstObject();
  addEventListener("hashchange", () => set(fromAddress()));
  applyScheme("auto");
  document.addEventListener("DOMContentLoaded", () => redraw()); // by then the arrays after this script are there
}

start();
// For the console, and for tests: what the page knows and shows, and the pixels where it shows it.
window.report = {
  about, state, set, stats, array, json, detectionsOf, truthsOf, rdLevel, raLevel,
  sceneAt: (x, y, z) => scenePlot.at(x, y, z), fanAt: (range, azimuth) => fanPlot.polar(range, azimuth), rdAt: (velocity, range) => [rdPlot.xs(velocity), rdPlot.ys(range)],
};
