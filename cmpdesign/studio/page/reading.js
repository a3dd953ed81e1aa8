// What is told about a picture that was read: verdict, hints, markers, stages with their times; coupon, grid, sheet.

import { figures, h, number, toast } from "./base.js";
import { design } from "./state.js";

const STATUS = ["lost", "measured", "repaired from its neighbours", "fitted from its layer"];
const STAGES = { seeds: "cells found", mesh: "cells joined", walk: "cells numbered", triangles: "inks named", number: "ids given", markers: "markers", residual: "residuals" };

const box = (title, ...content) => h("div", { class: "box" }, h("h2", {}, title), ...content);
const verdict = (isGood, title, ...words) => h("div", { class: `finding ${isGood ? "good" : "error"}` }, h("b", { class: isGood ? "good" : "error" }, title), ...words);

// actions: stage(name) shows a stage, address(stage) is its picture's.
export function resultBoxes(found, actions) {
  if (found.kerf) return couponBoxes(found);
  if (found.grid) return gridBoxes(found);
  const told = verdict(found.verified, found.verified ? "Verified" : "Not verified", found.reason ?? found.line ?? `${found.measured} of ${found.present} markers measured, seen from the ${found.mirrored ? "back" : "front"}.`);
  const hints = [...new Set([...(found.quality?.hints ?? []), ...(found.advice ?? [])])].filter((hint) => !(found.reason ?? "").includes(hint)).map((hint) => h("div", { class: "finding warning" }, hint));
  const report = h("a", { class: "button", href: `/api/readings/${found.key}/report.zip`, download: "report.zip" }, "Report a problem, ZIP");
  const boxes = [box(found.name, told, ...hints, report)];
  if (found.sheet) boxes.push(box("Print sheet", figures(Object.entries(found.sheet).map(([name, value]) => [name.replaceAll("_", " "), typeof value === "number" ? number(value, 5) : String(value ?? "–")]))));
  return found.xy ? [...boxes, ...patternBoxes(found, actions)] : boxes;
}

function patternBoxes(found, { stage, address }) {
  const { quality, timings_ms: times } = found, total = Object.values(times).reduce((sum, one) => sum + one, 0), most = Math.max(...Object.values(times));
  const thumbnail = (name, title) => h("button", { "data-stage": name, "aria-pressed": "false", onclick: () => stage(name) }, h("img", { src: address(name), alt: "", loading: "lazy" }), title);
  const missed = Object.keys(STAGES).filter((name) => !found.stages.includes(name));
  const bars = Object.entries(times).map(([name, ms]) => { const bar = h("i"); bar.style.width = `${(100 * ms) / most}%`; return h("div", {}, name, bar, h("em", {}, `${ms.toFixed(1)} ms`)); });
  return [
    box("Markers", figures([["Measured", `${found.measured} of ${found.present}`], ["Repaired", found.repaired], ["Fitted", found.fitted], ["Lost", found.lost], ["Covered", found.explained ? found.explained.filter((one) => !one).length : "–"], ["Cells of another color", found.contradictions.length]]),
      h("span", { class: "legend" }, ["measured", "repaired", "fitted", "covered"].map((name, at) => h("span", { class: `l${at + 1}` }, name)))),
    quality && quality.edge_px !== null ? box("Picture", figures([["Size", `${found.size_px.join(" × ")} px`], ["Blur", `${number(quality.blur_px, 3)} px`], ["Noise", `${number(quality.noise, 3)} of 255`], ["Contrast", number(quality.contrast, 3)],
      ["Overexposed", quality.clipping === null ? "–" : `${number(100 * quality.clipping, 2)} %`], ["Evenness of light", number(quality.evenness, 2)], ["Gridline", `${number(quality.edge_px, 3)} px`]])) : "",
    box(`Stages, ${total.toFixed(1)} ms`, h("div", { class: "stages" }, thumbnail("picture", "picture"), found.stages.map((name) => thumbnail(name, STAGES[name] ?? name))),
      !found.xy.length && missed.length ? h("p", { class: "soft small" }, `Not reached: ${missed.map((name) => STAGES[name]).join(", ")}.`) : "", h("div", { class: "times" }, bars)),
  ].filter(Boolean);
}

function couponBoxes({ name, kerf, material }) {
  const take = (patch) => {
    const { kerf_mm, ...others } = design.fields.laser ?? {};
    design.set("laser", { ...others, kerf_x_mm: patch.kerf_x_mm, kerf_y_mm: patch.kerf_y_mm });
    toast(`The design's kerf is that of ${patch.name}.`);
  };
  const rows = kerf.patches.map((one) => h("tr", {}, h("th", { scope: "row" }, one.name), h("td", {}, `${one.power_percent} %, ${one.speed_mm_s} mm/s, ${one.passes} ×`), h("td", {}, one.kerf_x_mm.toFixed(4)), h("td", {}, one.kerf_y_mm.toFixed(4)),
    h("td", {}, Math.max(one.kerf_x_sigma_mm, one.kerf_y_sigma_mm).toFixed(4)), h("td", {}, h("button", { class: "tiny", "aria-label": `Use the kerf of ${one.name}`, onclick: () => take(one) }, "Use"))));
  return [box(name, verdict(true, "Coupon of the kerf", `${material}; openings of the ${kerf.face} are seen, ${number(kerf.scale_px_mm, 4)} px in a mm, marks fit to ${number(1000 * kerf.fit_mm, 2)} µm; light: ${kerf.response}.`)),
    box("Kerf at the front, mm", table(["Patch", "Settings", "x", "y", "±", "Take"], rows), h("p", { class: "soft small" }, `x of cuts along y, y of cuts along x${kerf.taper_assumed ? `; the taper of ${kerf.taper_deg}° is assumed` : ""}.`))];
}

function gridBoxes({ name, grid, material }) {
  const best = grid.fields.find((one) => one.name === grid.best), reserve = best && Math.min(...Object.keys(best.windows).map(Number).filter((count) => count > best.passes));
  const take = () => {
    design.set("laser", { ...design.fields.laser, power_percent: best.power_percent, speed_mm_s: best.speed_mm_s, passes: reserve });
    toast(`The design's laser has the settings of ${best.name}.`);
  };
  const counts = Object.keys(grid.fields[0].windows);
  const rows = grid.fields.map((one) => h("tr", { class: one === best ? "best" : null }, h("th", { scope: "row" }, one.name), h("td", {}, `${one.power_percent} %, ${one.speed_mm_s} mm/s`), counts.map((count) => h("td", {}, one.windows[count]))));
  return [box(name, verdict(Boolean(best), "Grid of settings", best ? `${material}: ${best.name} is the quickest that cuts with a pass in reserve: ${best.power_percent} %, ${best.speed_mm_s} mm/s, ${reserve} passes.` : "No field cuts through with a pass in reserve: raise the power, or lower the speed."),
    best ? h("button", { onclick: take }, "Use in the design") : ""), box("Windows by passes", table(["Field", "Settings", ...counts.map((count) => `${count} ×`)], rows))];
}

const table = (heads, rows) => h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": "Values" }, h("table", {}, h("thead", {}, h("tr", {}, heads.map((head) => h("th", { scope: "col" }, head)))), h("tbody", {}, rows)));

// All about one marker; moved: the displacements that are shown, if any.
export function markerBox(found, at, moved) {
  const { ids, xy, xy_mm, status, cov, layer, index, edges, explained } = found, [xx, xy_, yy] = cov[at], by = moved?.px[at], by_mm = moved?.mm[at];
  const neighbours = edges.flatMap(([from, to]) => (from === at ? [ids[to]] : to === at ? [ids[from]] : [])).sort((one, other) => one - other);
  const place = (values, digits) => values.map((value) => value.toFixed(digits)).join(", ");
  const rows = [["Status", STATUS[status[at]]], ["Layer, index", `${layer[at]}, ${index[at]}`], ["Place in the picture", `${place(xy[at], 2)} px`], ["Place in the layout", `${place(xy_mm[at], 3)} mm`],
    ["Deviation x, y", `${number(Math.sqrt(xx), 3)}, ${number(Math.sqrt(yy), 3)} px`], ["Covariance xy", `${number(xy_, 3)} px²`]];
  if (explained) rows.push(["Drawing explains the picture", explained[at] ? "yes" : "no: something covers the marker"]);
  if (moved) rows.push(["Displacement", by ? `${place(by, 3)} px` : "unknown"], ["± of both pictures", `${number(moved.sigma_px[at], 3)} px`], ["in the layout", by_mm ? `${place(by_mm, 4)} mm` : "–"]);
  rows.push(["Joined to", neighbours.join(", ") || "–"]);
  return [h("h2", {}, `Marker ${ids[at]}`), figures(rows)];
}
