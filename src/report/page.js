"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const COLORS = ["#7d8087", "#3a7bd5", "#e08a1e", "#2a9d8f", "#c2458f", "#7a5cc2", "#8a9a2b", "#b5623c", "#d23b3b",
  "#1b6b8f", "#555"];
const SVG = "http://www.w3.org/2000/svg";
const main = document.getElementById("main");

function make(tag, attributes = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else element.setAttribute(name, value);
  }
  element.append(...children);
  return element;
}

function draw(parent, tag, attributes, text) {
  const element = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  if (text !== undefined) element.textContent = text;
  parent.append(element);
  return element;
}

const short = (value) => value === null || value === undefined ? "–"
  : Math.abs(value) >= 0.01 && Math.abs(value) < 1000 ? String(+value.toPrecision(3)) : value.toExponential(1);
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

// Powers of ten, or 1, 2 and 5 times them on short axes.
function ticks(low, high) {
  const all = [];
  const steps = Math.log10(high / low) > 2.5 ? [1] : [1, 2, 5];
  for (let e = Math.floor(Math.log10(low)); e <= Math.ceil(Math.log10(high)); e++) {
    for (const step of steps) if (step * 10 ** e >= low && step * 10 ** e <= high) all.push(step * 10 ** e);
  }
  return all;
}

function plot(scene, metric, summary, colors) {
  const [width, height, left, bottom] = [400, 300, 52, 30];
  const points = summary.points.filter((point) => point.scene === scene && point.seconds > 0 && point.errors.every((e) => e > 0));
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  const box = make("div", { class: "plot" }, make("h3", {}, scene), svg);
  if (!points.length) return box;
  const times = points.map((point) => point.seconds);
  const errors = points.flatMap((point) => point.errors);
  const span = (values) => [Math.min(...values) / 1.25, Math.max(...values) * 1.25];
  const [[x0, x1], [y0, y1]] = [span(times), span(errors)];
  const x = (value) => left + Math.log(value / x0) / Math.log(x1 / x0) * (width - left - 8);
  const y = (value) => 8 + Math.log(y1 / value) / Math.log(y1 / y0) * (height - bottom - 8);
  for (const tick of ticks(x0, x1)) {
    draw(svg, "line", { class: "grid", x1: x(tick), x2: x(tick), y1: 8, y2: height - bottom });
    draw(svg, "text", { x: x(tick), y: height - bottom + 14, "text-anchor": "middle" }, short(tick));
  }
  for (const tick of ticks(y0, y1)) {
    draw(svg, "line", { class: "grid", x1: left, x2: width - 8, y1: y(tick), y2: y(tick) });
    draw(svg, "text", { x: left - 6, y: y(tick) + 3, "text-anchor": "end" }, short(tick));
  }
  draw(svg, "text", { x: width - 8, y: height - 2, "text-anchor": "end" }, "seconds, render and reconstruct");
  const floor = metric === "relmse" ? data.floors[scene] : undefined;
  if (floor > y0) draw(svg, "line", { x1: left, x2: width - 8, y1: y(floor), y2: y(floor), stroke: "currentColor",
    "stroke-dasharray": "2 4" });
  for (const [method, color] of colors) {
    const own = points.filter((point) => point.method === method).sort((a, b) => a.seconds - b.seconds);
    const group = draw(svg, "g", { "data-method": method, stroke: color, fill: color });
    const path = own.map((point) => `${x(point.seconds)},${y(mean(point.errors))}`).join(" ");
    draw(group, "polyline", { points: path, fill: "none", "stroke-width": 1.6 });
    for (const point of own) {
      const [at, error] = [x(point.seconds), mean(point.errors)];
      const ends = [Math.min(...point.errors), Math.max(...point.errors)].map(y);
      draw(group, "line", { x1: at, x2: at, y1: ends[0], y2: ends[1], "stroke-width": 1 });
      const dot = draw(group, "circle", { cx: at, cy: y(error), r: 3, "data-seconds": point.seconds,
        "data-error": error });
      draw(dot, "title", {}, `${method}, ${point.budget}: ${short(error)} in ${short(point.seconds)} s, `
        + `${short(point.spp)} spp`);
    }
  }
  return box;
}

function results() {
  const section = make("section", { id: "results" });
  const methods = data.summaries[0].rows.map((row) => row.method);
  const colors = methods.map((method, k) => [method, COLORS[k % COLORS.length]]);
  const scenes = [...new Set(data.summaries[0].points.map((point) => point.scene))];
  const [tables, plots, legend] = ["div", "div", "div"].map((tag) => make(tag));
  plots.className = "plots";
  legend.className = "legend";
  const hidden = new Set();
  const fade = () => plots.querySelectorAll("g[data-method]").forEach((group) =>
    group.classList.toggle("faded", hidden.has(group.dataset.method)));
  const ratio = (method, summary) => summary.rows.find((row) => row.method === method)?.ratio;
  const show = (at) => {
    const summary = data.summaries[at];
    const rows = summary.rows.map((row) => make("tr", {}, make("td", {}, row.method),
      ...data.summaries.map((one) => make("td", {}, short(ratio(row.method, one)))),
      ...[row.speedup, row.slope].map((value) => make("td", {}, short(value))),
      make("td", {}, `${row.wins} of ${row.runs}`)));
    const names = ["error over primal's", ...data.measures.map(([, name]) => name), "speed-up", "slope", "wins"];
    tables.replaceChildren(make("table", { id: "summary" },
      make("tr", {}, ...names.map((name) => make("th", {}, name))), ...rows));
    plots.replaceChildren(...scenes.map((scene) => plot(scene, data.measures[at][0], summary, colors)));
    fade();
  };
  for (const [method, color] of colors) {
    const button = make("button", { onclick: () => {
      if (!hidden.delete(method)) hidden.add(method);
      button.classList.toggle("off", hidden.has(method));
      fade();
    } }, make("i", { style: `background:${color}` }), method);
    legend.append(button);
  }
  const choice = make("select", { id: "metric", onchange: () => show(choice.value) },
    ...data.measures.map(([, name], at) => make("option", { value: at }, name)));
  section.append(make("h2", {}, "Error against time"), make("div", { class: "bar" }, choice), tables,
    make("p", {}, "Error over primal's: after the same time (with the same samples, if these are the budget), geometric mean over "
      + "those scenes and budgets that all methods have. Speed-up: the time path tracing would "
      + "need for the method's error at its largest budget, over the method's. Slope: median over scenes of error over "
      + "time, as logarithms. Wins: scenes and budgets with the least error. These three, and the plots, are of the measure that is chosen."),
    make("p", {}, "Dots are means over seeds, bars reach from the best to the worst seed. The reference's own noise, the dashed line, "
      + "is taken off relMSE."), legend, plots, errors());
  if (data.leftOut.length) {
    const list = data.leftOut.map((left) => `${left.method} on ${left.scene} within ${left.budget} (${left.reason})`);
    section.append(make("p", {}, `Left out: ${list.join("; ")}.`));
  }
  show(0);
  return section;
}

function errors() {
  const cell = (entry, noisy) => make("td", noisy ? { class: "noisy" } : {}, entry ? short(entry.mean) + (entry.alike ? " =" : "") : "–");
  const rows = data.errors.flatMap((scene) => scene.rows.map((row) => make("tr", {}, make("td", {}, scene.scene),
    make("td", {}, scene.budget), make("td", {}, row.method),
    ...row.errors.map((entry, at) => cell(entry, at > 0 && !scene.clean)), make("td", {}, short(scene.floor)))));
  const names = ["scene", "budget", "method", ...data.measures.map(([, name]) => name), "floor"];
  return make("details", { id: "errors" }, make("summary", {}, "Errors by scene"),
    make("p", {}, "Means over seeds; = marks what does not differ significantly from the least of the scene. The floor is the "
      + "reference's own relMSE. Where that is above a tenth of the scene's smallest relMSE, the other measures are grey: the noise of the "
      + "reference is a part of them."),
    make("table", {}, make("tr", {}, ...names.map((name) => make("th", {}, name))), ...rows));
}

function changes() {
  const word = (change) => ["better", "within noise", "worse"][change.verdict + 1];
  const rows = data.changes.map((change) => make("tr", {}, make("td", {}, change.scene),
    make("td", {}, change.method), make("td", {}, change.budget), make("td", {}, short(change.ratio)),
    make("td", { class: word(change) }, word(change))));
  const names = ["scene", "method", "budget", "relMSE now over then", ""];
  return make("section", { id: "changes" }, make("h2", {}, "Since the baseline"),
    make("table", {}, make("tr", {}, ...names.map((name) => make("th", {}, name))), ...rows));
}

function viewer(view) {
  const names = view.pictures.map((picture) => picture.label);
  const select = (value) => make("select", { onchange: update },
    ...names.map((name, k) => make("option", k === value ? { value: k, selected: "" } : { value: k }, name)));
  const [left, right] = [select(Math.max(0, names.length - 2)), select(names.length - 1)];
  const maps = make("input", { type: "checkbox", onchange: update });
  const slider = make("input", { type: "range", min: 0, max: 100, step: 0.1, value: 50, oninput: update });
  const [below, above, edge] = [make("img"), make("img"), make("div", { class: "edge" })];
  const stage = make("div", { class: "stage", style: `aspect-ratio:${view.width}/${view.height}` }, below, above, edge);
  const figures = make("p", {});
  const drag = (event) => {
    const box = stage.getBoundingClientRect();
    slider.value = 100 * (event.clientX - box.left) / box.width;
    update();
  };
  stage.addEventListener("pointermove", drag);
  function update() {
    const [a, b] = [view.pictures[left.value], view.pictures[right.value]];
    const source = (picture) => maps.checked && picture.map ? picture.map : picture.source;
    for (const [image, picture] of [[above, a], [below, b]]) if (image.src !== source(picture)) image.src = source(picture);
    above.style.clipPath = `inset(0 ${100 - slider.value}% 0 0)`;
    edge.style.left = `${slider.value}%`;
    const text = (picture) => picture.label + (picture.metrics.relmse === undefined ? "" :
      `: relMSE ${short(picture.metrics.relmse)}, SMAPE ${short(picture.metrics.smape)}, FLIP ${short(picture.metrics.flip)}, `
      + `1 - MS-SSIM ${short(picture.metrics.ms_ssim === null ? null : 1 - picture.metrics.ms_ssim)}`);
    figures.textContent = `${text(a)}  |  ${text(b)}`;
  }
  update();
  const crops = view.crops.map(([x, y]) => make("div", { class: "crops" }, ...view.pictures.map((picture) => {
    const side = Math.min(data.crop, view.width, view.height);
    const canvas = make("canvas", { width: side, height: side });
    const image = new Image();
    image.onload = () => canvas.getContext("2d").drawImage(image, x, y, side, side, 0, 0, side, side);
    image.src = picture.source;
    return make("figure", {}, canvas, make("figcaption", {}, picture.label));
  })));
  return make("div", { class: "viewer" }, make("h3", {}, view.name),
    make("div", { class: "bar" }, left, make("label", {}, maps, " error maps"), make("span", { class: "right" }, right)),
    stage, slider, figures, ...crops);
}

document.getElementById("about").textContent =
  [data.machine, data.version && `Fluxion ${data.version}`].filter(Boolean).join(", ");
if (data.summaries) main.append(results());
if (data.changes.length) main.append(changes());
if (data.views.length) {
  main.append(make("section", { id: "images" }, make("h2", {}, "Images"),
    make("p", {}, "Move over an image to compare two of them; tone mapped as FLIP sees them. Error maps are relMSE per "
      + "pixel, alike for all images of a scene. Below: the squares on which the images differ most by FLIP, a pixel three times as wide."),
    ...data.views.map(viewer)));
}
