(() => {
  const slider = document.getElementById('frame');
  const play = document.getElementById('play');
  const frames = slider.dataset.frames.split(' ');
  const moving = [...document.querySelectorAll('[data-at]')].map(e => [e, e.dataset.at.split(';')]);
  const images = [...document.querySelectorAll('.stack img')];
  const show = () => {
    const k = +slider.value;
    images.forEach(i => i.classList.toggle('on', +i.dataset.k === k));
    moving.forEach(([e, at]) => e.setAttribute('transform', at[k]));
    document.getElementById('number').textContent = 'frame ' + frames[k];
  };
  let timer;
  const stop = () => { clearInterval(timer); timer = undefined; play.textContent = '▶'; };
  play.addEventListener('click', () => {
    if (timer) return stop();
    play.textContent = '❚❚';
    timer = setInterval(() => { slider.value = (+slider.value + 1) % frames.length; show(); }, 250);
  });
  slider.addEventListener('input', () => { stop(); show(); });
  show();
})();
