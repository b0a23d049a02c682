"use strict";
// Draws the charts of a report from the data in the page. uPlot and scatter.js come before this script.
const data = JSON.parse(document.getElementById("data").textContent);
const variable = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const parts = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16));
const luminance = (rgb) => rgb.map((v) => (v /= 255) <= 0.04045 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4).reduce((sum, v, i) => sum + v * [0.2126, 0.7152, 0.0722][i], 0);

// A tissue's colour ("#rrggbb") as a line on this page: darker or lighter until it stands out from the card (3:1, WCAG 2.2).
function readable(hex) {
  const card = variable("card"), paper = luminance(parts(card.length === 4 ? "#" + [...card.slice(1)].map((c) => c + c).join("") : card));
  for (let rgb = parts(hex), step = 0; ; ++step) {
    const own = luminance(rgb), contrast = (Math.max(own, paper) + 0.05) / (Math.min(own, paper) + 0.05);
    if (contrast >= 3 || step > 20) return `#${rgb.map((v) => Math.round(v).toString(16).padStart(2, "0")).join("")}`;
    rgb = rgb.map((v) => (paper > 0.5 ? 0.9 * v : v + 0.1 * (255 - v)));
  }
}
const colour = (name) => (name[0] === "#" ? readable(name) : variable(name));
const charts = [];

const eventColours = { "warning": "c6", "vital touch": "c4", "fire": "c0", "puncture": "c7", "fault": "c4" };

// Text with a rim in the colour of the card, so that lines below it do not disturb.
function write(ctx, text, x, y) {
  ctx.lineJoin = "round";
  ctx.lineWidth = 4 * devicePixelRatio;
  ctx.setLineDash([]);
  ctx.strokeStyle = colour("card");
  ctx.strokeText(text, x, y);
  ctx.fillStyle = colour("soft");
  ctx.fillText(text, x, y);
}

function horizontal(u, lines) {
  const { ctx, bbox } = u;
  for (const line of lines) {
    const y = u.valToPos(line.at, "y", true);
    if (y < bbox.top || y > bbox.top + bbox.height) continue;
    ctx.save();
    ctx.strokeStyle = colour(line.colour);
    ctx.setLineDash([6 * devicePixelRatio, 5 * devicePixelRatio]);
    ctx.lineWidth = devicePixelRatio;
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.restore();
  }
}

// What the horizontal lines are, below the legend: names in the chart would lie on its curves.
function nameLines(place, chart) {
  if (!(chart.lines || []).length) return;
  const names = document.createElement("div");
  names.className = "lines";
  for (const line of chart.lines) {
    const name = document.createElement("span");
    name.textContent = line.words ?? `${line.label}, ${+line.at.toFixed(2)} ${chart.y.unit || ""}`.trim();
    name.style.setProperty("--of", colour(line.colour));
    names.append(name);
  }
  place.append(names);
}

// All lines first: a later one would go through the words of an earlier one.
function vertical(u, events) {
  const { ctx, bbox } = u;
  const shown = events.map((event) => ({ ...event, x: u.valToPos(event.seconds, "x", true) }))
    .filter(({ kind, x }) => kind in eventColours && x >= bbox.left && x <= bbox.left + bbox.width);
  ctx.save();
  ctx.lineWidth = devicePixelRatio;
  for (const event of shown) {
    ctx.strokeStyle = colour(eventColours[event.kind]);
    ctx.beginPath();
    ctx.moveTo(event.x, bbox.top);
    ctx.lineTo(event.x, bbox.top + bbox.height);
    ctx.stroke();
  }
  nameEvents(ctx, bbox, shown);
  ctx.restore();
}

// In three rows; a name that has no room in any of them is left out.
function nameEvents(ctx, bbox, events) {
  const gap = 4 * devicePixelRatio;
  const free = [-Infinity, -Infinity, -Infinity];
  ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
  ctx.textAlign = "left";
  ctx.textBaseline = "top";
  for (const { label, x } of events) {
    const width = ctx.measureText(label).width;
    const left = x + width + gap > bbox.left + bbox.width ? x - width - gap : x + gap;
    const row = free.findIndex((end) => end < left);
    if (row >= 0) {
      write(ctx, label, left, bbox.top + (2 + 14 * row) * devicePixelRatio);
      free[row] = left + width + 1.5 * gap;
    }
  }
}

const axis = (label, size) => ({
  label, labelSize: 18, size, gap: 4, stroke: () => colour("soft"), labelFont: "12px system-ui, sans-serif",
  font: "12px system-ui, sans-serif", grid: { stroke: () => colour("grid"), width: 1 }, ticks: { stroke: () => colour("line"), width: 1, size: 5 },
});

function draw(id, chart) {
  const place = document.getElementById(id);
  if (!place) return;
  if (chart.scatter) {
    const plot = scatter(place, chart, axis);
    charts.push({ plot, place, height: plot.height });
    nameLines(place, chart);
    return;
  }
  if (chart.columns[0].length < (chart.points ? 1 : 2)) {
    place.className = "note";
    place.textContent = "The record is too short to draw.";
    return;
  }
  const value = (unit) => (u, v) => (v == null ? "–" : v.toFixed(2) + " " + unit);
  const limits = (chart.lines || []).map((line) => line.at);
  const options = {
    width: Math.max(place.clientWidth, 240),
    height: chart.height || (innerWidth < 640 ? 230 : 300),
    scales: {
      x: { time: false },
      y: { range: (u, low, high) => {
        const bottom = Math.min(low ?? 0, 0), top = Math.max(high ?? 1, ...limits);
        const room = 0.08 * (top - bottom || 1);
        return [bottom < 0 ? bottom - room : 0, top + (chart.events ? 3 : 1) * room];
      } },
    },
    axes: [{ ...axis(chart.x.label, 40), ...(chart.points ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500] } : {}) }, axis(chart.y.label, 46)],
    cursor: { points: { size: 7 }, sync: chart.sync ? { key: chart.sync } : undefined },
    legend: { markers: { fill: (u, i) => u.series[i].stroke(u, i), width: 0 } },
    series: [{ label: chart.x.name, value: value(chart.x.unit) }].concat(chart.series.map((s) => ({
      label: s.label, stroke: () => colour(s.colour), width: s.width || 1.6, dash: s.dash, show: s.show !== false,
      fill: s.fill ? () => colour(s.colour) + "26" : undefined, value: value(chart.y.unit), points: chart.points ? { show: true, size: 6, fill: () => colour("card") } : { show: false }, spanGaps: s.gaps === false,
    }))),
    hooks: { draw: [(u) => { horizontal(u, chart.lines || []); vertical(u, chart.events ? data.events : []); }] },
  };
  const plot = new uPlot(options, chart.columns, place);
  charts.push({ plot, place, height: plot.height });
  nameLines(place, chart);
}

function drawAll() {
  for (const { plot, place } of charts.splice(0)) {
    plot.destroy();
    place.querySelector(".lines")?.remove();
  }
  for (const id of Object.keys(data.charts)) draw(id, data.charts[id]);
}

drawAll();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", drawAll);
const fitWindow = () => {
  for (const { plot, place, height } of charts) plot.setSize({ width: Math.max(place.clientWidth, 240), height });
};
let resized = 0;
addEventListener("resize", () => {
  cancelAnimationFrame(resized);
  resized = requestAnimationFrame(fitWindow);
});

// A page of paper is narrower than most windows, always light, and nobody can open anything on it.
const paper = 680, halfPaper = 330, lowOnPaper = 165;
let opened = [];
addEventListener("beforeprint", () => {
  document.documentElement.classList.add("printing");
  opened = [...document.querySelectorAll("details:not([open])")];
  for (const one of opened) one.open = true;
  for (const { plot, place, height } of charts) {
    const half = place.closest(".charts");
    plot.setSize({ width: half ? halfPaper : paper, height: half ? lowOnPaper : height });
  }
});
addEventListener("afterprint", () => {
  document.documentElement.classList.remove("printing");
  for (const one of opened.splice(0)) one.open = false;
  fitWindow();
});
