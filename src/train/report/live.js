// The live page: loads the scripts beside it again every second and draws what is new. parts.js goes before it.
const polls = 1000, silence = 30, turnPerSecond = 24;  // milliseconds; seconds without news that are worth a word; degrees
const shown = {curves: '', picture: null, mesh: null};
const meshes = new Map();  // by step, until they are shown
let state = null, viewer = null, follows = true, turns = true;

// What the scripts call. A page on a disk may load scripts, but not ask for files.
function tilegradState(now) { state = now; }
function tilegradMesh(step, mesh) { meshes.set(step, mesh); }

const load = (name) => new Promise((done, failed) => {
  const script = document.createElement('script');
  const end = (then) => () => { script.remove(); then(); };
  Object.assign(script, {src: `live/${name}?${Date.now()}`, onload: end(done), onerror: end(failed)});
  document.head.append(script);
});
const count = (number) => number.toLocaleString('en');

// ---- Meshes.

function startMeshes() {
  const views = ['mesh', 'truth'].map((id) => MeshView.on(byId(id), id === 'mesh' ? 'prediction' : 'truth'));
  if (views.includes(null)) {
    byId('viewer-fallback').hidden = false;
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

// `made` tells one mesh of a step from a later one.
async function showMesh({step, made}) {
  const key = `${step} ${made}`;
  if (!viewer || shown.mesh === key) return;
  shown.mesh = key;
  await load(`mesh_${String(step).padStart(8, '0')}.js`);
  const {mesh, truth} = meshes.get(step);
  meshes.delete(step);
  if (shown.mesh !== key) return;
  viewer.views[0].show(mesh);
  viewer.views[1].show(truth);
  byId('mesh-figure').hidden = !mesh;
  byId('viewer-hint').hidden = !mesh;
  byId('truth-figure').hidden = !truth;
  byId('mesh-caption').textContent = `mesh after ${count(step)} steps` + (mesh ? `, ${count(mesh.face_count)} faces` : '');
}

// ---- Pictures, and the slider over all of them.

const newest = (items, limit) => items.reduce((best, item) => item.step <= limit ? item : best, items[0]);

function showPicture({step, file}) {
  if (shown.picture === step) return;
  shown.picture = step;
  byId('live-picture').src = `${file}?${state.time}`;
  byId('picture-caption').textContent = byId('live-picture').alt = `picture after ${count(step)} steps`;
  byId('picture-figure').hidden = false;
}

function showTime() {
  const times = [...new Set([...state.pictures, ...state.meshes].map(({step}) => step))].sort((a, b) => a - b), slider = byId('time');
  byId('now').hidden = times.length === 0;
  slider.hidden = times.length < 2;
  slider.max = times.length - 1;
  if (follows) slider.value = times.length - 1;
  const at = times[slider.value] ?? Infinity;
  if (state.pictures.length) showPicture(newest(state.pictures, at));
  if (state.meshes.length) showMesh(newest(state.meshes, at)).catch(() => { shown.mesh = null; });
}

// ---- Curves and words.

function showCurves() {
  const {step} = state.curves, key = `${step[step.length - 1]}:${step.length}`;
  if (key === shown.curves || step.length === 0) return;
  shown.curves = key;
  byId('log').hidden = false;
  showCharts(byId('curves'), state);
}

const capital = (text) => text.charAt(0).toUpperCase() + text.slice(1);

// What the program does now: of a stage that counts, how far it is.
function progressOf({running, stage, done, total, step, steps}) {
  if (running && stage) return {what: capital(stage), done, total};
  return {what: running ? 'Running' : '', done: step, total: steps};
}

function endOf({error, finished, step, steps}) {
  if (error) return `Ended with an error: ${error}`;
  if (finished) return `Finished after ${count(step)} steps.`;
  if (!step) return 'Stopped before the first step.';
  return `Stopped at step ${count(step)}${steps ? ` of ${count(steps)}` : ''}.`;
}

function statusOf(now) {
  if (!now.running) return endOf(now);
  const {what, done, total} = progressOf(now), quiet = Math.round(Date.now() / 1000 - now.time);
  const far = total ? `: ${count(done)} of ${count(total)}` : done ? `: ${count(done)}` : '';
  const news = quiet < silence ? '' : ` No news for ${quiet < 120 ? `${quiet} seconds` : `${count(Math.round(quiet / 60))} minutes`}.`;
  return `${what}${far}.${news}`;
}

function showWords() {
  document.title = `${state.name} – tilegrad live`;
  byId('name').textContent = state.name;
  const text = statusOf(state), {done, total} = progressOf(state), share = Math.round(1000 * done / total) / 10;
  if (byId('status').textContent !== text) byId('status').textContent = text;
  byId('bar').hidden = !total;
  if (!total) return;
  byId('bar').firstElementChild.style.width = `${share}%`;
  byId('bar').setAttribute('aria-valuenow', share);
}

async function poll() {
  await load('state.js').catch(() => {});
  if (state) {
    showWords();
    showTime();
    showCurves();
  } else byId('status').textContent = 'The files in the folder “live” beside this page are missing.';
  setTimeout(poll, polls);
}

byId('time').addEventListener('input', (event) => {
  follows = Number(event.target.value) === Number(event.target.max);
  showTime();
});
startMeshes();
poll();
