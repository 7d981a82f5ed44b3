'use strict';
// Lines over axes: a chart is what report/charts.py makes of it.
function ticks(low, high, most) {
  let step = 10 ** Math.ceil(Math.log10((high - low) / most));
  const part = [5, 2].find(it => (high - low) * it / step <= most);
  if (part) step /= part;
  const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), found = [];
  for (let k = Math.ceil(low / step - 1e-6); k * step <= high + 1e-6 * step; k++) {
    found.push([k * step, (k * step + 0).toFixed(digits)]);
  }
  return found;
}

function bounds(series, axis) {
  let low = Infinity, high = -Infinity;
  for (const {[axis]: values} of series) {
    for (const v of values) {
      if (v < low) low = v;
      if (v > high) high = v;
    }
  }
  if (low > high) return [0, 1];
  const beyond = 0.04 * (high - low) || Math.abs(low) || 1;
  return [low - beyond, high + beyond];
}

function drawChart(canvas, it) {
  const {context, width, height} = cleared(canvas);
  const left = 56 - width / 2, right = width / 2 - 14, low = 38 - height / 2, top = height / 2 - 44;
  let [x0, x1] = it.domain || bounds(it.series, 'x'), [y0, y1] = it.range || bounds(it.series, 'y');
  if (it.equal) {  // the middle stays, the axis that has room shows more
    const pixel = Math.max((x1 - x0) / (right - left), (y1 - y0) / (top - low));
    const [wide, high] = [pixel * (right - left) / 2, pixel * (top - low) / 2];
    [x0, x1] = [(x0 + x1) / 2 - wide, (x0 + x1) / 2 + wide];
    [y0, y1] = [(y0 + y1) / 2 - high, (y0 + y1) / 2 + high];
  }
  const px = x => left + (x - x0) / (x1 - x0) * (right - left);
  const py = y => low + (y - y0) / (y1 - y0) * (top - low);
  const stroke = (colour, size, dash, ...points) => {
    context.beginPath();
    [context.strokeStyle, context.lineWidth] = [colour, size];
    context.setLineDash(dash);
    points.forEach(([x, y], k) => context[k ? 'lineTo' : 'moveTo'](x, y));
    context.stroke();
  };
  const text = (said, x, y, colour, align = 'left', font = '12px') => {
    [context.fillStyle, context.textAlign] = [colour, align];
    context.font = `${font} system-ui, sans-serif`;
    write(context, said, x, y);
  };
  for (const [x, said] of ticks(x0, x1, Math.max(width / 90, 2))) {
    stroke('#e6e8ec', 1, [], [px(x), low], [px(x), top]);
    text(said, px(x), low - 15, '#4b5058', 'center');
  }
  for (const [y, said] of ticks(y0, y1, Math.max(height / 50, 2))) {
    stroke('#e6e8ec', 1, [], [left, py(y)], [right, py(y)]);
    text(said, left - 5, py(y) - 4, '#4b5058', 'right');
  }
  text(it.title, left - 48, top + 26, '#22262b', 'left', '600 13px');
  text(it.ylabel, left - 48, top + 8, '#4b5058');
  text(it.xlabel, right, low - 31, '#4b5058', 'right');
  context.font = '12px system-ui, sans-serif';
  let place = left - 40 + context.measureText(it.ylabel).width;
  for (const {name, colour} of it.series) {
    if (!name) continue;
    text(`\u25ac ${name}`, place, top + 8, colour);
    place += context.measureText(`\u25ac ${name}`).width + 8;
  }
  context.save();
  context.beginPath();
  context.rect(left, low, right - left, top - low);
  context.clip();
  context.globalCompositeOperation = 'multiply';
  for (const [begin, end, colour] of it.bands || []) {
    context.fillStyle = colour;
    context.fillRect(px(begin), low, Math.max(px(end) - px(begin), 0.5), top - low);
  }
  context.globalCompositeOperation = 'source-over';
  for (const series of it.series) drawSeries(context, series, px, py);
  (it.marks || []).forEach(([across, at, name, colour], k) => {
    const ends = across ? [[px(at), low], [px(at), top]] : [[left, py(at)], [right, py(at)]];
    stroke(colour, 1.2, [5, 4], ...ends);
    if (across) text(name, px(at) + 4, top - 14 - 14 * k, colour);
    else text(name, right - 4, py(at) + 4, colour, 'right');
  });
  context.restore();
}

function drawSeries(context, {x, y, colour, dots, width}, px, py) {
  context.beginPath();
  context.setLineDash([]);
  [context.strokeStyle, context.fillStyle, context.lineWidth] = [colour, colour, width || 1.1];
  let joined = false;
  for (let k = 0; k < x.length; k++) {
    const known = Number.isFinite(y[k]);
    if (known && dots) context.fillRect(px(x[k]) - 1.5, py(y[k]) - 1.5, 3, 3);
    else if (known) context[joined ? 'lineTo' : 'moveTo'](px(x[k]), py(y[k]));
    joined = known;
  }
  context.stroke();
}

function show(canvas, it) {
  for (const series of it.series) {
    for (const axis of ['x', 'y']) series[axis] = decoded(series[axis], Float32Array);
  }
  window.addEventListener('resize', () => drawChart(canvas, it));
  drawChart(canvas, it);
}
document.querySelectorAll('canvas.chart').forEach(
  canvas => show(canvas, JSON.parse(canvas.dataset.chart)));
