// The player: slider, buttons, keys, and the address that brings one back to a frame.
const seek = (frame) => set({ frame, pick: -1 });

let timer = null;
function play(on) {
  clearTimeout(timer);
  set({ playing: on });
  if (on) {
    if (state.frame >= radarNow().frames.length - 1) seek(0);
    timer = setTimeout(advance, pause());
  }
}

// Real time between frames, where the run says when they were.
function pause() {
  const frames = radarNow().frames;
  const now = frames[state.frame], next = frames[state.frame + 1];
  const gap = next ? 1000 * (next.mid_s - now.mid_s) : 100;
  return Math.min(1000, Math.max(40, gap > 0 ? gap : 100));
}

function advance() {
  if (state.frame >= radarNow().frames.length - 1) {
    play(false);
    return;
  }
  seek(state.frame + 1);
  timer = setTimeout(advance, pause());
}

function nextObject(step) {
  const ids = radarNow().objects.map((o) => o.id).filter((id) => id > 0);
  if (!ids.length) return;
  const at = ids.indexOf(state.object);
  set({ object: ids[(at + step + ids.length) % ids.length], pick: -1 });
}

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "playing")) return;
  const radar = radarNow();
  const frame = frameNow();
  const slider = byId("slider");
  slider.max = String(radar.frames.length - 1);
  slider.value = String(state.frame);
  const words = `frame ${frame.frame} · ${fixed(frame.mid_s, 3)} s · ${radar.detections.start[state.frame + 1] - radar.detections.start[state.frame]} detections`;
  slider.setAttribute("aria-valuetext", words);
  byId("clock").textContent = words;
  byId("play").textContent = state.playing ? "❚❚" : "▶";
  byId("play").setAttribute("aria-pressed", String(state.playing));
  byId("play").setAttribute("aria-label", state.playing ? "Pause" : "Play");
});

byId("slider").addEventListener("input", (event) => {
  play(false);
  seek(Number(event.target.value));
});
byId("play").addEventListener("click", () => play(!state.playing));
byId("previous").addEventListener("click", () => seek(state.frame - 1));
byId("next").addEventListener("click", () => seek(state.frame + 1));

document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const target = event.target;
  const typed = target.matches("select, pre") || (target.matches("input") && target.id !== "slider" && event.key === " ");
  if (typed || (target.matches("button, summary, input") && target.id !== "slider" && event.key === " ")) return;
  const jump = Math.max(1, Math.round(radarNow().frames.length / 10));
  const keys = {
    ArrowLeft: () => seek(state.frame - 1), ArrowRight: () => seek(state.frame + 1),
    Home: () => seek(0), End: () => seek(Infinity), " ": () => play(!state.playing),
    o: () => nextObject(1), O: () => nextObject(-1),
  };
  if (target.id === "slider") Object.assign(keys, { PageDown: () => seek(state.frame - jump), PageUp: () => seek(state.frame + jump) });
  if (!keys[event.key]) return;
  event.preventDefault();
  if (event.key !== " ") play(false);
  keys[event.key]();
});

// ---- #radar=front&frame=12&object=101
function fromAddress() {
  const wanted = new URLSearchParams(location.hash.slice(1));
  const changes = {};
  const radar = about.radars.findIndex((r) => r.name === wanted.get("radar"));
  if (radar >= 0) changes.radar = radar;
  const frames = about.radars[changes.radar ?? state.radar].frames;
  const frame = frames.findIndex((f) => String(f.frame) === wanted.get("frame"));
  if (frame >= 0) changes.frame = frame;
  const object = Number(wanted.get("object") ?? NaN);
  if (about.radars[changes.radar ?? state.radar].objects.some((o) => o.id === object)) changes.object = object;
  for (const name of ["view", "colour"]) if (wanted.has(name) && [...VIEWS, ...Object.keys(COLOURINGS), "object"].includes(wanted.get(name))) changes[name] = wanted.get(name);
  return changes;
}

let written = null;
painters.push(() => {
  clearTimeout(written);
  written = setTimeout(() => {
    const parts = { radar: radarNow().name, frame: frameNow().frame };
    if (state.object !== null) parts.object = state.object;
    history.replaceState(null, "", `#${new URLSearchParams(parts)}`);
  }, 300);
});
