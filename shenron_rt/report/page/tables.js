// Tables: what the run is, objects and detections of the frame, settings.
const MOST_ROWS = 200;

function head(...columns) {
  return el("thead", {}, el("tr", {}, ...columns.map(([text, number]) => el("th", { class: number ? "n" : null, scope: "col" }, text))));
}

const dot = (colour) => el("span", { class: "dot", style: { background: colour }, "aria-hidden": "true" });
const number = (value, digits) => el("td", { class: "n" }, fixed(value, digits));

// A row that mouse, Enter and space choose.
function choosable(selected, onChoose, ...cells) {
  const key = (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    event.stopPropagation();
    onChoose();
  };
  return el("tr", { tabindex: "0", "aria-selected": String(selected), onclick: onChoose, onkeydown: key }, ...cells);
}

// Replace the rows of a table and keep the keyboard's place in it.
function fill(id, header, rows, none) {
  const table = byId(id);
  const focused = [...table.querySelectorAll("tbody tr")].indexOf(document.activeElement);
  const body = el("tbody", {}, ...rows);
  if (!rows.length) body.append(el("tr", {}, el("td", { class: "empty", colspan: "20" }, none)));
  table.replaceChildren(header, body);
  if (focused >= 0 && body.children[focused]) body.children[focused].focus({ preventScroll: true });
}

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "object")) return;
  const radar = radarNow();
  const told = explanationOf(radar, state.frame);
  const all = truthsOf(radar, state.frame);
  const level = (t) => (t.id === state.object ? Infinity : Number.isFinite(t.power_dbm) ? t.power_dbm : -999);
  const listed = all.length <= MOST_ROWS ? all : [...all].sort((a, b) => level(b) - level(a)).slice(0, MOST_ROWS);
  const rows = listed.map((t) => {
    const why = told && told.objects[String(t.id)];
    const verdict = verdictOf(radar, t.index, state.frame);
    const good = verdict === "detected";
    const words = why ? [why.verdict, why.by && `by ${why.by}`].filter(Boolean).join(" ") : { detected: "detected", missed: "not detected", [SILENT]: SILENT }[verdict] || "–";
    return choosable(t.id === state.object, () => set({ object: t.id, pick: -1 }),
      el("td", { class: "name" }, dot(objectColour(radar, t.id)), t.name), el("td", {}, t.tag || "–"),
      number(t.range_m), number(t.azimuth_deg, 1), number(t.velocity_mps), number(t.power_dbm, 1), number(t.snr_db, 1),
      el("td", { class: good ? "yes" : verdict && verdict !== SILENT ? "no" : null }, words));
  });
  const columns = [["object"], ["tag"], ["range [m]", 1], ["azimuth [°]", 1], ["range rate [m/s]", 1], ["power [dBm]", 1], ["SNR [dB]", 1], [radar.explained ? "verdict" : "seen"]];
  fill("objects", head(...columns), rows, "The run knows of no objects.");
  const few = all.length > MOST_ROWS ? `strongest ${MOST_ROWS} of ${all.length}; ` : "";
  byId("objects-note").textContent = few + "truth at mid-frame; SNR as if its whole power fell on the centre of one cell";
});

painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "pick", "colour")) return;
  const radar = radarNow();
  const found = detectionsOf(radar, state.frame);
  const told = explanationOf(radar, state.frame);
  const rows = found.slice(0, MOST_ROWS).map((d) => choosable(d.row === state.pick, () => choose(d),
    el("td", { class: "n" }, String(d.row + 1)),
    el("td", { class: "name" }, dot(detectionColour(radar, d, state.frame)), nameOf(radar, d.object)),
    number(d.range), number(degrees(d.azimuth), 2), number(degrees(d.elevation), 2), number(d.velocity), number(d.snr_db, 1), number(d.rcs_dbsm, 1),
    el("td", {}, detectionNotes(radar, d, told))));
  const columns = [["#", 1], ["object"], ["range [m]", 1], ["azimuth [°]", 1], ["elevation [°]", 1], ["range rate [m/s]", 1], ["SNR [dB]", 1], ["RCS [dBsm]", 1], [""]];
  fill("detections", head(...columns), rows, "Nothing was detected in this frame.");
  byId("detections-note").textContent = `${found.length} in this frame${found.length > MOST_ROWS ? `, the strongest ${MOST_ROWS} listed` : ", strongest first"}`;
});

// What else is known of a detection, in words.
function detectionNotes(radar, d, told) {
  const label = told && told.labels[d.row];
  const notes = [d.ghost ? "ghost" : "", label && label !== "direct" && !(d.ghost && label.startsWith("ghost")) ? label : "", d.ambiguous ? "ambiguous" : ""];
  if (d.chain.includes(">")) notes.push(`over ${chainWords(radar, d.chain)}`);
  return notes.filter(Boolean).join(", ");
}

// ---- settings
painters.push((what) => {
  if (!changedAny(what, "radar")) return;
  const { profile, mount, maps, echoes } = radarNow();
  byId("settings-note").textContent = `${profile.name} on radar ${radarNow().name}`;
  const row = (name, value) => el("tr", {}, el("td", {}, name), el("td", { class: "n" }, value));
  byId("derived").replaceChildren(el("tbody", {},
    ...profile.derived.map(([name, value, unit]) => row(name, `${Number(value.toPrecision(6))} ${unit}`.replace("-", "−"))),
    row("detection: false alarms a cell", String(profile.pfa)),
    row("mount x, y, z", `${mount.xyz_m.join(", ")} m`),
    row("mount yaw, pitch, roll", `${mount.ypr_deg.join(", ")}°`)));
  const notes = [];
  if (maps) {
    for (const [short, name] of [["rd", "range-Doppler"], ["ra", "range-azimuth"]]) {
      const { step_db, pool } = maps[short];
      const cells = pool[0] * pool[1] > 1 ? `, strongest of ${pool[0]} x ${pool[1]} cells` : "";
      notes.push(row(`${name} map in this page`, `steps of ${fixed(step_db)} dB${cells}`));
    }
  }
  if (echoes) notes.push(row("echoes in this page", echoes.every > 1 ? `one in ${echoes.every}, or more` : "all"));
  const hidden = about.meshes.reduce((n, m) => n + m.all_faces - m.faces, 0);
  if (hidden) notes.push(row("smallest triangles left out", String(hidden)));
  byId("derived").append(el("tbody", {}, ...notes));
  byId("given").replaceChildren(head(["key"], ["value", 1], ["source"]), el("tbody", {},
    ...profile.given.map(([key, value, source]) => el("tr", {}, el("td", {}, key), el("td", { class: "n" }, value), el("td", {}, source)))));
});

painters.push((what) => {
  if (!changedAny(what, "radar")) return;
  const s = about.summary;
  const { figures } = about.tracks[radarNow().name] || { figures: {} };
  const chips = [
    ["run", about.folder], ["frames", radarNow().frames.length], ["echo model", s.model], ["rays", s.rays], ["bounces", s.max_bounces],
    ["seed", s.seed], ["backend", s.backend], ["shenron_rt", s.version],
    ["tracks: OSPA", Number.isFinite(figures.ospa_m) ? `${fixed(figures.ospa_m)} m` : null],
    ["identity switches", figures.switches],
  ].filter(([, value]) => value !== undefined && value !== null);
  byId("chips").replaceChildren(...chips.map(([name, value]) => el("div", {}, el("dt", {}, name), el("dd", {}, value))));
  byId("description").textContent = about.description;
  byId("config").textContent = about.config;
});
