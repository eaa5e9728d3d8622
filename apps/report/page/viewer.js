// The surface in 3D: between before and after by a slider, coloured by what the morph did.

import {
  Box3, BufferAttribute, BufferGeometry, Color, DataTexture, DoubleSide, Group, LinearFilter,
  LineSegments, Mesh, MeshBasicMaterial, OrthographicCamera, RGBAFormat, Scene, ShaderMaterial,
  SphereGeometry, SRGBColorSpace, Vector3, WebGLRenderer,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';

const scale = ['#f5f5e6', '#cce8b5', '#80ccba', '#40abc4', '#247ab5', '#294d99'];
const noValue = -1;

function bytesOf(text) {
  return Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
}

// Numbers of 16 bits in steps of each column's range.
function dequantise({ low, size, data }) {
  const steps = new Uint16Array(bytesOf(data));
  return Float32Array.from(steps, (q, i) => {
    const column = i % low.length;
    return low[column] + (size[column] * q) / 65535;
  });
}

function column(values, count, index) {
  return Float32Array.from({ length: values.length / count }, (_, i) => values[count * i + index]);
}

// Fans of triangles, and every edge once.
function connect(sizes, corners) {
  const triangles = [];
  const edges = new Map();
  let first = 0;
  for (const size of sizes) {
    for (let i = 0; i < size; i += 1) {
      const a = corners[first + i];
      const b = corners[first + ((i + 1) % size)];
      if (i >= 2) triangles.push(corners[first], corners[first + i - 1], a);
      edges.set(Math.min(a, b) * 4294967296 + Math.max(a, b), [a, b]);
    }
    first += size;
  }
  return { triangles: Uint32Array.from(triangles), edges: Uint32Array.from([...edges.values()].flat()) };
}

function shortNumber(value) {
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e5)) return value.toExponential(1);
  return String(Number(value.toPrecision(3)));
}

// What can colour the surface: values before and after in [0, 1] of a range, and its labels.
function makeFields(surface, displacement) {
  const nodes = surface.nodes;
  const length = Float32Array.from({ length: nodes }, (_, i) => Math.hypot(
    displacement[3 * i], displacement[3 * i + 1], displacement[3 * i + 2]) * surface.unit_mm);
  const longest = length.reduce((a, b) => Math.max(a, b), 0);
  const moved = length.map((d) => (longest > 0 ? d / longest : 0));

  const jacobian = dequantise(surface.jacobian);
  const least = Math.min(0, jacobian.reduce((a, b) => Math.min(a, b), 0));
  const good = jacobian.map((q) => (1 - q) / (1 - least));

  const deviation = new Float32Array(bytesOf(surface.deviation));
  const logarithm = deviation.map((d) => Math.log10(Math.max(d, 1e-13)));
  const highest = Math.max(-12, Math.ceil(logarithm.reduce((a, b) => (b > a ? b : a), -13)));
  const off = logarithm.map((d) => (Number.isNaN(d) ? noValue : (d + 13) / (highest + 13)));

  return {
    displacement: {
      title: 'displacement, mm', before: new Float32Array(nodes), after: moved,
      labels: [0, longest / 2, longest].map(shortNumber),
    },
    jacobian: {
      title: 'scaled Jacobian, worst element at each node',
      before: column(good, 2, 0), after: column(good, 2, 1),
      labels: [1, (1 + least) / 2, least].map(shortNumber),
    },
    deviation: {
      title: 'deviation from CAD, mm (grey: no CAD)',
      before: column(off, 2, 0), after: column(off, 2, 1),
      labels: [`≤ 1e-13`, `1e${Math.round((highest - 13) / 2)}`, `1e${highest}`],
    },
    none: { title: '', before: new Float32Array(nodes).fill(noValue), after: new Float32Array(nodes).fill(noValue), labels: [] },
  };
}

function makeColourMap() {
  const size = 256;
  const data = new Uint8Array(4 * size);
  const knots = scale.map((hex) => new Color().setStyle(hex, SRGBColorSpace).convertLinearToSRGB());
  for (let i = 0; i < size; i += 1) {
    const place = (i / (size - 1)) * (knots.length - 1);
    const knot = Math.min(Math.floor(place), knots.length - 2);
    const colour = knots[knot].clone().lerp(knots[knot + 1], place - knot);
    data.set([colour.r * 255, colour.g * 255, colour.b * 255, 255], 4 * i);
  }
  const texture = new DataTexture(data, size, 1, RGBAFormat);
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

const surfaceVertex = `
  attribute vec3 displacement;
  attribute float before;
  attribute float after;
  uniform float morph;
  varying float vValue;
  varying vec3 vPosition;
  void main() {
    vValue = mix(before, after, morph);
    vec4 seen = modelViewMatrix * vec4(position + morph * displacement, 1.0);
    vPosition = seen.xyz;
    gl_Position = projectionMatrix * seen;
  }`;

// Flat faces, lit from the eye, from above the left shoulder, and a little from below on the right.
const surfaceFragment = `
  uniform sampler2D colours;
  varying float vValue;
  varying vec3 vPosition;
  void main() {
    vec3 normal = normalize(cross(dFdx(vPosition), dFdy(vPosition)));
    float light = 0.42 + 0.38 * abs(normal.z) + 0.22 * max(dot(normal, normalize(vec3(-0.5, 0.7, 0.5))), 0.0)
      + 0.14 * max(dot(normal, normalize(vec3(0.5, -0.7, 0.3))), 0.0);
    vec3 colour = vValue < -0.001 ? vec3(0.80, 0.83, 0.87)
      : texture2D(colours, vec2(clamp(vValue, 0.0, 1.0), 0.5)).rgb;
    gl_FragColor = vec4(colour * light, 1.0);
  }`;

const edgeVertex = `
  attribute vec3 displacement;
  uniform float morph;
  void main() {
    gl_Position = projectionMatrix * modelViewMatrix * vec4(position + morph * displacement, 1.0);
    gl_Position.z -= 0.0002;
  }`;

const edgeFragment = `
  void main() { gl_FragColor = vec4(0.10, 0.12, 0.16, 0.35); }`;

// The box around what moved, where that is a small part of the surface: a body in a far field, which
// would hide it. Null for any other part.
function bodyOf(position, displacement, size) {
  const moved = (i) => Math.hypot(displacement[i], displacement[i + 1], displacement[i + 2]);
  let longest = 0;
  for (let i = 0; i < position.length; i += 3) longest = Math.max(longest, moved(i));
  const box = new Box3();
  const node = new Vector3();
  for (let i = 0; i < position.length; i += 3) {
    if (moved(i) <= 0.1 * longest) continue;
    box.expandByPoint(node.fromArray(position, i));
    box.expandByPoint(node.add(new Vector3().fromArray(displacement, i)));
  }
  if (box.isEmpty()) return null;
  const reach = 1.5 * Math.max(...box.getSize(node).toArray());
  if (reach > 0.5 * size) return null;
  return new Box3().setFromCenterAndSize(box.getCenter(node), new Vector3(reach, reach, reach));
}

class Viewer {
  constructor(surface, worst) {
    this.canvas = document.getElementById('canvas');
    this.renderer = new WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    this.renderer.setClearAlpha(0);
    this.scene = new Scene();
    this.camera = new OrthographicCamera();
    this.camera.up.set(0, 0, 1);
    this.uniforms = { morph: { value: 1 }, colours: { value: makeColourMap() } };
    this.addSurface(surface);
    this.addWorst(worst);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener('change', () => this.draw());
    this.resize();
    this.resetView();
    new ResizeObserver(() => this.resize()).observe(this.canvas.parentElement);
  }

  addSurface(surface) {
    const position = dequantise(surface.position);
    const displacement = dequantise(surface.displacement);
    const centre = [0, 1, 2].map((i) => surface.position.low[i] + surface.position.size[i] / 2);
    this.centre = new Vector3(...centre);
    this.radius = Math.hypot(...surface.position.size) / 2 || 1;
    this.body = bodyOf(position, displacement, Math.max(...surface.position.size));
    if (this.body) {
      this.centre = this.body.getCenter(new Vector3());
      this.radius = this.body.getSize(new Vector3()).length() / 2;
    }
    this.canvas.dataset.body = this.body ? 'alone' : 'whole';
    const { triangles, edges } = connect(new Uint8Array(bytesOf(surface.sizes)),
      new Uint32Array(bytesOf(surface.corners)));
    this.fields = makeFields(surface, displacement);
    this.geometry = new BufferGeometry();
    this.geometry.setAttribute('position', new BufferAttribute(position, 3));
    this.geometry.setAttribute('displacement', new BufferAttribute(displacement, 3));
    this.geometry.setIndex(new BufferAttribute(triangles, 1));
    const lines = new BufferGeometry();
    lines.setAttribute('position', this.geometry.getAttribute('position'));
    lines.setAttribute('displacement', this.geometry.getAttribute('displacement'));
    lines.setIndex(new BufferAttribute(edges, 1));
    const faces = new Mesh(this.geometry, new ShaderMaterial({
      uniforms: this.uniforms, vertexShader: surfaceVertex, fragmentShader: surfaceFragment, side: DoubleSide,
    }));
    this.edges = new LineSegments(lines, new ShaderMaterial({
      uniforms: this.uniforms, vertexShader: edgeVertex, fragmentShader: edgeFragment, transparent: true,
    }));
    faces.frustumCulled = false;
    this.edges.frustumCulled = false;
    this.scene.add(faces, this.edges);
  }

  addWorst(worst) {
    this.worst = new Group();
    const ball = new SphereGeometry(this.radius / 90, 16, 12);
    const look = (color, opacity) => new MeshBasicMaterial({ color, depthTest: false, transparent: true, opacity });
    this.worstMaterial = look('#e01e2e', 0.6);
    this.chosenMaterial = look('#ffb300', 1);
    for (const element of worst) {
      const marker = new Mesh(ball, this.worstMaterial);
      marker.position.set(...element.centre);
      marker.renderOrder = 1;
      this.worst.add(marker);
    }
    this.worst.visible = false;
    this.scene.add(this.worst);
  }

  resetView() {
    this.controls.target.copy(this.centre);
    this.camera.position.set(-0.55, -1, 0.55).normalize().multiplyScalar(4 * this.radius).add(this.centre);
    // Of a body in a far field what lies in front of it and behind it is not drawn.
    this.camera.near = this.body ? 3 * this.radius : 0;
    this.camera.far = this.body ? 5 * this.radius : 12 * this.radius;
    this.controls.update();
    this.fit();
    this.draw();
  }

  // Zooms so that the surface fills the view, before, after and between.
  fit() {
    this.camera.zoom = 1;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
    const { position, displacement } = this.geometry.attributes;
    const point = new Vector3();
    const node = new Vector3();
    let furthest = 0;
    for (let i = 0; i < position.count; i += 1) {
      if (this.body && !this.body.containsPoint(node.fromBufferAttribute(position, i))) continue;
      for (const morph of [0, 1]) {
        point.fromBufferAttribute(displacement, i).multiplyScalar(morph);
        point.add(node.fromBufferAttribute(position, i)).project(this.camera);
        furthest = Math.max(furthest, Math.abs(point.x), Math.abs(point.y));
      }
    }
    this.camera.zoom = 0.92 / (furthest || 1);
    this.camera.updateProjectionMatrix();
  }

  showElement(index) {
    this.worst.visible = true;
    this.worst.children.forEach((marker, i) => {
      const isChosen = i === index;
      marker.material = isChosen ? this.chosenMaterial : this.worstMaterial;
      marker.scale.setScalar(isChosen ? 1.6 : 1);
      marker.renderOrder = isChosen ? 2 : 1;
    });
    this.canvas.dataset.chosen = index;
    this.controls.target.copy(this.worst.children[index].position);
    const direction = this.camera.position.clone().sub(this.controls.target).normalize();
    this.camera.position.copy(this.controls.target).addScaledVector(direction, 4 * this.radius);
    this.camera.zoom = 5;
    for (const row of document.querySelectorAll('tr[data-worst]'))
      row.classList.toggle('chosen', Number(row.dataset.worst) === index);
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.draw();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    const size = 1.15 * this.radius;
    const wide = size * Math.max(1, width / height);
    const high = wide * (height / width);
    Object.assign(this.camera, { left: -wide, right: wide, top: high, bottom: -high });
    this.camera.updateProjectionMatrix();
    this.draw();
  }

  setMorph(value) {
    this.uniforms.morph.value = value;
    this.draw();
  }

  colourBy(name) {
    const field = this.fields[name];
    this.geometry.setAttribute('before', new BufferAttribute(field.before, 1));
    this.geometry.setAttribute('after', new BufferAttribute(field.after, 1));
    document.getElementById('legend').hidden = name === 'none';
    document.getElementById('legend-title').textContent = field.title;
    document.getElementById('legend-bar').style.background = `linear-gradient(90deg, ${scale.join(', ')})`;
    document.getElementById('legend-labels').replaceChildren(...field.labels.map((text) => {
      const label = document.createElement('span');
      label.textContent = text;
      return label;
    }));
    this.draw();
  }

  // Once a frame, however often it is asked for.
  draw() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      this.renderer.render(this.scene, this.camera);
      this.canvas.dataset.morph = this.uniforms.morph.value;
      this.canvas.dataset.triangles = this.renderer.info.render.triangles;
    });
  }
}

// Runs the slider to and fro until stopped.
function makePlayer(slider, viewer, button) {
  const secondsOneWay = 2.5;
  let start = null;
  const step = (now) => {
    if (start === null) return;
    const phase = (((now - start) / 1000) / secondsOneWay) % 2;
    slider.value = phase < 1 ? phase : 2 - phase;
    viewer.setMorph(Number(slider.value));
    requestAnimationFrame(step);
  };
  return () => {
    start = start === null ? performance.now() : null;
    button.textContent = start === null ? 'Play' : 'Stop';
    if (start !== null) requestAnimationFrame(step);
  };
}

function connectControls(viewer) {
  const at = (id) => document.getElementById(id);
  const slider = at('morph-slider');
  slider.addEventListener('input', () => viewer.setMorph(Number(slider.value)));
  at('colouring').addEventListener('change', (event) => viewer.colourBy(event.target.value));
  at('show-edges').addEventListener('change', (event) => {
    viewer.edges.visible = event.target.checked;
    viewer.draw();
  });
  at('show-worst').addEventListener('change', (event) => {
    viewer.worst.visible = event.target.checked;
    viewer.draw();
  });
  at('reset-view').addEventListener('click', () => viewer.resetView());
  at('play').addEventListener('click', makePlayer(slider, viewer, at('play')));
  for (const row of document.querySelectorAll('tr[data-worst]')) {
    row.classList.add('clickable');
    row.addEventListener('click', () => {
      at('show-worst').checked = true;
      viewer.showElement(Number(row.dataset.worst));
      at('viewer').scrollIntoView({ behavior: 'smooth', block: 'center' });
    });
  }
}

function canDraw() {
  return document.createElement('canvas').getContext('webgl2') !== null;
}

export function startViewer(surface, worst) {
  if (!canDraw()) {
    const message = document.getElementById('viewer-message');
    message.textContent = 'This browser has no WebGL, so that there is no 3D view; the pictures below show the same.';
    message.hidden = false;
    return;
  }
  const viewer = new Viewer(surface, worst);
  viewer.colourBy('displacement');
  connectControls(viewer);
}
