"use strict";
// Draws the report of a sweep from the data in the page. ECharts comes before this script.
const data = JSON.parse(document.getElementById("data").textContent);
const byId = (id) => document.getElementById(id);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const names = data.axes.map((a) => a.name);
const all = "(all together)";
const mostValues = 12, mostCurves = 8; // of an axis: beyond, its values are put into bins
const charts = {};

const column = { output: (row, o) => row[names.length + o], axis: (row, a) => row[a] };

// The values of an axis in the order of the plan, or bins of it where there are over `most`.
function levels(a, most = mostValues, bins = most) {
  const axis = data.axes[a];
  if (axis.words) return axis.values.map((v) => ({ label: String(v), holds: (x) => x === v }));
  const values = [...new Set(data.rows.map((row) => row[a]))].sort((p, q) => p - q);
  const text = (v) => String(Number(v.toPrecision(4)));
  if (values.length <= most) return values.map((v) => ({ label: text(v), middle: v, holds: (x) => x === v }));
  const low = values[0], high = values[values.length - 1];
  const place = (t) => (axis.log ? low * (high / low) ** t : low + t * (high - low));
  const all = Array.from({ length: bins }, (_, i) => {
    const from = place(i / bins), to = place((i + 1) / bins), last = i + 1 === bins;
    const middle = place((i + 0.5) / bins);
    return { label: bins < most ? `${Number(from.toPrecision(3))} to ${Number(to.toPrecision(3))}` : text(middle), middle, holds: (x) => x >= from && (last || x < to) };
  });
  return Object.assign(all, { binned: values.length });
}

function quantile(sorted, share) {
  const at = share * (sorted.length - 1), below = Math.floor(at);
  return sorted[below] + (at - below) * ((sorted[below + 1] ?? sorted[below]) - sorted[below]);
}

const finite = (v) => typeof v === "number" && Number.isFinite(v);
const short = (v) => (finite(v) ? String(Number(v.toPrecision(4))) : "–");

function chart(id, option, height) {
  const place = byId(id);
  if (height) place.style.height = height + "px";
  charts[id] ??= echarts.init(place, null, { renderer: "svg" });
  charts[id].resize();
  charts[id].setOption({ animation: false, textStyle: { fontFamily: "system-ui, sans-serif" }, ...option }, true);
}

const axisStyle = () => ({
  nameTextStyle: { color: colour("soft") }, nameLocation: "middle", axisLabel: { color: colour("soft") },
  axisLine: { lineStyle: { color: colour("line") } }, splitLine: { lineStyle: { color: colour("grid") } },
});
// A tooltip is HTML; names and words of a plan are not.
const html = (text) => String(text).replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
const tip = () => ({ backgroundColor: colour("card"), borderColor: colour("line"), textStyle: { color: colour("ink"), fontSize: 12.5 } });

// Ends of an axis of numbers. ECharts would end a logarithmic one at powers of ten below the values.
function extent(steps) {
  const all = steps.map((s) => s.middle), low = Math.min(...all), high = Math.max(...all);
  return low < high ? { min: low, max: high } : {};
}

// One curve with its band: the middle half of the cases at each level.
function curveOf(rows, a, o, steps) {
  return steps.map((level, i) => {
    const values = rows.filter((row) => level.holds(row[a])).map((row) => column.output(row, o)).filter(finite).sort((p, q) => p - q);
    const x = data.axes[a].words ? i : level.middle;
    return values.length ? { x, n: values.length, low: quantile(values, 0.25), mid: quantile(values, 0.5), high: quantile(values, 0.75) } : null;
  }).filter(Boolean);
}

// How many rows a legend of these names takes in a chart of this width, as ECharts sets them.
const mark = 30, gap = 10, edge = 10, row = 24, font = "12px system-ui, sans-serif"; // [px]
const pen = document.createElement("canvas").getContext("2d");
const legend = { names: [], rows: 1 };
function rowsOfLegend(names, width) {
  pen.font = font;
  let rows = 1, x = edge;
  for (const name of names) {
    const wide = mark + Math.ceil(1.05 * pen.measureText(name).width) + gap; // 5 %: a font is not the same everywhere
    if (x > edge && x + wide > width) [rows, x] = [rows + 1, edge];
    x += wide;
  }
  return rows;
}

const lineHeight = 16; // of names in several lines [px]
// A name in lines of at most `width`, which end at spaces or after '_', '.' and '/'.
function inLines(name, width) {
  pen.font = font;
  const lines = [""];
  for (const part of name.match(/[^ _./]*[ _./]*/g).filter(Boolean)) {
    if (lines.at(-1) && pen.measureText(lines.at(-1) + part).width > width) lines.push("");
    lines[lines.length - 1] += part;
  }
  return lines.join("\n");
}

// What the points of the curves stand for where an axis has too many values.
function binsInWords(steps, a, groups, b) {
  const points = steps.binned ? ` ${names[a]} has ${steps.binned} values: they are put into ${steps.length} bins, and a point stands in the middle of its bin.` : "";
  return points + (groups.binned ? ` ${names[b]} has ${groups.binned} values: a curve is of a range of them.` : "");
}

function drawCurve(o, a, b) {
  const steps = levels(a), axis = data.axes[a];
  const groups = b === null ? [{ label: data.outputs[o], holds: () => true, whole: true }] : levels(b, mostCurves, 4);
  const series = [], marks = data.marks.filter((m) => m.output === data.outputs[o]);
  groups.forEach((group, g) => {
    const rows = data.rows.filter((row) => group.whole || group.holds(row[b]));
    const points = curveOf(rows, a, o, steps), shade = colour("c" + (g % 8));
    const name = group.whole ? group.label : names[b] + " = " + group.label;
    const band = [...points.map((p) => [p.x, p.high]), ...points.slice().reverse().map((p) => [p.x, p.low])];
    if (points.length > 1) {
      series.push({
        // Its own points, else the part of the axes that is shown leaves it out or cuts it; the first of them draws it.
        name, type: "custom", silent: true, z: 1, data: band, itemStyle: { color: shade }, tooltip: { show: false },
        renderItem: (params, api) => (params.dataIndexInside > 0 ? null : { type: "polygon", shape: { points: band.map((p) => api.coord(p)) }, style: { fill: shade, opacity: 0.16 }, clipPath: null }),
        clip: true,
      });
    }
    series.push({
      name, type: "line", z: 3, symbolSize: 6, itemStyle: { color: shade }, lineStyle: { color: shade, width: 1.8 },
      data: points.map((p) => ({ value: [p.x, p.mid], n: p.n, low: p.low, high: p.high })),
      markLine: g > 0 ? undefined : {
        symbol: "none", silent: true, lineStyle: { color: colour("soft"), type: "dashed" },
        label: { formatter: "{b}", position: "insideEndTop", color: colour("soft") },
        data: marks.map((m) => ({ name: m.label, yAxis: m.at })),
      },
    });
  });
  byId("bins").textContent = binsInWords(steps, a, groups, b);
  legend.names = [...new Set(series.map((s) => s.name))];
  legend.rows = rowsOfLegend(legend.names, byId("curve").clientWidth);
  // Draws nothing: the axis reaches to the marks as to the curves, whatever part of the width is shown.
  series.push({ type: "custom", silent: true, data: marks.map((m) => [NaN, m.at]), tooltip: { show: false }, renderItem: () => null });
  const top = 20 + row * legend.rows;
  const x = axis.words
    ? { type: "category", data: steps.map((s) => s.label) }
    : { type: axis.log ? "log" : "value", scale: true, ...extent(steps), axisLabel: { color: colour("soft"), formatter: short } };
  chart("curve", {
    grid: { left: 74, right: 24, top, bottom: 92 },
    legend: { type: "plain", top: 4, textStyle: { color: colour("soft") }, data: legend.names },
    tooltip: { trigger: "item", ...tip(), formatter: (p) => `${p.marker}${html(p.seriesName)}<br>${html(names[a])}: ${axis.words ? html(steps[p.value[0]]?.label ?? p.name) : short(p.value[0])}<br>median ${short(p.value[1])}, middle half ${short(p.data.low)} to ${short(p.data.high)}, ${p.data.n} cases` },
    xAxis: { ...axisStyle(), name: names[a], nameGap: 28, ...x },
    yAxis: { ...axisStyle(), name: data.outputs[o], nameGap: 54, type: "value", scale: true },
    dataZoom: axis.words ? [] : [{ type: "slider", height: 18, bottom: 12, textStyle: { color: colour("soft") }, labelFormatter: (v) => short(v) }, { type: "inside" }],
    series,
  }, 376 + top);
}

function drawMap(o, a, b) {
  const across = levels(a), up = levels(b), cells = [];
  up.forEach((v, j) => across.forEach((u, i) => {
    const values = data.rows.filter((row) => u.holds(row[a]) && v.holds(row[b])).map((row) => column.output(row, o)).filter(finite);
    if (values.length) cells.push([i, j, values.reduce((s, x) => s + x, 0) / values.length, values.length]);
  }));
  const values = cells.map((c) => c[2]);
  // On a narrow page the scale lies below the fields, and a value is left out that is wider than its field.
  const width = byId("map").clientWidth, narrow = width < 560;
  pen.font = font;
  const widest = (words) => 1.05 * Math.max(...words.map((w) => pen.measureText(w).width));
  const beside = Math.min(widest(up.map((l) => l.label)), 0.3 * width), left = Math.max(beside + 44, narrow ? 0 : 84), right = narrow ? 12 : 110;
  const numbered = cells.length <= 64 && widest(values.map(short)) + 4 <= (width - left - right) / across.length;
  byId("fields").textContent = numbered ? "" : " Point at a field to read its value.";
  chart("map", {
    grid: { left, right, top: 16, bottom: narrow ? 100 : 56 },
    tooltip: { ...tip(), formatter: (p) => `${html(names[a])} ${html(across[p.value[0]].label)}, ${html(names[b])} ${html(up[p.value[1]].label)}<br>${html(data.outputs[o])}: ${short(p.value[2])} (${p.value[3]} cases)` },
    xAxis: { ...axisStyle(), type: "category", name: names[a], nameGap: 30, data: across.map((l) => l.label) },
    yAxis: { ...axisStyle(), type: "category", name: names[b], nameGap: left - 26, axisLabel: { color: colour("soft"), width: beside + 10, overflow: "truncate" }, data: up.map((l) => l.label) },
    visualMap: {
      min: Math.min(...values), max: Math.max(...values), calculable: true, dimension: 2, formatter: short,
      ...(narrow ? { orient: "horizontal", left: "center", bottom: 0, itemHeight: 120 } : { right: 4, top: "middle" }),
      textStyle: { color: colour("soft") }, inRange: { color: ["#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"] },
    },
    series: [{ type: "heatmap", data: cells, label: { show: numbered, formatter: (p) => short(p.value[2]) } }],
  });
}

function drawRank(o) {
  const s = data.sensitivity, all = s.outputs[data.outputs[o]], list = all.some((e) => e.values[0] !== null) ? all : [];
  const whole = `${s.used[data.outputs[o]]} of ${s.samples} samples are whole.`;
  byId("method").textContent = `${list.length ? s.method + "." : "No ranking can be had: cases are missing, or the output does not vary."} ${whole}`;
  const cells = (tag, values) => values.map((v) => { const e = document.createElement(tag); e.textContent = v; return e; });
  const line = (tag, values) => { const tr = document.createElement("tr"); tr.append(...cells(tag, values)); return tr; };
  byId("indices").replaceChildren(...(list.length ? [line("th", ["axis", ...s.measures]), ...list.map((e) => line("td", [e.axis, ...e.values.map(short)]))] : []));
  byId("rank").hidden = !list.length;
  if (!list.length) return;
  // Names have at most two fifths of the width, in several lines where they are longer; the axis has room for its labels.
  const bars = list.slice().reverse(), width = byId("rank").clientWidth;
  const labels = bars.map((e) => inLines(e.axis, 0.4 * width)), most = Math.max(1, ...labels.map((l) => l.split("\n").length));
  chart("rank", {
    grid: { left: 8, right: 40, top: 6, bottom: 4, containLabel: true },
    tooltip: { ...tip(), formatter: (p) => `${html(bars[p.dataIndex].axis)}: ${short(p.value)}` },
    xAxis: { ...axisStyle(), type: "value", min: 0, splitNumber: Math.max(1, Math.min(5, Math.floor(width / 120))) },
    yAxis: { ...axisStyle(), type: "category", data: labels, axisLabel: { color: colour("soft"), interval: 0, lineHeight } },
    series: [{ type: "bar", data: bars.map((e) => Math.max(e.values[0] ?? 0, 0)), itemStyle: { color: colour("accent") }, barMaxWidth: 26 }],
  }, 60 + Math.max(34, lineHeight * most + 6) * list.length);
}

function fill(id, labels, chosen) {
  byId(id).replaceChildren(...labels.map((label) => { const o = document.createElement("option"); o.textContent = o.value = label; return o; }));
  byId(id).value = labels.includes(chosen) ? chosen : labels[0];
}

const output = () => data.outputs.indexOf(byId("output").value), axisOf = (id) => names.indexOf(byId(id).value);

// What fits itself to the width of the page.
function drawFitted() {
  byId("map").closest("section").hidden = names.length < 2;
  if (names.length > 1) drawMap(output(), axisOf("mapx"), axisOf("mapy"));
  drawRank(output());
}

function draw() {
  drawCurve(output(), axisOf("x"), byId("by").value === all ? null : axisOf("by"));
  drawFitted();
  document.body.dataset.drawn = byId("output").value;
}

// What is shown stands in the address, so that a view can be passed on: #output=..&x=..&by=..
const chosen = new URLSearchParams(location.hash.slice(1));
fill("output", data.outputs, chosen.get("output"));
fill("x", names, chosen.get("x"));
fill("by", [all, ...names], chosen.get("by") ?? (names.length > 1 ? names[1] : all));
fill("mapx", names, chosen.get("mapx"));
fill("mapy", names, chosen.get("mapy") ?? names[1]);
for (const id of ["output", "x", "by", "mapx", "mapy"]) {
  byId(id).addEventListener("change", () => {
    history.replaceState(null, "", "#" + new URLSearchParams(["output", "x", "by", "mapx", "mapy"].map((i) => [i, byId(i).value])));
    draw();
  });
}
draw();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
addEventListener("resize", () => {
  charts.curve.resize(); // drawn anew, it would forget what part of it is looked at
  if (rowsOfLegend(legend.names, byId("curve").clientWidth) !== legend.rows) draw();
  else drawFitted();
});
// On paper, 680 pixels wide, nobody can open anything.
let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  for (const one of opened) one.open = true;
  for (const chart of Object.values(charts)) chart?.resize({ width: 680 });
});
addEventListener("afterprint", () => {
  for (const one of opened.splice(0)) one.open = false;
  for (const chart of Object.values(charts)) chart?.resize({ width: "auto" });
});
