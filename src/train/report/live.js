// The live page: asks for the run's state every second and draws what is new. parts.js goes before it.
const polls = 1000, turnPerSecond = 24;  // milliseconds; degrees
const shown = {curves: '', picture: null, mesh: null};
let state = null, viewer = null, follows = true, turns = true, lost = false;

const get = async (path) => {
  const answer = await fetch(path, {cache: 'no-store'});
  if (!answer.ok) throw new Error(answer.statusText);
  return answer.json();
};

// ---- Meshes.

function startMeshes() {
  const views = ['mesh', 'truth'].map((id) => MeshView.on(byId(id), id === 'mesh' ? 'prediction' : 'truth'));
  if (views.includes(null)) {
    byId('viewer-fallback').hidden = false;
    byId('viewer-hint').hidden = true;
    return;
  }
  viewer = new Viewer(views, {fov_y: 40, azimuth: 60, elevation: 20, distance: 1.75}, byId('live-stage'));
  for (const view of views) {
    for (const kind of ['pointerdown', 'keydown']) view.canvas.addEventListener(kind, () => { turns = false; });
    view.canvas.addEventListener('dblclick', () => { turns = true; });
  }
  let before = null;
  const still = matchMedia('(prefers-reduced-motion: reduce)');
  const turn = (now) => {
    if (turns && !still.matches && before !== null && !document.hidden) viewer.turn((now - before) / 1000 * turnPerSecond, 0);
    before = now;
    requestAnimationFrame(turn);
  };
  requestAnimationFrame(turn);
}

async function showMesh(step) {
  if (!viewer || step === null || shown.mesh === step) return;
  shown.mesh = step;
  const {mesh, truth} = await get(`mesh?step=${step}`);
  viewer.views[0].show(mesh);
  viewer.views[1].show(truth);
  byId('mesh-figure').hidden = !mesh;
  byId('truth-figure').hidden = !truth;
  byId('mesh-caption').textContent = `mesh after ${step.toLocaleString('en')} steps` + (mesh ? `, ${(mesh.face_count).toLocaleString('en')} faces` : '');
  viewer.redraw();
}

// ---- Pictures, and the slider over all of them.

const newest = (steps, limit) => steps.reduce((best, step) => step <= limit ? step : best, steps.length ? steps[0] : null);

function showPicture(step) {
  if (step === null || shown.picture === step) return;
  shown.picture = step;
  byId('live-picture').src = `picture?step=${step}`;
  byId('picture-caption').textContent = byId('live-picture').alt = `after ${step.toLocaleString('en')} steps`;
  byId('picture-figure').hidden = false;
}

function showTime() {
  const times = [...new Set([...state.pictures, ...state.meshes])].sort((a, b) => a - b), slider = byId('time');
  slider.hidden = times.length < 2;
  slider.max = times.length - 1;
  if (follows) slider.value = times.length - 1;
  const at = times[slider.value] ?? Infinity;
  showPicture(newest(state.pictures, at));
  showMesh(newest(state.meshes, at)).catch(() => { shown.mesh = null; });
}

// ---- Curves and words.

let charts = [];

function showCurves() {
  const {step} = state.curves, key = String(step[step.length - 1]) + ':' + step.length;
  if (key === shown.curves || step.length === 0) return;
  shown.curves = key;
  const moved = (index) => charts.forEach((chart) => chart.point(index));
  const told = state.charts.filter(({key: name}) => state.curves[name].some((value) => value));
  charts = told.map(({key: name, title}) => new Chart({title, values: state.curves[name]}, step, moved));
  byId('curves').replaceChildren(...charts.map((chart) => chart.element));
  charts.forEach((chart) => chart.draw());
}

function showWords() {
  document.title = `${state.name} – tilegrad live`;
  byId('name').textContent = state.name;
  const {step, steps} = state, of = steps ? ` of ${steps.toLocaleString('en')}` : '';
  const what = lost ? 'The program has ended; this is the last it said.' : state.running ? 'Running.' : step === steps && steps ? 'Finished.' : 'Not running.';
  byId('status').textContent = `${what} Step ${step.toLocaleString('en')}${of}.`;
  byId('bar').hidden = !steps;
  if (steps) {
    byId('bar').firstElementChild.style.width = `${100 * step / steps}%`;
    byId('bar').setAttribute('aria-valuenow', Math.round(100 * step / steps));
  }
}

async function poll() {
  try {
    state = await get('state');
    lost = false;
  } catch { lost = true; }
  if (state) {
    showWords();
    showTime();
    showCurves();
  } else byId('status').textContent = 'The program does not answer.';
  setTimeout(poll, polls);
}

byId('time').addEventListener('input', (event) => {
  follows = Number(event.target.value) === Number(event.target.max);
  showTime();
});
new ResizeObserver(() => requestAnimationFrame(() => charts.forEach((chart) => chart.draw()))).observe(byId('curves'));
startMeshes();
poll();
