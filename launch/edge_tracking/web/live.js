'use strict';
const find = name => document.getElementById(name), WAY_POINTS = 3000, PERIOD = 33;  // ms
let newest = null, drawn = null, heard = 0, path = [];
const again = () => { drawn = null; };
const view = turnable(find('way'), again);
window.addEventListener('resize', again);

function say(name, text) { find(name).textContent = text; }

function number(value, factor, digits, unit) {
  if (!Number.isFinite(value)) return '';
  const rounded = +(factor * value).toFixed(digits) || 0;  // no -0
  return `${rounded.toFixed(digits)} ${unit}`;
}

function draw() {
  requestAnimationFrame(draw);
  const age = (performance.now() - heard) / 1e3;
  say('age', !newest ? 'waiting for a sensor' : age < 1 ? 'live'
    : `nothing new for ${age.toFixed(0)} s`);
  if (!newest || newest === drawn) return;
  drawn = newest;
  const {image, contact, status} = newest;
  if (image) {
    drawImage(find('image'), image, decoded(image.levels, Uint8Array), contact && contact.place);
    say('sensor', `${image.sensor}: ${image.rows} \u00d7 ${image.columns}, `
      + `${image.rate.toFixed(0)} Hz, darkest ${image.top.toPrecision(3)} ${image.unit}`
      + (image.tared ? '' : ', not tared'));
  }
  say('contact', contact ? [contact.type, contact.reasons,
    ...['x', 'y'].map(axis => contact.place
      && `${axis} ${number(contact.place[axis], 1e3, 2, 'mm')}`),
    contact.place && number(contact.place.yaw, 180 / Math.PI, 1, '\u00b0'),
    number(contact.force, 1, 2, 'N')].filter(Boolean).join(' \u00b7 ') : '');
  say('servo', status ? [status.state, status.reason, number(status.speed, 1e3, 1, 'mm/s'),
    `${number(status.progress, 1e3, 1, 'mm')} so far`].filter(Boolean).join(' \u00b7 ')
    : 'no servo');
  if (path.length) {
    drawWay(find('way'), [{points: path, colour: WAY}], view, path.length / 3 - 1);
  }
}

async function ask() {
  let pause = PERIOD;
  try {
    const text = await (await fetch('newest' + location.search)).text();
    const answer = JSON.parse(text, (_, value) => value === null ? NaN : value);
    if (answer && (!newest || answer.stamp !== newest.stamp)) {
      newest = answer;
      heard = performance.now();
      if (newest.position) path = path.concat(newest.position).slice(-3 * WAY_POINTS);
    }
  } catch (error) {
    pause = 1e3;  // the view has ended; it may start again
  }
  setTimeout(ask, pause);
}
ask();
requestAnimationFrame(draw);
