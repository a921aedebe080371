// Data of the page and its one state. Arrays are decoded when they are first asked for; a few hundred are kept.
// Most of them stand after this script, so that the page shows before it is read to its end.
const byId = (id) => document.getElementById(id);
const about = JSON.parse(byId("about").textContent);
const TYPES = {
  u1: Uint8Array, i2: Int16Array, i4: Int32Array, u4: Uint32Array, f4: Float32Array, f8: Float64Array,
};
const KEPT = 300;
const decodedArrays = new Map();

function bytesOf(text) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(text);
  const raw = atob(text);
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

// {data, shape} of an array of the page, or null where the run had none.
function array(name) {
  const known = decodedArrays.get(name);
  if (known) return known;
  const element = byId(name);
  if (!element) return null;
  const bytes = bytesOf(element.textContent);
  const data = new TYPES[element.dataset.kind](bytes.buffer, bytes.byteOffset, bytes.length / TYPES[element.dataset.kind].BYTES_PER_ELEMENT);
  const found = { data, shape: element.dataset.shape.split(",").map(Number) };
  if (decodedArrays.size >= KEPT) decodedArrays.delete(decodedArrays.keys().next().value);
  decodedArrays.set(name, found);
  return found;
}

const parsed = new Map();
function json(name) {
  if (!parsed.has(name) && byId(name)) parsed.set(name, JSON.parse(byId(name).textContent));
  return parsed.get(name) || null;
}

// ---- state
const state = {
  radar: 0, frame: 0, colour: "velocity", span: 60, trail: 0, echoes: false, tracks: true, view: "top",
  object: null, pick: -1, playing: false,
};
const painters = [];
const stats = { redrawMs: 0, redraws: 0, firstPaintMs: 0 };
let due = null;

// Change the state; what has changed is drawn with the next animation frame.
function set(changes) {
  if ("frame" in changes) {
    const last = about.radars[changes.radar ?? state.radar].frames.length - 1;
    changes = { ...changes, frame: Math.min(last, Math.max(0, changes.frame)) };
  }
  const changed = Object.keys(changes).filter((key) => state[key] !== changes[key]);
  if (!changed.length) return;
  Object.assign(state, changes);
  redraw(changed);
}

function redraw(changed = ["all"]) {
  if (due) {
    changed.forEach((key) => due.add(key));
    return;
  }
  due = new Set(changed);
  requestAnimationFrame(() => {
    const what = due;
    due = null;
    const began = performance.now();
    for (const paint of painters) paint(what);
    stats.redrawMs = performance.now() - began;
    stats.redraws += 1;
    if (!stats.firstPaintMs) stats.firstPaintMs = performance.now();
  });
}

const changedAny = (what, ...keys) => what.has("all") || keys.some((key) => what.has(key));
const radarNow = () => about.radars[state.radar];
const frameNow = () => radarNow().frames[state.frame];

// ---- rows
const DETECTION = Object.fromEntries(about.columns.detections.map((name, i) => [name, i]));
const TRUTH = Object.fromEntries(about.columns.truth.map((name, i) => [name, i]));

// Detections of one frame as objects, angles in rad, strongest first; "row" counts within the frame.
function detectionsOf(radar, frame) {
  const table = array(`${radar.prefix}.detections`);
  const [ids, ghosts, chains] = ["id", "ghost", "chain"].map((name) => array(`${radar.prefix}.detection_${name}`).data);
  const total = table.shape[1];
  const { start } = radar.detections;
  const rows = [];
  for (let i = start[frame]; i < start[frame + 1]; i++) {
    const row = { row: i - start[frame], object: ids[i], ghost: ghosts[i] === 1, chain: radar.detections.chains[chains[i]] };
    for (const name in DETECTION) row[name] = table.data[DETECTION[name] * total + i];
    rows.push(row);
  }
  return rows;
}

function truthValue(radar, object, column, frame) {
  const table = array(`${radar.prefix}.truth`);
  return table.data[(object * table.shape[1] + TRUTH[column]) * table.shape[2] + frame];
}

// The true objects of one frame, as objects with the columns of TRUTH.
function truthsOf(radar, frame) {
  return radar.objects.map((object, i) => {
    const row = { index: i, ...object };
    for (const name in TRUTH) row[name] = truthValue(radar, i, name, frame);
    return row;
  });
}

function explanationOf(radar, frame) {
  return radar.explained ? json(`${radar.prefix}.explain.${frame}`) : null;
}

// Range rate as the radar reports it, in [-v_max, v_max).
function folded(radar, velocity) {
  const most = radar.profile.max_velocity_mps;
  return ((((velocity + most) % (2 * most)) + 2 * most) % (2 * most)) - most;
}

// ---- words and elements
function fixed(value, digits = 2) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(digits);
  return (/^-0\.?0*$/.test(text) ? text.slice(1) : text).replace("-", "−");
}

const degrees = (radians) => (radians * 180) / Math.PI;

const names = new Map();
function nameOf(radar, id) {
  if (!names.has(radar)) names.set(radar, new Map(radar.objects.map((o) => [o.id, o.name])));
  return id < 0 ? "noise" : names.get(radar).get(id) || `object ${id}`;
}

// The things a wave met between leaving the radar and coming back, by name.
function chainWords(radar, chain) {
  return chain.split(">").map((id) => nameOf(radar, Number(id))).join(" → ");
}

// An element with attributes and children; text stays text.
function el(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name === "style") Object.assign(element.style, value);
    else if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (value !== null && value !== undefined && value !== false) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined).map((child) => (child instanceof Node ? child : String(child))));
  return element;
}
