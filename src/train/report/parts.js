'use strict';
const byId = (id) => document.getElementById(id);
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

// ---- Vectors, and 4 x 4 matrices in columns as WebGL wants them.

const minus = (a, b) => a.map((x, i) => x - b[i]);
const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const cross = (a, b) => [0, 1, 2].map((i) => a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3]);
const unit = (a) => { const length = Math.hypot(...a) || 1; return a.map((x) => x / length); };

// A camera at `eye` that looks at the origin, y up; a square image of `fov` degrees.
function cameraMatrix(eye, fov) {
  const z = unit(eye), x = unit(cross([0, 1, 0], z)), y = cross(z, x);
  const f = 1 / Math.tan(fov * Math.PI / 360), near = 0.05, far = 20;
  const a = (near + far) / (near - far), b = 2 * near * far / (near - far);
  const tx = -dot(x, eye), ty = -dot(y, eye), tz = -dot(z, eye);
  const columns = [0, 1, 2].map((i) => [f * x[i], f * y[i], a * z[i], -z[i]]);
  return new Float32Array([...columns.flat(), f * tx, f * ty, a * tz + b, -tz]);
}

// ---- Meshes: positions in 16 bits over [low, high], colours in 8 bits, both base64.

function bytesOf(base64) {
  const text = atob(base64), bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes.buffer;
}

function unpack(base64, low, high) {
  const steps = new Uint16Array(bytesOf(base64)), axes = low.length;
  return Float32Array.from(steps, (step, i) => low[i % axes] + step / 65535 * (high[i % axes] - low[i % axes]));
}

function decodeMesh({positions, colors, faces, index_bytes, low, high, texture}) {
  const Index = index_bytes === 4 ? Uint32Array : Uint16Array;
  return {
    positions: unpack(positions, low, high), colors: new Uint8Array(bytesOf(colors)), faces: new Index(bytesOf(faces)),
    uvs: texture ? unpack(texture.uvs, texture.low, texture.high) : null,
  };
}

// Of each corner, what its vertex has: corners of one vertex may lie apart in the texture.
function ofCorners(values, faces) {
  const out = new values.constructor(3 * faces.length);
  faces.forEach((v, corner) => { for (let k = 0; k < 3; ++k) out[3 * corner + k] = values[3 * v + k]; });
  return out;
}

// Means over the faces of a vertex, weighted by area.
function vertexNormals({positions, faces}) {
  const normals = new Float32Array(positions.length);
  const at = (v) => positions.subarray(3 * v, 3 * v + 3);
  for (let f = 0; f < faces.length; f += 3) {
    const [a, b, c] = [0, 1, 2].map((k) => Array.from(at(faces[f + k])));
    const n = cross(minus(b, a), minus(c, a));
    for (let k = 0; k < 3; ++k) for (let i = 0; i < 3; ++i) normals[3 * faces[f + k] + i] += n[i];
  }
  return normals;
}

// ---- One canvas that shows one mesh.

const vertexShader = `#version 300 es
in vec3 position, normal, color;
in vec2 uv;
uniform mat4 camera;
out vec3 point, vertexNormal, tint;
out vec2 place;
void main() {
  point = position; vertexNormal = normal; tint = color; place = vec2(uv.x, 1.0 - uv.y);
  gl_Position = camera * vec4(position, 1.0);
}`;
// Predicted surfaces are smooth, real ones are soups of flat faces; both are lit on the side that is seen.
const fragmentShader = `#version 300 es
precision highp float;
in vec3 point, vertexNormal, tint;
in vec2 place;
uniform sampler2D picture;
uniform vec3 eye, strength;
uniform bool smoothSurface;
out vec4 result;
void main() {
  vec3 n = smoothSurface ? vertexNormal : cross(dFdx(point), dFdy(point));
  n = normalize(n + vec3(1e-20));
  n *= dot(n, eye - point) < 0.0 ? -1.0 : 1.0;
  float key = max(dot(n, normalize(vec3(0.35, 0.8, 0.5))), 0.0);
  float fill = max(dot(n, normalize(vec3(-0.6, 0.3, -0.75))), 0.0);
  result = vec4(texture(picture, place).rgb * tint * dot(strength, vec3(1.0, key, fill)), 1.0);
}`;
// Ambient, key and fill: the dataset's light for true colours, a hint of it for predicted ones, which hold the light already.
const lights = {truth: [0.45, 0.45, 0.2], prediction: [0.84, 0.22, 0.12]};

function makeProgram(gl) {
  const program = gl.createProgram();
  for (const [kind, source] of [[gl.VERTEX_SHADER, vertexShader], [gl.FRAGMENT_SHADER, fragmentShader]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    gl.attachShader(program, shader);
  }
  gl.linkProgram(program);
  return gl.getProgramParameter(program, gl.LINK_STATUS) ? program : null;
}

async function decodedImage(address) {
  const image = new Image();
  image.src = address;
  return image.decode().then(() => image, () => null);
}

class MeshView {
  // null where the browser cannot.
  static on(canvas, kind) {
    const gl = canvas.getContext('webgl2', {antialias: true, preserveDrawingBuffer: true});
    const program = gl && makeProgram(gl);
    return program ? new MeshView(canvas, kind, gl, program) : null;
  }
  constructor(canvas, kind, gl, program) {
    Object.assign(this, {canvas, kind, gl, program, count: 0, changed: () => {}});
    gl.enable(gl.DEPTH_TEST);
    gl.clearColor(0.88, 0.88, 0.88, 1);
    this.buffers = {position: gl.createBuffer(), normal: gl.createBuffer(), color: gl.createBuffer(), uv: gl.createBuffer()};
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    gl.pixelStorei(gl.UNPACK_COLORSPACE_CONVERSION_WEBGL, gl.NONE);
  }
  attribute(name, values, type, width) {
    const gl = this.gl, location = gl.getAttribLocation(this.program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
    gl.bufferData(gl.ARRAY_BUFFER, values, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(location);
    gl.vertexAttribPointer(location, width, type, type === gl.UNSIGNED_BYTE, 0, 0);
  }
  texels(image, wrap) {
    const gl = this.gl, set = (name, value) => gl.texParameteri(gl.TEXTURE_2D, gl[name], gl[value]);
    if (image) gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, image);
    else gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 1, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4).fill(255));
    set('TEXTURE_WRAP_S', wrap[0]);
    set('TEXTURE_WRAP_T', wrap[1]);
    set('TEXTURE_MIN_FILTER', 'LINEAR_MIPMAP_LINEAR');
    gl.generateMipmap(gl.TEXTURE_2D);
  }
  // Once its texture is decoded; what was shown stays until then. Of several calls the last one counts.
  async show(packed) {
    this.wanted = packed;
    const image = packed?.texture ? await decodedImage(packed.texture.image) : null;
    if (this.wanted !== packed) return;
    this.count = 0;
    if (packed) this.upload(decodeMesh(packed), image, packed.texture?.wrap ?? ['REPEAT', 'REPEAT']);
    this.changed();
  }
  upload(mesh, image, wrap) {
    const gl = this.gl, {faces} = mesh;
    this.attribute('position', ofCorners(mesh.positions, faces), gl.FLOAT, 3);
    this.attribute('normal', ofCorners(vertexNormals(mesh), faces), gl.FLOAT, 3);
    this.attribute('color', ofCorners(mesh.colors, faces), gl.UNSIGNED_BYTE, 3);
    this.attribute('uv', mesh.uvs ?? new Float32Array(2 * faces.length), gl.FLOAT, 2);
    this.texels(image, wrap);
    this.count = faces.length;
  }
  draw(eye, fov) {
    const gl = this.gl, side = Math.round(this.canvas.clientWidth * Math.min(devicePixelRatio || 1, 2));
    if (this.canvas.width !== side) this.canvas.width = this.canvas.height = side;
    gl.viewport(0, 0, side, side);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.useProgram(this.program);
    const at = (name) => gl.getUniformLocation(this.program, name);
    gl.uniformMatrix4fv(at('camera'), false, cameraMatrix(eye, fov));
    gl.uniform3fv(at('eye'), eye);
    gl.uniform3fv(at('strength'), lights[this.kind]);
    gl.uniform1i(at('smoothSurface'), this.kind === 'prediction' ? 1 : 0);
    if (this.count) gl.drawArrays(gl.TRIANGLES, 0, this.count);
  }
}

// ---- The viewer: both meshes of a model turn together, from the input's view on.

class Viewer {
  constructor(views, camera, stage) {
    Object.assign(this, {views, camera});
    this.pointers = new Map();
    this.reset();
    for (const view of views) {
      this.listen(view.canvas);
      view.changed = () => this.redraw();
    }
    new ResizeObserver(() => this.redraw()).observe(stage);
  }
  reset() {
    const {azimuth, elevation, distance} = this.camera;
    Object.assign(this, {azimuth, elevation, distance});
    this.redraw();
  }
  turn(right, up) {
    this.azimuth += right;
    this.elevation = clamp(this.elevation + up, -89, 89);
    this.redraw();
  }
  zoom(factor) {
    this.distance = clamp(this.distance * factor, 0.7, 5);
    this.redraw();
  }
  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => { this.waiting = false; this.draw(); });
  }
  draw() {
    const az = this.azimuth * Math.PI / 180, el = this.elevation * Math.PI / 180;
    const eye = [Math.cos(el) * Math.cos(az), Math.sin(el), Math.cos(el) * Math.sin(az)].map((x) => x * this.distance);
    this.views.forEach((view) => view.draw(eye, this.camera.fov_y));
  }
  listen(canvas) {
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, event);
    });
    canvas.addEventListener('pointermove', (event) => this.drag(event));
    for (const end of ['pointerup', 'pointercancel'])
      canvas.addEventListener(end, (event) => this.pointers.delete(event.pointerId));
    canvas.addEventListener('wheel', (event) => { event.preventDefault(); this.zoom(Math.exp(clamp(event.deltaY, -100, 100) * 0.002)); }, {passive: false});
    canvas.addEventListener('dblclick', () => this.reset());
    canvas.addEventListener('keydown', (event) => this.key(event));
  }
  // One pointer turns, two zoom.
  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const others = [...this.pointers.values()].filter((p) => p.pointerId !== event.pointerId);
    if (others.length === 0) this.turn((event.clientX - before.clientX) * 0.5, (event.clientY - before.clientY) * 0.5);
    else {
      const spread = (p) => Math.hypot(p.clientX - others[0].clientX, p.clientY - others[0].clientY) || 1;
      this.zoom(spread(before) / spread(event));
    }
    this.pointers.set(event.pointerId, event);
  }
  key(event) {
    const actions = {
      ArrowLeft: () => this.turn(-10, 0), ArrowRight: () => this.turn(10, 0), ArrowUp: () => this.turn(0, 10),
      ArrowDown: () => this.turn(0, -10), '+': () => this.zoom(0.9), '=': () => this.zoom(0.9), '-': () => this.zoom(1 / 0.9), 0: () => this.reset(),
    };
    if (!actions[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    actions[event.key]();
  }
}

// ---- Curves: small charts that share one cursor.

const margin = {right: 24, top: 10, bottom: 36}, height = 200;  // left: as wide as the labels

function svg(name, attributes, parent, text) {
  const element = document.createElementNS('http://www.w3.org/2000/svg', name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  if (text !== undefined) element.textContent = text;
  if (parent) parent.append(element);
  return element;
}

// Round numbers over [low, high], about `count` of them.
function ticks(low, high, count) {
  const rough = (high - low || 1) / count, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= 0.7 * rough);
  const first = Math.ceil(low / step - 1e-9), last = Math.floor(high / step + 1e-9);
  return Array.from({length: last - first + 1}, (_, i) => +((first + i) * step).toPrecision(12));
}

const format = (x) => x === null ? '–' : Math.abs(x) >= 1000 ? Math.round(x).toLocaleString('en') : String(+x.toPrecision(4));

function runningMean(values) {
  const keep = Math.exp(-1 / Math.max(1, values.length * 0.015));
  let sum = 0, weight = 0;
  return values.map((value) => {
    if (value === null) return null;
    sum = keep * sum + value, weight = keep * weight + 1;
    return sum / weight;
  });
}

class Chart {
  constructor({title, values}, steps, moved) {
    this.values = values, this.mean = runningMean(this.values), this.steps = steps;
    this.element = document.createElement('div');
    this.element.className = 'chart';
    const head = document.createElement('div'), heading = document.createElement('h3');
    head.className = 'chart-head', heading.textContent = title;
    this.readout = document.createElement('output');
    head.append(heading, this.readout);
    this.last = this.values.reduce((last, value, i) => value === null ? last : i, 0);
    const last = this.mean[this.last];
    this.drawing = svg('svg', {role: 'img', tabindex: 0, 'aria-label': `${title} against steps, ${format(this.mean[0])} at first, ${format(last)} at last`});
    this.element.append(head, this.drawing);
    this.listen(moved);
  }
  listen(moved) {
    const last = this.steps.length - 1;
    this.drawing.addEventListener('pointermove', (event) => moved(this.nearest(event.clientX)));
    this.drawing.addEventListener('pointerleave', () => moved(null));
    this.drawing.addEventListener('blur', () => moved(null));
    this.drawing.addEventListener('keydown', (event) => {
      const by = {ArrowLeft: -1, ArrowRight: 1}[event.key];
      if (!by) return;
      event.preventDefault();
      moved(clamp((this.at ?? last) + by, 0, last));
    });
  }
  nearest(clientX) {
    const step = (clientX - this.drawing.getBoundingClientRect().left - this.left) / this.inner * this.steps[this.steps.length - 1];
    let best = 0;
    this.steps.forEach((s, i) => { if (Math.abs(s - step) < Math.abs(this.steps[best] - step)) best = i; });
    return best;
  }
  x(i) { return this.left + this.inner * this.steps[i] / (this.steps[this.steps.length - 1] || 1); }
  y(value) { return height - margin.bottom - (height - margin.top - margin.bottom) * (value - this.low) / (this.high - this.low); }
  path(values) {
    let pen = 'M';
    return values.map((value, i) => {
      const start = pen === 'M' ? 'h0' : '';  // one without neighbours is a dot
      const part = value === null ? '' : `${pen}${this.x(i).toFixed(1)} ${this.y(value).toFixed(1)}${start}`;
      pen = value === null ? 'M' : 'L';
      return part;
    }).join('');
  }
  axes() {
    for (const tick of ticks(this.low, this.high, 4)) {
      const y = this.y(tick);
      svg('line', {class: 'grid', x1: this.left, x2: this.width - margin.right, y1: y, y2: y}, this.drawing);
      svg('text', {x: this.left - 6, y: y + 4, 'text-anchor': 'end'}, this.drawing, format(tick));
    }
    const end = this.steps[this.steps.length - 1];
    for (const tick of ticks(0, end, this.width > 380 ? 6 : 4)) {
      const x = this.left + this.inner * tick / (end || 1);
      svg('text', {x, y: height - margin.bottom + 15, 'text-anchor': 'middle'}, this.drawing, tick.toLocaleString('en'));
    }
    svg('text', {x: this.left + this.inner / 2, y: height - 4, 'text-anchor': 'middle'}, this.drawing, 'step');
  }
  draw() {
    this.low = Math.min(0, ...this.values) * 1.02;
    this.high = Math.max(0, ...this.values) * 1.02 || (this.low < 0 ? 0 : 1);
    this.left = 14 + 7 * Math.max(...ticks(this.low, this.high, 4).map((tick) => format(tick).length));
    this.width = this.element.clientWidth, this.inner = this.width - this.left - margin.right;
    this.drawing.setAttribute('viewBox', `0 0 ${this.width} ${height}`);
    this.drawing.replaceChildren();
    this.axes();
    svg('path', {class: 'raw', d: this.path(this.values)}, this.drawing);
    svg('path', {class: 'mean', d: this.path(this.mean)}, this.drawing);
    this.cursor = svg('g', {class: 'cursor'}, this.drawing);
    this.point(null);
  }
  // Reads the curve at a logged step, or at its end, which may be before that of others.
  point(index) {
    this.at = index;
    const shown = index ?? this.last;
    this.readout.textContent = `step ${this.steps[shown].toLocaleString('en')}: ${format(this.values[shown])}`;
    this.cursor.replaceChildren();
    if (index === null) return;
    const x = this.x(index);
    svg('line', {x1: x, x2: x, y1: margin.top, y2: height - margin.bottom}, this.cursor);
    if (this.values[index] !== null) svg('circle', {cx: x, cy: this.y(this.values[index]), r: 4.5}, this.cursor);
  }
}

// The charts of a log in `host`, in place of those that stand there. Values that never change make none.
function showCharts(host, {curves, charts}) {
  const told = charts.filter(({key}) => key === 'loss' || curves[key].some((value) => value !== curves[key][0]));
  const drawn = told.map(({key, title}) => new Chart({title, values: curves[key]}, curves.step, (index) => drawn.forEach((chart) => chart.point(index))));
  host.replaceChildren(...drawn.map((chart) => chart.element));
  host.sizes?.disconnect();
  host.sizes = new ResizeObserver(() => requestAnimationFrame(() => drawn.forEach((chart) => chart.draw())));
  host.sizes.observe(host);
}
