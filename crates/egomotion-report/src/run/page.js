// Shows the pictures and marks of the slider's frame, and names the values under the pointer.
(() => {
  const all = selector => [...document.querySelectorAll(selector)];
  const data = JSON.parse(document.getElementById('data').textContent);
  const slider = document.getElementById('frame');
  const play = document.getElementById('play');
  const layers = all('[data-k]');
  const cursors = all('[data-x]').map(e => [e, e.dataset.x.split(' ')]);
  const cameras = all('[data-pose]').map(e => [e, e.dataset.pose.split(';').map(p => p.split(' '))]);
  const last = data.stop.length - 1;
  let shown = 0;

  const show = k => {
    shown = Math.max(0, Math.min(last, k));
    layers.forEach(e => e.classList.toggle('on', +e.dataset.k === shown));
    cursors.forEach(([e, x]) => e.setAttribute('transform', `translate(${x[shown]} 0)`));
    cameras.forEach(([e, pose]) => {
      const [x, y, angle] = pose[shown];
      e.setAttribute('transform', `translate(${x} ${y}) rotate(${angle})`);
    });
    if (!slider) return;
    slider.value = shown;
    const says = document.querySelector('.player output .on');
    slider.setAttribute('aria-valuetext', says ? says.textContent : '');
  };

  let timer;
  const stop = () => {
    clearInterval(timer);
    timer = undefined;
    play.textContent = '▶';
    play.setAttribute('aria-label', 'Play');
  };
  if (slider) {
    slider.addEventListener('input', () => { stop(); show(+slider.value); });
    play.addEventListener('click', () => {
      if (timer) return stop();
      play.textContent = '❚❚';
      play.setAttribute('aria-label', 'Pause');
      timer = setInterval(() => show(shown === last ? 0 : shown + 1), 200);
    });
    document.addEventListener('keydown', event => {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      const plain = !(event.altKey || event.ctrlKey || event.metaKey || event.shiftKey);
      if (!step || !plain || event.target.closest('input, pre, .scroll')) return;
      event.preventDefault();
      stop();
      show(shown + step);
    });
  }

  // The index of the value nearest to `t` in an increasing list.
  const nearest = (list, t) => {
    let low = 0, high = list.length - 1;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (list[middle] < t) low = middle; else high = middle;
    }
    return high >= 0 && Math.abs(list[high] - t) < Math.abs(list[low] - t) ? high : low;
  };

  const number = v => v === null || v === undefined ? '–' : String(+v.toPrecision(4)).replace('-', '−');
  const says = (series, i) => {
    const unit = series.unit ? ' ' + series.unit : '';
    if (series.value[i] === null) return 'no value';
    const high = series.high[i] === null ? '∞' : number(series.high[i]);
    const truth = series.truth[i] === null || series.truth[i] === undefined ? '' : `, truth ${number(series.truth[i])}`;
    return `${number(series.value[i])}${unit} (${number(series.low[i])} … ${high})${truth}`;
  };

  const tip = document.createElement('div');
  tip.className = 'tip';
  tip.hidden = true;
  tip.setAttribute('aria-hidden', 'true');
  document.body.append(tip);
  all('svg[data-series]').forEach(svg => {
    const series = data.series[svg.dataset.series];
    const [left, width] = svg.dataset.inside.split(' ').map(Number);
    const [from, to] = svg.dataset.range.split(' ').map(Number);
    const time = event => {
      const box = svg.getBoundingClientRect();
      const x = (event.clientX - box.left) / box.width * svg.viewBox.baseVal.width;
      return from + (x - left) / width * (to - from);
    };
    svg.addEventListener('pointermove', event => {
      const i = nearest(data.time, time(event));
      tip.textContent = `${series.name}, frame ${data.frame[i]}: ${says(series, i)}`;
      tip.hidden = false;
      const right = document.documentElement.clientWidth - tip.offsetWidth - 8;
      tip.style.left = `${Math.max(8, Math.min(right, event.clientX + 12))}px`;
      tip.style.top = `${event.clientY > 60 ? event.clientY - 44 : event.clientY + 24}px`;
    });
    svg.addEventListener('pointerleave', () => { tip.hidden = true; });
    svg.addEventListener('click', event => {
      if (slider) stop();
      show(nearest(data.stop, time(event)));
    });
  });
  show(0);
})();
