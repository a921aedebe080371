// Colours: viridis for levels, blue-white-red for velocities, a fixed set for objects and for kinds of surface.
const sequentialLut = array("lut.sequential").data;
const divergingLut = array("lut.diverging").data;

const css = (lut, i) => `rgb(${lut[3 * i]},${lut[3 * i + 1]},${lut[3 * i + 2]})`;

function levelColour(share) {
  return css(sequentialLut, Math.round(255 * Math.min(1, Math.max(0, share))));
}

// share -1 to 1; 0 is white
function signedColour(share) {
  return css(divergingLut, 127 + Math.round(127 * Math.min(1, Math.max(-1, share))));
}

// After Okabe and Ito, whose colours stay apart for most eyes; the dark blue and the yellow moved to be seen on both schemes.
const OBJECT_COLOURS = [
  "#e69f00", "#56b4e9", "#12a37f", "#d55e00", "#cc79a7", "#4a78d6", "#c9b400", "#9467bd", "#a5694f", "#17becf",
];
const REST_COLOUR = "#8b98a6";

const objectColours = new Map();

function objectColour(radar, id) {
  if (!objectColours.has(radar)) {
    const named = radar.objects.filter((o) => o.id > 0);
    objectColours.set(radar, new Map(named.map((o, i) => [o.id, OBJECT_COLOURS[i % OBJECT_COLOURS.length]])));
  }
  return objectColours.get(radar).get(id) || REST_COLOUR;
}

// ---- how detections are coloured
const COLOURINGS = {
  velocity: { label: "range rate [m/s], receding +", signed: true, of: (radar, d) => d.velocity },
  ground: { label: "range rate over ground [m/s]", signed: true, of: (radar, d, frame) => overGround(radar, d, frame) },
  snr_db: { label: "SNR [dB]", signed: false, of: (radar, d) => d.snr_db },
  rcs_dbsm: { label: "RCS [dBsm]", signed: false, of: (radar, d) => d.rcs_dbsm },
};
const LIMITS = { snr_db: [10, 50], rcs_dbsm: [-20, 30] };

// Range rate without the radar's own motion, folded as the radar's velocities are: 0 is what stands.
function overGround(radar, d, frame) {
  const eye = array(`${radar.prefix}.radar`);
  if (!eye) return d.velocity;
  const r = Math.hypot(d.x, d.y, d.z) || 1;
  const own = radarVelocity(radar, frame);
  return folded(radar, d.velocity + (own[0] * d.x + own[1] * d.y + own[2] * d.z) / r);
}

// Velocity of the radar in its own frame [m/s].
function radarVelocity(radar, frame) {
  const eye = array(`${radar.prefix}.radar`);
  if (!eye) return [0, 0, 0];
  const m = eye.data.subarray(frame * 15, frame * 15 + 15);
  return [0, 1, 2].map((i) => m[i] * m[12] + m[3 + i] * m[13] + m[6 + i] * m[14]);
}

function colourLimits(radar, key) {
  if (LIMITS[key]) return LIMITS[key];
  const most = radar.profile.max_velocity_mps;
  return [-most, most];
}

function detectionColour(radar, d, frame) {
  if (state.colour === "object") return objectColour(radar, d.object);
  const rule = COLOURINGS[state.colour];
  const [low, high] = colourLimits(radar, state.colour);
  const value = rule.of(radar, d, frame);
  return rule.signed ? signedColour(value / high) : levelColour((value - low) / (high - low));
}

// ---- surfaces by semantic tag (CARLA's numbers since 0.9.14), light and dark scheme
const SURFACES = [
  { tags: [1, 24, 2, 10, 25, 23, 27], light: "#dfe4e9", dark: "#18222c" },
  { tags: [3, 4, 5, 26, 28, 20], light: "#b9c3cd", dark: "#34424f" },
  { tags: [9, 29], light: "#b4d0b0", dark: "#27432f" },
  { tags: [14, 15, 16, 17, 18, 19], light: "#8fb4dc", dark: "#3a6a9c" },
  { tags: [12, 13], light: "#e3b58c", dark: "#9a6a3c" },
];
const OTHER_SURFACE = { light: "#c4c9cf", dark: "#41505e" };

function surfaceColour(tag) {
  const kind = SURFACES.find((s) => s.tags.includes(tag)) || OTHER_SURFACE;
  const hex = kind[darkNow() ? "dark" : "light"];
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
}

// ---- the scheme
let inkCache = null;
function ink() {
  if (!inkCache) {
    const style = getComputedStyle(document.documentElement);
    inkCache = {};
    for (const name of ["ink", "muted", "line", "grid", "accent", "truth", "bad", "warn", "stage", "fan", "ring", "halo", "panel"]) {
      inkCache[name] = style.getPropertyValue(`--${name}`).trim();
    }
  }
  return inkCache;
}

const systemDark = matchMedia("(prefers-color-scheme: dark)");
let scheme = "auto";
const darkNow = () => scheme === "dark" || (scheme === "auto" && systemDark.matches);

function applyScheme(wanted) {
  scheme = wanted;
  document.documentElement.dataset.theme = darkNow() ? "dark" : "light";
  byId("theme").setAttribute("aria-label", `Colour scheme: ${{ auto: "as the system", dark: "dark", light: "light" }[scheme]}`);
  inkCache = null;
  redraw();
}
