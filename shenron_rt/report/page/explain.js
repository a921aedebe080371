// The card of the chosen object: why it is seen or not, with the numbers that prove it.
painters.push((what) => {
  if (!changedAny(what, "radar", "frame", "object")) return;
  const radar = radarNow();
  const told = explanationOf(radar, state.frame);
  const why = told && told.objects[String(state.object)];
  byId("why").hidden = !why;
  if (!why) return;
  byId("why-title").textContent = `${nameOf(radar, state.object)}, frame ${frameNow().frame}: ${why.text}`;
  byId("card").replaceChildren(
    el("p", {}, why.change ? `What would make it visible: ${why.change}.` : ""),
    el("div", { class: "columns" }, waterfallTable(why), el("div", { class: "side" }, sharesTable(why), numbersTable(why))),
  );
});

function waterfallTable(why) {
  if (!why.stages.length) return el("p", { class: "empty" }, "No echo arrives: there is no budget to add up.");
  const most = Math.max(...why.stages.map((s) => Math.abs(s[1])), 1);
  const bar = (gain) => {
    const share = (50 * Math.abs(gain)) / most;
    const from = gain >= 0 ? 50 : 50 - share;
    const colour = gain >= 0 ? ink().truth : ink().bad;
    const fillStyle = `linear-gradient(to right, transparent ${from}%, ${colour} ${from}%, ${colour} ${from + share}%, transparent ${from + share}%)`;
    return el("td", { "aria-hidden": "true", style: { background: fillStyle, width: "16%", opacity: "0.75" } });
  };
  const rows = why.stages.map(([name, gain, level, unit, note]) => el("tr", {}, el("td", {}, name), el("td", { class: "n" }, (gain > 0 ? "+" : "") + fixed(gain)), bar(gain), el("td", { class: "n" }, `${fixed(level)} ${unit}`), el("td", {}, note)));
  return el("div", {}, el("table", {}, head(["link budget"], ["gain [dB]", 1], [""], ["level", 1], [""]), el("tbody", {}, ...rows)),
    el("p", { class: "note" }, why.closes ? "The budget closes: what no object explains is what noise may be." : "The budget does not close: more than noise is left unexplained."));
}

function sharesTable(why) {
  if (!why.shares.length) return "";
  const rows = why.shares.slice(0, 8).map(([name, cell, threshold]) => el("tr", {}, el("td", {}, name), number(cell, 1), number(threshold, 1)));
  rows.push(el("tr", {}, el("td", {}, "together, measured"), number(why.cell_dbm, 1), number(why.threshold_dbm, 1)));
  return el("table", {}, head(["who is in the cell"], ["cell [dBm]", 1], ["threshold [dBm]", 1]), el("tbody", {}, ...rows));
}

function numbersTable(why) {
  const plain = (value) => (typeof value === "number" ? fixed(value) : value && typeof value === "object" ? Object.entries(value).map(([k, v]) => `${k} ${plain(v)}`).join(", ") : String(value));
  const known = Object.entries(why.numbers || {}).filter(([, value]) => value !== null && plain(value) !== "");
  const rows = known.map(([name, value]) => el("tr", {}, el("td", {}, name.replaceAll("_", " ")), el("td", { class: "n", style: { whiteSpace: "normal" } }, plain(value))));
  return rows.length ? el("table", {}, head(["proof"], ["value", 1]), el("tbody", {}, ...rows)) : "";
}
