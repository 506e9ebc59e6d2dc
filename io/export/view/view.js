// Plays a run: grains as spheres, walls translucent, time series beside. Put into the page by `moraine view`, with the data.
"use strict";

const data = JSON.parse(document.getElementById("data").textContent);
const canvas = document.getElementById("picture");
const seek = document.getElementById("seek");

// ---------------------------------------------------------------------------------------------------------------- data

function bytesOf(base64) {
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) bytes[i] = text.charCodeAt(i);
  return bytes;
}

async function inflated(base64) {
  const stream = new Blob([bytesOf(base64)]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// ------------------------------------------------------------------------------------------------------------- vectors

const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/// Column-major product.
function product(a, b) {
  const c = new Float32Array(16);
  for (let column = 0; column < 4; ++column)
    for (let row = 0; row < 4; ++row)
      for (let k = 0; k < 4; ++k) c[4 * column + row] += a[4 * k + row] * b[4 * column + k];
  return c;
}

// -------------------------------------------------------------------------------------------------------------- camera

const size = subtract(data.high, data.low);
const diagonal = Math.hypot(...size) || 1;
const halfAngle = (14 * Math.PI) / 180;
const start = () => ({
  azimuth: ((data.flat ? -90 : -62) * Math.PI) / 180,
  elevation: ((data.flat ? 90 : 18) * Math.PI) / 180,
  distance: (data.flat ? 0.52 : 0.56) * diagonal / Math.sin(halfAngle),
  target: data.low.map((low, axis) => low + size[axis] / 2),
});
let camera = start();

function cameraAxes() {
  const { azimuth: a, elevation: e } = camera;
  const [east, north, top] = data.upright;  // what is up: against gravity
  const of = (x, y, z) => east.map((_, axis) => x * east[axis] + y * north[axis] + z * top[axis]);
  const ahead = of(-Math.cos(e) * Math.cos(a), -Math.cos(e) * Math.sin(a), -Math.sin(e));
  const up = of(-Math.sin(e) * Math.cos(a), -Math.sin(e) * Math.sin(a), Math.cos(e));
  return { ahead, up, right: cross(ahead, up) };
}

function viewMatrix() {
  const { ahead, up, right } = cameraAxes();
  const place = camera.target.map((t, axis) => t - camera.distance * ahead[axis]);
  return new Float32Array([
    right[0], up[0], -ahead[0], 0, right[1], up[1], -ahead[1], 0, right[2], up[2], -ahead[2], 0,
    -dot(right, place), -dot(up, place), dot(ahead, place), 1]);
}

function projectionMatrix() {
  const aspect = canvas.width / canvas.height;
  const f = Math.min(1, aspect) / Math.tan(halfAngle);  // what is wide still fits into a narrow window
  const near = Math.max(camera.distance - 2 * diagonal, 0.01 * camera.distance), far = camera.distance + 2 * diagonal;
  return new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, (2 * near * far) / (near - far), 0]);
}

// -------------------------------------------------------------------------------------------------------------- drawing

const gl = canvas.getContext("webgl2", { antialias: true, preserveDrawingBuffer: true });
if (!gl) {
  const trouble = document.getElementById("trouble");
  trouble.style.display = "flex";
  trouble.textContent = "This browser has no WebGL 2, which the picture needs.";
  throw new Error("no WebGL 2");
}

function program(vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, "#version 300 es\nprecision highp float;\n" + text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  return made;
}

// A square that faces the viewer for each grain; where the line of sight meets the sphere, it is drawn with the sphere's depth and normal.
const grains = program(
  `in vec2 corner; in float x, y, z, radius, value;
   uniform mat4 view, projection; uniform vec3 low, size; uniform float largest;
   out vec3 place; flat out vec3 centre; flat out float r, v;
   void main() {
     r = radius * largest; v = value;
     centre = (view * vec4(low + size * vec3(x, y, z), 1.0)).xyz;
     place = centre + vec3(1.15 * r * corner, r);
     gl_Position = projection * vec4(place, 1.0);
   }`,
  `in vec3 place; flat in vec3 centre; flat in float r, v;
   uniform mat4 projection; uniform sampler2D palette; uniform vec3 lamp;
   out vec4 colour;
   void main() {
     vec3 ray = normalize(place);
     float along = dot(ray, centre), inside = along * along - dot(centre, centre) + r * r;
     if (inside < 0.0) discard;
     vec3 hit = (along - sqrt(inside)) * ray, normal = (hit - centre) / r;
     vec4 clip = projection * vec4(hit, 1.0);
     gl_FragDepth = 0.5 * clip.z / clip.w + 0.5;
     float light = 0.50 + 0.58 * max(dot(normal, lamp), 0.0);
     float shine = 0.16 * pow(max(dot(reflect(-lamp, normal), -ray), 0.0), 24.0);
     float rim = 0.75 + 0.25 * smoothstep(0.0, 0.45, -dot(normal, ray));
     colour = vec4(texture(palette, vec2(v * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb * light * rim + shine, 1.0);
   }`);
const surfaces = program(
  `in vec3 point; uniform mat4 view, projection;
   void main() { gl_Position = projection * view * vec4(point, 1.0); }`,
  `uniform vec4 tint; out vec4 colour; void main() { colour = vec4(tint.rgb * tint.a, tint.a); }`);

const uniform = (made, name) => gl.getUniformLocation(made, name);
const attribute = (made, name) => gl.getAttribLocation(made, name);

function bufferOf(bytes) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.STATIC_DRAW);
  return buffer;
}

const square = bufferOf(new Float32Array([-1, -1, 1, -1, -1, 1, 1, 1]));
const frameBuffer = gl.createBuffer();
const palette = gl.createTexture();
const colours = bytesOf(data.palette);
gl.bindTexture(gl.TEXTURE_2D, palette);
gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, colours);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);

function edgesOf(low, high) {
  const points = [];
  for (let i = 0; i < 8; ++i)
    for (let axis = 0; axis < 3; ++axis)
      if (!(i & (1 << axis)))
        for (const j of [i, i | (1 << axis)]) points.push(j & 1 ? high[0] : low[0], j & 2 ? high[1] : low[1], j & 4 ? high[2] : low[2]);
  return new Float32Array(points);
}

const walls = data.walls.map((wall) => {
  const triangles = bytesOf(wall.triangles), lines = bytesOf(wall.lines);
  return { ...wall, triangles: bufferOf(triangles), n_triangles: triangles.length / 12, lines: bufferOf(lines), n_lines: lines.length / 12 };
});
const outline = { lines: bufferOf(edgesOf(data.low, data.high)), n_lines: 24 };

let shown = { n: 0, frame: data.frames[0] };  // what is in frameBuffer

function drawGrains(view, projection) {
  const n = shown.n;
  if (n === 0) return;
  gl.useProgram(grains);
  gl.uniformMatrix4fv(uniform(grains, "view"), false, view);
  gl.uniformMatrix4fv(uniform(grains, "projection"), false, projection);
  gl.uniform3fv(uniform(grains, "low"), data.low);
  gl.uniform3fv(uniform(grains, "size"), size);
  gl.uniform1f(uniform(grains, "largest"), data.radius);
  gl.uniform3f(uniform(grains, "lamp"), -0.42, 0.66, 0.62);
  gl.bindBuffer(gl.ARRAY_BUFFER, square);
  const corner = attribute(grains, "corner");
  gl.enableVertexAttribArray(corner);
  gl.vertexAttribPointer(corner, 2, gl.FLOAT, false, 0, 0);
  gl.bindBuffer(gl.ARRAY_BUFFER, frameBuffer);
  const used = [corner];
  ["x", "y", "z", "radius", "value"].forEach((name, k) => {
    const place = attribute(grains, name);
    used.push(place);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, 1, k < 4 ? gl.UNSIGNED_SHORT : gl.UNSIGNED_BYTE, true, 0, 2 * n * k);
    gl.vertexAttribDivisor(place, 1);
  });
  gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, n);
  for (const place of used) {
    gl.vertexAttribDivisor(place, 0);
    gl.disableVertexAttribArray(place);
  }
}

function drawShape(buffer, n, mode, tint) {
  if (n === 0) return;
  gl.uniform4fv(uniform(surfaces, "tint"), tint);
  const point = attribute(surfaces, "point");
  gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
  gl.enableVertexAttribArray(point);
  gl.vertexAttribPointer(point, 3, gl.FLOAT, false, 0, 0);
  gl.drawArrays(mode, 0, n);
  gl.disableVertexAttribArray(point);
}

function drawWalls(view, projection) {
  const time = shown.frame.time;
  const there = walls.filter((wall) => time >= wall.from && (wall.until === undefined || time < wall.until));
  gl.useProgram(surfaces);
  gl.uniformMatrix4fv(uniform(surfaces, "view"), false, view);
  gl.uniformMatrix4fv(uniform(surfaces, "projection"), false, projection);
  gl.enable(gl.BLEND);
  gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  gl.depthMask(false);
  if (document.getElementById("walls").checked)
    for (const wall of there) {
      drawShape(wall.triangles, wall.n_triangles, gl.TRIANGLES, [0.45, 0.56, 0.68, 0.13]);
      drawShape(wall.lines, wall.n_lines, gl.LINES, [0.25, 0.32, 0.4, 0.55]);
    }
  if (there.length === 0) drawShape(outline.lines, outline.n_lines, gl.LINES, [0.25, 0.32, 0.4, 0.55]);
  gl.depthMask(true);
  gl.disable(gl.BLEND);
}

function draw() {
  const dense = window.devicePixelRatio || 1;
  const width = Math.round(canvas.clientWidth * dense), height = Math.round(canvas.clientHeight * dense);
  if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
  gl.viewport(0, 0, width, height);
  gl.clearColor(0.965, 0.97, 0.978, 1);
  gl.enable(gl.DEPTH_TEST);
  gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  const view = viewMatrix(), projection = projectionMatrix();
  drawGrains(view, projection);
  drawWalls(view, projection);
}

// ----------------------------------------------------------------------------------------------------------- the legend

const short = (value) => String(Number(value.toPrecision(3)));

function makeBar() {
  const bar = document.getElementById("bar");
  bar.append(data.label);
  const strip = document.createElement("canvas");
  [strip.width, strip.height] = [16, 220];
  const brush = strip.getContext("2d");
  for (let row = 0; row < 220; ++row) {
    const k = 4 * Math.round(255 * (1 - row / 219));
    brush.fillStyle = `rgb(${colours[k]}, ${colours[k + 1]}, ${colours[k + 2]})`;
    brush.fillRect(0, row, 16, 1);
  }
  bar.append(strip);
  for (let i = 0; i <= 4; ++i) {
    const tick = document.createElement("div");
    tick.className = "ends";
    tick.style.top = `${24 + 220 * (1 - i / 4) - 10}px`;
    tick.textContent = short(data.range[0] + ((data.range[1] - data.range[0]) * i) / 4);
    bar.append(tick);
  }
}

function stamp(frame) {
  const part = frame.n < frame.grains ? `, ${frame.n} of them shown` : "";
  document.getElementById("stamp").textContent = `t = ${frame.time.toPrecision(4)} s\n${frame.grains} grains${part}`;
}

// -------------------------------------------------------------------------------------------------------------- charts

const lineColours = ["#3b5b92", "#c0563b", "#3f8f5f", "#8d6bb0", "#b58b2a", "#4aa3b5", "#7a7a7a", "#b04a7a"];
const charts = [];

function span(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values)
    if (value !== null) [low, high] = [Math.min(low, value), Math.max(high, value)];
  if (!(low <= high)) return [0, 1];
  return low === high ? [low - 0.5 * Math.abs(low) - 1e-12, high + 0.5 * Math.abs(high) + 1e-12] : [low, high];
}

/// At most eight lines can be told apart: of more, an even share.
function someOf(lines) {
  if (lines.length <= 8) return lines;
  return Array.from({ length: 8 }, (_, k) => lines[Math.round((k * (lines.length - 1)) / 7)]);
}

function makeChart(series) {
  const sheet = document.createElement("canvas");
  document.getElementById("charts").append(sheet);
  const lines = someOf(series.lines);
  const chart = { sheet, series, lines, x: span(series.time), y: span(lines.flatMap((line) => line.values)) };
  sheet.addEventListener("click", (event) => {
    const share = (event.offsetX - margin.left) / (sheet.clientWidth - margin.left - margin.right);
    show(frameAt(chart.x[0] + share * (chart.x[1] - chart.x[0])));
  });
  charts.push(chart);
}

const margin = { left: 52, right: 10, top: 34, bottom: 20 };

function drawChart({ sheet, series, lines, x, y }) {
  const dense = window.devicePixelRatio || 1, width = sheet.clientWidth, height = sheet.clientHeight;
  [sheet.width, sheet.height] = [width * dense, height * dense];
  const brush = sheet.getContext("2d");
  brush.scale(dense, dense);
  brush.font = "11px system-ui, sans-serif";
  const place = { left: margin.left, right: width - margin.right, top: margin.top, bottom: height - margin.bottom };
  const atX = (value) => place.left + ((value - x[0]) / (x[1] - x[0] || 1)) * (place.right - place.left);
  const atY = (value) => place.bottom - ((value - y[0]) / (y[1] - y[0])) * (place.bottom - place.top);
  brush.fillStyle = "#1d2430";
  brush.fillText(series.name + (series.unit ? ` [${series.unit}]` : ""), 4, 11);
  brush.strokeStyle = "#d9dee5";
  brush.fillStyle = "#667085";
  for (let i = 0; i <= 2; ++i) {
    const value = y[0] + ((y[1] - y[0]) * i) / 2;
    brush.beginPath();
    brush.moveTo(place.left, atY(value));
    brush.lineTo(place.right, atY(value));
    brush.stroke();
    brush.fillText(short(value), 4, atY(value) + 4);
  }
  for (let i = 0; i <= 2; ++i) {
    const value = x[0] + ((x[1] - x[0]) * i) / 2;
    brush.textAlign = ["left", "center", "right"][i];
    brush.fillText(short(value) + (i === 2 ? " s" : ""), atX(value), height - 6);
  }
  brush.textAlign = "left";
  let label = 4;
  lines.forEach((line, k) => {
    brush.strokeStyle = brush.fillStyle = lineColours[k];
    brush.lineWidth = 1.4;
    brush.beginPath();
    let isDown = false;
    line.values.forEach((value, i) => {
      if (value === null) isDown = false;
      else brush[isDown ? "lineTo" : "moveTo"](atX(series.time[i]), atY(value)), (isDown = true);
    });
    brush.stroke();
    const words = line.name;
    if (label + brush.measureText(words).width < width) brush.fillText(words, label, 26);
    label += brush.measureText(words).width + 10;
  });
  brush.strokeStyle = "#1d2430";
  brush.lineWidth = 1;
  brush.beginPath();
  brush.moveTo(atX(shown.frame.time), place.top);
  brush.lineTo(atX(shown.frame.time), place.bottom);
  brush.stroke();
}

// -------------------------------------------------------------------------------------------------------------- playing

let wanted = 0, isPlaying = false, lastTick = 0, isLoading = false;

function frameAt(time) {
  let best = 0;
  data.frames.forEach((frame, k) => {
    if (Math.abs(frame.time - time) < Math.abs(data.frames[best].time - time)) best = k;
  });
  return best;
}

/// Shows the frame that was asked for last; of those asked for meanwhile the others are skipped.
async function show(number) {
  wanted = number;
  seek.value = number;
  if (isLoading) return;
  isLoading = true;
  for (let loaded = -1; loaded !== wanted; ) {
    loaded = wanted;
    const frame = data.frames[loaded];
    const bytes = await inflated(frame.data);
    gl.bindBuffer(gl.ARRAY_BUFFER, frameBuffer);
    gl.bufferData(gl.ARRAY_BUFFER, bytes, gl.DYNAMIC_DRAW);
    shown = { n: frame.n, frame };
  }
  isLoading = false;
  stamp(shown.frame);
  draw();
  charts.forEach(drawChart);
  document.body.dataset.frame = wanted;  // for tests: this frame is on the screen
}

function setPlaying(is) {
  isPlaying = is;
  document.getElementById("play").textContent = is ? "pause" : "play";
  if (is && wanted === data.frames.length - 1) show(0);
  if (is) requestAnimationFrame(tick);
}

function tick(now) {
  if (!isPlaying) return;
  if (now - lastTick >= 1000 / Number(document.getElementById("speed").value) && !isLoading) {
    lastTick = now;
    if (wanted + 1 < data.frames.length) show(wanted + 1);
    else setPlaying(false);
  }
  requestAnimationFrame(tick);
}

// ---------------------------------------------------------------------------------------------------------------- hands

let hold = null;
canvas.addEventListener("pointerdown", (event) => {
  hold = { x: event.clientX, y: event.clientY, moves: event.shiftKey || event.button !== 0 };
  canvas.setPointerCapture(event.pointerId);
});
canvas.addEventListener("pointerup", () => (hold = null));
canvas.addEventListener("pointermove", (event) => {
  if (!hold) return;
  const dx = event.clientX - hold.x, dy = event.clientY - hold.y;
  [hold.x, hold.y] = [event.clientX, event.clientY];
  if (hold.moves) {
    const { up, right } = cameraAxes();
    const metres = (2 * camera.distance * Math.tan(halfAngle)) / canvas.clientHeight;
    camera.target = camera.target.map((t, axis) => t + metres * (dy * up[axis] - dx * right[axis]));
  } else {
    camera.azimuth -= 0.008 * dx;
    camera.elevation = Math.min(Math.PI / 2, Math.max(-Math.PI / 2, camera.elevation + 0.008 * dy));
  }
  draw();
});
canvas.addEventListener("contextmenu", (event) => event.preventDefault());
canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  camera.distance *= Math.exp(0.001 * event.deltaY);
  draw();
}, { passive: false });
canvas.addEventListener("dblclick", () => {
  camera = start();
  draw();
});
document.getElementById("play").addEventListener("click", () => setPlaying(!isPlaying));
document.getElementById("walls").addEventListener("change", draw);
seek.addEventListener("input", () => show(Number(seek.value)));
document.addEventListener("keydown", (event) => {
  const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (event.key === " ") event.preventDefault(), setPlaying(!isPlaying);
  else if (step && event.target !== seek) show(Math.min(data.frames.length - 1, Math.max(0, wanted + step)));
});
window.addEventListener("resize", () => {
  draw();
  charts.forEach(drawChart);
});

document.querySelector("header").textContent = data.title;
seek.max = data.frames.length - 1;
makeBar();
data.series.forEach(makeChart);
const asked = /frame=(\d+)/.exec(location.hash);
show(asked ? Math.min(Number(asked[1]), data.frames.length - 1) : data.frames.length - 1);
