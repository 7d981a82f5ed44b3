'use strict';
// Drawing that the report and the live view share. All text from outside goes to textContent.
const shades = JSON.parse(document.body.dataset.colours);
const ESTIMATE = '#10a4b8', WAY = '#1f5fa8', INVALID = 255;
const colours = Array.from({length: 255}, (_, level) => {
  const place = level / 254 * (shades.length - 1);
  const low = Math.min(Math.floor(place), shades.length - 2);
  return shades[low].map((c, k) => c + (place - low) * (shades[low + 1][k] - c));
}).concat([[223, 226, 231]]);

function decoded(text, Kind) {
  return new Kind(Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer);
}

// A canvas as sharp as the screen, empty; its context has the origin in the middle, y upwards.
function cleared(canvas) {
  const sharp = window.devicePixelRatio || 1, context = canvas.getContext('2d');
  const width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = width * sharp;
  canvas.height = height * sharp;
  context.setTransform(sharp, 0, 0, -sharp, canvas.width / 2, canvas.height / 2);
  return {context, width, height};
}

// levels: 0 to 254 of the colours, row-major from the lowest row on; contact in metres.
function drawImage(canvas, array, levels, contact) {
  const {context, width, height} = cleared(canvas);
  const x = array.columns * array.pitch[0], y = array.rows * array.pitch[1];
  const scale = Math.min(width / x, height / y);
  const small = new OffscreenCanvas(array.columns, array.rows), inner = small.getContext('2d');
  const picture = inner.createImageData(array.columns, array.rows);
  levels.forEach((level, k) => picture.data.set([...colours[level], 255], 4 * k));
  inner.putImageData(picture, 0, 0);
  context.scale(scale, scale);
  context.imageSmoothingEnabled = false;
  context.drawImage(small, -x / 2, -y / 2, x, y);
  context.beginPath();
  context.rect(-x / 2, -y / 2, x, y);
  context.clip();
  context.lineWidth = 2.5 / scale;
  context.strokeStyle = ESTIMATE;
  if (contact) drawContact(context, contact, 7 / scale, Math.hypot(x, y));
}

// A line where it has a direction, else a cross; the ellipse of 95 % where it has a covariance.
function drawContact(context, it, size, reach) {
  context.beginPath();
  if (Number.isFinite(it.yaw)) {
    const [c, s] = [Math.cos(it.yaw), Math.sin(it.yaw)], off = it.x * c + it.y * s;
    const end = (given, other) => Number.isFinite(given) ? given : other;
    for (const along of [end(it.start, -reach), end(it.end, reach)]) {
      context.lineTo(off * c - along * s, off * s + along * c);
    }
  } else {
    context.moveTo(it.x - size, it.y); context.lineTo(it.x + size, it.y);
    context.moveTo(it.x, it.y - size); context.lineTo(it.x, it.y + size);
  }
  context.stroke();
  if (!it.covariance || !it.covariance.every(Number.isFinite)) return;
  const [a, b, d] = it.covariance, mean = (a + d) / 2, spread = Math.hypot((a - d) / 2, b);
  const half = sign => Math.sqrt(5.99 * Math.max(mean + sign * spread, 0));
  context.beginPath();
  context.ellipse(it.x, it.y, half(1), half(-1), Math.atan2(2 * b, a - d) / 2, 0, 2 * Math.PI);
  context.stroke();
}

// points: x, y, z one after the other [m]; turned by view.turn, then tilted by view.tilt.
function drawWay(canvas, ways, view, here) {
  const {context, width, height} = cleared(canvas), all = ways.map(way => way.points);
  const low = [0, 1, 2].map(() => Infinity), high = low.map(() => -Infinity);
  for (const points of all) {
    points.forEach((v, k) => {
      if (v < low[k % 3]) low[k % 3] = v;
      if (v > high[k % 3]) high[k % 3] = v;
    });
  }
  const size = Math.max(Math.hypot(...high.map((v, k) => v - low[k])), 1e-3);
  const scale = 0.9 * Math.min(width, height) / size;
  const middle = low.map((v, k) => (v + high[k]) / 2);
  const [ct, st, cu, su] = [view.turn, view.tilt].flatMap(v => [Math.cos(v), Math.sin(v)]);
  const place = (x, y, z) => [scale * (ct * x - st * y),
    scale * (su * (st * x + ct * y) + cu * z)];
  const at = (points, k) => place(...middle.map((m, axis) => points[3 * k + axis] - m));
  for (const {points, colour, dots} of ways) {
    context.beginPath();
    context.strokeStyle = context.fillStyle = colour;
    let joined = false;
    for (let k = 0; k < points.length / 3; k++) {
      const [x, y] = at(points, k), known = Number.isFinite(x + y);
      if (known && dots) context.fillRect(x - 1, y - 1, 2, 2);
      else if (known) context[joined ? 'lineTo' : 'moveTo'](x, y);
      joined = known;
    }
    context.stroke();
  }
  context.beginPath();
  context.fillStyle = ESTIMATE;
  context.arc(...at(all[0], here), 5, 0, 2 * Math.PI);
  context.fill();
  drawAxes(context, place, scale, [14 - width / 2, 14 - height / 2]);
}

function drawAxes(context, place, scale, [left, low]) {
  const length = 10 ** Math.floor(Math.log10(90 / scale));  // m
  context.font = '12px system-ui, sans-serif';
  context.strokeStyle = context.fillStyle = '#555a61';
  const corner = [left + 25, low + 25];
  ['x', 'y', 'z'].forEach((name, axis) => {
    const tip = place(...[0, 1, 2].map(k => k === axis ? length : 0));
    context.beginPath();
    context.moveTo(...corner);
    context.lineTo(corner[0] + tip[0], corner[1] + tip[1]);
    context.stroke();
    write(context, name, corner[0] + 1.25 * tip[0], corner[1] + 1.25 * tip[1]);
  });
  write(context, `axes: ${+(1e3 * length).toPrecision(1)} mm`, left, low - 8);
}

function write(context, text, x, y) {
  context.save();
  context.translate(x, y);
  context.scale(1, -1);
  context.fillText(text, 0, 0);
  context.restore();
}

// Lets a pointer turn a view; calls `draw` when it did.
function turnable(canvas, draw) {
  const view = {turn: -0.6, tilt: 0.6};
  canvas.addEventListener('pointermove', event => {
    if (!event.buttons) return;
    view.turn += event.movementX / 100;
    view.tilt = Math.max(0, Math.min(Math.PI / 2, view.tilt + event.movementY / 100));
    draw();
  });
  return view;
}
