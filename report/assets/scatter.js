"use strict";
// Draws points and lines in any order, on plain or logarithmic axes. report.js, which comes after, starts it.

const shapes = "●■▲◆▼○□△◇▽";
const superscripts = { "-": "⁻", 0: "⁰", 1: "¹", 2: "²", 3: "³", 4: "⁴", 5: "⁵", 6: "⁶", 7: "⁷", 8: "⁸", 9: "⁹" };

// At most six digits, and powers of ten where plain digits would be long.
function number(v) {
  if (v === 0) return "0";
  const size = Math.abs(v);
  if (size >= 1e-4 && size < 1e6) return String(+v.toPrecision(6));
  const [digits, power] = v.toExponential(5).split("e");
  const raised = "10" + [...String(+power)].map((c) => superscripts[c]).join("");
  return +digits === 1 ? raised : +digits + "·" + raised;
}

// Labels and grid of a logarithmic axis: 1, 2 and 5 of each decade where the range is short, powers of ten otherwise.
function logMarks(u, splits, axisIndex) {
  const { min, max } = u.scales[u.axes[axisIndex].scale];
  const decades = Math.log10(max) - Math.log10(min);
  const every = Math.floor(decades / 8) + 1;
  return splits.map((v) => {
    const power = Math.floor(Math.log10(v) + 1e-9), step = Math.round(v / 10 ** power);
    const shown = decades < 0.7 || (decades < 2.1 ? [1, 2, 5].includes(step) : step === 1 && power % every === 0);
    return shown ? v : null;
  });
}

// Corners of the unit markers; a circle has none. The hollow ones are the same.
const corners = [
  null,
  [[-0.9, -0.9], [0.9, -0.9], [0.9, 0.9], [-0.9, 0.9]],
  [[0, -1.2], [1.1, 0.8], [-1.1, 0.8]],
  [[0, -1.3], [1.1, 0], [0, 1.3], [-1.1, 0]],
  [[0, 1.2], [1.1, -0.8], [-1.1, -0.8]],
];

function marker(ctx, shape, x, y, size) {
  const polygon = corners[shape % corners.length];
  ctx.beginPath();
  if (polygon) for (const [dx, dy] of polygon) ctx.lineTo(x + dx * size, y + dy * size);
  else ctx.arc(x, y, size, 0, 2 * Math.PI);
  ctx.closePath();
  if (shape < corners.length) ctx.fill();
  ctx.stroke();
}

function drawSeries(u, index, line, markers) {
  const [xs, ys] = u.data[index];
  const { ctx, bbox } = u;
  const every = line ? Math.ceil(xs.length / 14) : 1;
  const at = xs.map((x, i) => (x == null ? null : [u.valToPos(x, "x", true), u.valToPos(ys[i], "y", true)]));
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.strokeStyle = ctx.fillStyle = u.series[index].stroke(u, index);
  ctx.lineWidth = 1.6 * devicePixelRatio;
  if (line) {
    ctx.beginPath();
    at.forEach((p, i) => p && (i > 0 && at[i - 1] ? ctx.lineTo(...p) : ctx.moveTo(...p)));
    ctx.stroke();
  }
  if (markers) at.forEach((p, i) => p && i % every === 0 && marker(ctx, (index - 1) % 10, ...p, 4 * devicePixelRatio));
  ctx.restore();
}

// The point below the pointer, or nothing when none is within 24 pixels.
function nearest(u, chart) {
  let best = null, least = 24 ** 2;
  for (let index = 1; index < u.data.length; ++index) {
    if (!u.series[index].show || !chart.series[index - 1].markers) continue;
    const [xs, ys] = u.data[index];
    for (let i = 0; i < xs.length; ++i) {
      if (xs[i] == null) continue;
      const left = u.valToPos(xs[i], "x"), top = u.valToPos(ys[i], "y");
      const distance = (left - u.cursor.left) ** 2 + (top - u.cursor.top) ** 2;
      if (distance < least) [best, least] = [{ index, left, top, x: xs[i], y: ys[i], point: i }, distance];
    }
  }
  return best;
}

function tooltip(chart) {
  const box = document.createElement("div"), ring = document.createElement("div");
  box.className = "tip";
  ring.className = "ring";
  const show = (u) => {
    const hit = u.cursor.left >= 0 ? nearest(u, chart) : null;
    box.hidden = ring.hidden = !hit;
    if (!hit) return;
    const { label, points } = chart.series[hit.index - 1];
    const lines = [points.length ? `${label}: ${points[hit.point]}` : label, `${chart.x.label}: ${number(hit.x)}`, `${chart.y.label}: ${number(hit.y)}`];
    box.textContent = lines.join("\n");
    const right = hit.left > u.over.clientWidth / 2, below = hit.top < u.over.clientHeight / 2;
    box.style.transform = `translate(${right ? "calc(-100% - 12px)" : "12px"}, ${below ? "12px" : "calc(-100% - 12px)"})`;
    for (const part of [box, ring]) {
      part.style.left = hit.left + "px";
      part.style.top = hit.top + "px";
    }
  };
  return { init: (u) => { box.hidden = ring.hidden = true; u.over.append(ring, box); }, show };
}

function scatter(place, chart, axis) {
  // What is shown: the page's ranges, or narrower ones that the reader dragged; hiding a series changes nothing.
  let view = { x: chart.x.range, y: chart.y.range };
  const show = (u, ranges) => {
    view = ranges;
    u.setData(u.data);
  };
  const enlarge = (u) => {
    const { left, top, width, height } = u.select;
    if (width <= 0 || height <= 0) return;
    const value = (scale, ...positions) => positions.map((p) => u.posToVal(p, scale));
    u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
    show(u, { x: value("x", left, left + width), y: value("y", top + height, top) });
  };
  const scale = (name) => ({ time: false, distr: chart[name].log ? 3 : 1, range: () => view[name] });
  const tip = tooltip(chart);
  const numbered = (a, size) => {
    const base = axis(a.label, size);
    const marks = a.log ? { filter: logMarks, grid: { ...base.grid, filter: logMarks } } : {};
    return { ...base, ...marks, values: (u, splits) => splits.map((v) => (v == null ? "" : number(v))) };
  };
  const options = {
    mode: 2, width: Math.max(place.clientWidth, 240), height: innerWidth < 640 ? 320 : 460,
    scales: { x: scale("x"), y: scale("y") },
    axes: [numbered(chart.x, 40), numbered(chart.y, 60)],
    cursor: {
      drag: { x: true, y: true, uni: 20, setScale: false }, points: { show: false }, dataIdx: () => null,
      bind: { dblclick: (u) => () => show(u, { x: chart.x.range, y: chart.y.range }) },
    },
    legend: { live: false },
    series: [{}].concat(chart.series.map((s, i) => ({
      label: s.label, stroke: () => colour(s.markers ? "c" + (i % 8) : "soft"),
      paths: (u, index) => { drawSeries(u, index, s.line, s.markers); return null; },
    }))),
    hooks: {
      init: [tip.init], setCursor: [tip.show], setSelect: [enlarge], draw: [(u) => horizontal(u, chart.lines)],
    },
  };
  const plot = new uPlot(options, [null].concat(chart.series.map((s) => [s.x, s.y])), place);
  [...plot.root.querySelectorAll(".u-legend .u-marker")].slice(-chart.series.length).forEach((mark, i) => {
    const { markers } = chart.series[i];
    mark.textContent = markers ? shapes[i % shapes.length] : "—";
    mark.style.cssText = `border: 0; background: none; color: ${colour(markers ? "c" + (i % 8) : "soft")}; line-height: 10px; width: 14px`;
  });
  return plot;
}
