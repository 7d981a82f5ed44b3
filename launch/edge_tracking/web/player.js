'use strict';
function play(root, it) {
  const canvases = root.querySelectorAll('canvas'), said = root.querySelector('p');
  const [image, way] = it.rows ? canvases : [null, ...canvases];
  const [button, slider] = root.querySelectorAll('button, input');
  const time = decoded(it.time, Float32Array), path = decoded(it.path, Float32Array);
  const force = decoded(it.force, Float32Array), stage = decoded(it.stage, Int32Array);
  const contact = decoded(it.contact, Float32Array), levels = decoded(it.levels, Uint8Array);
  const tactels = it.rows * it.columns, last = time.length - 1;
  const ways = [{points: path, colour: WAY},
    {points: decoded(it.touched, Float32Array), colour: '#d4691e', dots: true}];
  let now = 0, began = null;
  function draw() {
    const [x, y, yaw] = contact.subarray(3 * now, 3 * now + 3);
    if (tactels) {
      drawImage(image, it, levels.subarray(tactels * now, tactels * (now + 1)),
        Number.isFinite(x) ? {x, y, yaw} : null);
    }
    if (way) drawWay(way, ways, view, now);
    const [state, reason] = it.stages[stage[now]] || ['', ''];
    said.textContent = [`${time[now].toFixed(2)} s`,
      Number.isFinite(force[now])
        ? `${(it.force_scale * force[now]).toPrecision(3)} ${it.unit}` : '',
      state, reason].filter(Boolean).join(' \u00b7 ');
    slider.value = now;
  }
  function step(stamp) {
    if (began === null) return;
    while (now < last && time[now] < began.time + (stamp - began.stamp) / 1e3) now++;
    draw();
    if (now < last) requestAnimationFrame(step); else stop();
  }
  function stop() {
    began = null;
    button.textContent = 'play';
  }
  const view = way && turnable(way, draw);
  slider.max = last;
  slider.addEventListener('input', () => { now = +slider.value; stop(); draw(); });
  button.addEventListener('click', () => {
    if (began) return stop();
    if (now === last) now = 0;
    began = {time: time[now], stamp: performance.now()};
    button.textContent = 'stop';
    requestAnimationFrame(step);
  });
  window.addEventListener('resize', draw);
  now = it.first;
  draw();
}
document.querySelectorAll('.player').forEach(root => play(root, JSON.parse(root.dataset.run)));
