// The report's own part; parts.js, which goes before it, draws.
const data = JSON.parse(document.getElementById('data').textContent);

function startViewer() {
  const section = byId('viewer');
  section.hidden = !data.models.some((model) => model.prediction);
  if (section.hidden) return;
  const views = ['prediction', 'truth'].map((kind) => MeshView.on(byId('viewer-' + kind), kind));
  if (views.includes(null)) {
    byId('viewer-fallback').hidden = false;
    byId('viewer-hint').hidden = true;
    return;
  }
  byId('stage').hidden = false;
  if (data.generated) {
    byId('viewer-input-caption').textContent = 'from the front';
    byId('viewer-prediction-caption').textContent = 'generated';
    byId('viewer-truth').parentElement.hidden = true;
  }
  const viewer = new Viewer(views, data.camera, byId('stage'));
  const buttons = data.models.map((model, index) => pickerButton(model, index, () => choose(index)));
  byId('picker').append(...buttons);
  const choose = (index) => {
    buttons.forEach((button, i) => button.setAttribute('aria-pressed', i === index));
    showModel(views, index);
    viewer.reset();
  };
  choose(0);
}

const titleOf = (model) => model.class ? `${model.name} (${model.class})` : model.name;
const inputOf = (index) => document.querySelector(`[data-model="${index}"] img`).src;

function pickerButton(model, index, choose) {
  const button = document.createElement('button'), image = document.createElement('img');
  button.type = 'button';
  button.title = image.alt = titleOf(model);
  image.src = inputOf(index);
  button.append(image);
  button.addEventListener('click', choose);
  return button;
}

function showModel([prediction, truth], index) {
  const model = data.models[index];
  prediction.show(model.prediction);
  truth.show(model.truth);
  prediction.canvas.setAttribute('aria-label', `Predicted mesh of ${model.name}; turn it with the arrow keys`);
  truth.canvas.setAttribute('aria-label', `True mesh of ${model.name}; turn it with the arrow keys`);
  byId('viewer-truth-caption').textContent = model.truth ? 'truth' : 'the dataset has no mesh of it';
  byId('viewer-input').src = inputOf(index);
  byId('viewer-input').alt = data.generated ? model.name : `${model.name}: the image that the network sees`;
  byId('viewer-name').textContent = titleOf(model);
}

function startCurves() {
  if (data.curves.step.length > 0) showCharts(byId('curves'), data);
  else byId('curves').textContent = 'Nothing has been logged yet.';
}

addEventListener('beforeprint', () => document.querySelectorAll('details').forEach((details) => { details.open = true; }));
startViewer();
startCurves();
