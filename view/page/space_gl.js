// WebGL2 drawing of the view of space: Earth, points that move between two states, lines and triangles.

const MOVING = `#version 300 es
uniform mat4 matrix; uniform vec3 eye; uniform float u, step_s, size;
in vec3 p0, v0, p1, v1; in float kind;
flat out float kind_out;
void main() {
  float h1 = u * u * (3.0 - 2.0 * u); // Hermite's cubic
  vec3 p = (1.0 - h1) * p0 + h1 * p1 + u * (1.0 - u) * (1.0 - u) * step_s * v0 + u * u * (u - 1.0) * step_s * v1;
  gl_Position = matrix * vec4(p - eye, 1.0);
  gl_PointSize = size * (1.0 + kind);
  kind_out = kind;
}`;
const POINT = `#version 300 es
precision mediump float;
uniform vec4 colour, marked;
flat in float kind_out; out vec4 pixel;
void main() {
  vec2 at = 2.0 * gl_PointCoord - 1.0;
  if (dot(at, at) > 1.0) discard;
  pixel = kind_out > 0.5 ? marked : colour;
}`;
const PLAIN = `#version 300 es
uniform mat4 matrix; uniform vec3 eye; in vec3 p0;
void main() { gl_Position = matrix * vec4(p0 - eye, 1.0); gl_PointSize = 9.0; }`;
const FLAT = `#version 300 es
precision mediump float;
uniform vec4 colour; out vec4 pixel;
void main() { pixel = colour; }`;
const GLOBE = `#version 300 es
uniform mat4 matrix; uniform vec3 eye; in vec3 p0; out vec3 place;
void main() { place = p0; gl_Position = matrix * vec4(p0 - eye, 1.0); }`;
// Day, night and the terminator; a graticule of 15 degrees in longitude and latitude of the Earth.
const GROUND = `#version 300 es
precision highp float;
uniform vec3 sun; uniform mat3 earth; in vec3 place; out vec4 pixel;
float lines(float degrees, float every) {
  float at = abs(fract(degrees / every + 0.5) - 0.5) * every;
  return 1.0 - smoothstep(0.0, 1.5 * fwidth(degrees), at);
}
void main() {
  vec3 up = normalize(place), ground = earth * up;
  float height = dot(up, sun), day = smoothstep(-0.02, 0.02, height);
  float latitude = degrees(asin(clamp(ground.z, -1.0, 1.0))), longitude = degrees(atan(ground.y, ground.x));
  vec3 colour = mix(vec3(0.035, 0.055, 0.09), vec3(0.16, 0.33, 0.52) * (0.55 + 0.45 * max(height, 0.0)), day);
  float wide = max(fwidth(ground.x), fwidth(ground.y)) > 0.2 ? 0.0 : 1.0;
  float grid = max(lines(latitude, 15.0), abs(longitude) > 179.0 || abs(latitude) > 84.0 ? 0.0 : lines(longitude, 15.0));
  float equator = 1.0 - smoothstep(0.0, 2.5 * fwidth(latitude), abs(latitude));
  colour = mix(colour, vec3(0.45, 0.6, 0.72), wide * max(0.28 * grid, 0.6 * equator) * (0.45 + 0.55 * day));
  float edge = 1.0 - smoothstep(0.0, 2.0 * fwidth(height), abs(height));
  pixel = vec4(mix(colour, vec3(0.94, 0.72, 0.25), 0.6 * edge), 1.0);
}`;

/** Triangles of a sphere of radius 1. */
function sphere(rings, sectors) {
  const points = [];
  const at = (i, k) => {
    const polar = Math.PI * i / rings, azimuth = 2 * Math.PI * k / sectors;
    return [Math.sin(polar) * Math.cos(azimuth), Math.sin(polar) * Math.sin(azimuth), Math.cos(polar)];
  };
  for (let i = 0; i < rings; i++) {
    for (let k = 0; k < sectors; k++) points.push(...at(i, k), ...at(i + 1, k), ...at(i, k + 1), ...at(i, k + 1), ...at(i + 1, k), ...at(i + 1, k + 1));
  }
  return new Float32Array(points);
}

export class SpacePainter {
  /** @param {HTMLCanvasElement} canvas Throws where there is no WebGL2. */
  constructor(canvas) {
    const gl = canvas.getContext('webgl2', { antialias: true, alpha: false });
    if (!gl) throw new Error('this browser has no WebGL2');
    this.gl = gl;
    this.canvas = canvas;
    this.moving = this.program(MOVING, POINT);
    this.plain = this.program(PLAIN, FLAT);
    this.globe = this.program(GLOBE, GROUND);
    this.ground = this.buffer(sphere(48, 96));
    this.scratch = gl.createBuffer();
    this.bodies = null;
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
  }

  program(vertex, fragment) {
    const { gl } = this, program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(type);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(`shader: ${gl.getProgramInfoLog(program)}`);
    return { program, at: (name) => gl.getUniformLocation(program, name), input: (name) => gl.getAttribLocation(program, name) };
  }

  buffer(data) {
    const { gl } = this, buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
    return { buffer, count: data.length / 3 };
  }

  /** Begins a picture. @param {Float64Array} matrix of points relative to `eye` */
  begin(width, height, matrix, eye) {
    const { gl, canvas } = this;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    gl.viewport(0, 0, width, height);
    gl.clearColor(0.02, 0.03, 0.045, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    this.matrix = new Float32Array(matrix);
    this.eye = new Float32Array(eye);
  }

  use(which) {
    const { gl } = this;
    for (let k = 0; k < 5; k++) gl.disableVertexAttribArray(k); // those of the program before
    gl.useProgram(which.program);
    gl.uniformMatrix4fv(which.at('matrix'), false, this.matrix);
    gl.uniform3fv(which.at('eye'), this.eye);
  }

  input(which, name, buffer, size, stride, offset) {
    const { gl } = this, at = which.input(name);
    if (at < 0) return;
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride, offset);
  }

  /** The Earth. @param {number[]} sun unit @param {number[]} earth rotation from GCRF to the Earth, rows */
  drawEarth(sun, earth) {
    const { gl } = this;
    this.use(this.globe);
    gl.uniform3fv(this.globe.at('sun'), new Float32Array(sun));
    gl.uniformMatrix3fv(this.globe.at('earth'), true, new Float32Array(earth));
    this.input(this.globe, 'p0', this.ground.buffer, 3, 0, 0);
    gl.drawArrays(gl.TRIANGLES, 0, this.ground.count);
  }

  /** States of all bodies at both ends of a step: 13 numbers each, p0 v0 p1 v1 kind. @param {Float32Array} states */
  setBodies(states) {
    if (this.bodies) this.gl.deleteBuffer(this.bodies.buffer);
    this.bodies = this.buffer(states);
    this.bodies.count = states.length / 13;
  }

  /** @param {number} u place between the states, 0 to 1 @param {number[]} colour @param {number[]} marked */
  drawBodies(u, step, size, colour, marked) {
    const { gl, moving } = this;
    if (!this.bodies || this.bodies.count === 0) return;
    this.use(moving);
    gl.uniform1f(moving.at('u'), u);
    gl.uniform1f(moving.at('step_s'), step);
    gl.uniform1f(moving.at('size'), size);
    gl.uniform4fv(moving.at('colour'), colour);
    gl.uniform4fv(moving.at('marked'), marked);
    ['p0', 'v0', 'p1', 'v1'].forEach((name, k) => this.input(moving, name, this.bodies.buffer, 3, 52, 12 * k));
    this.input(moving, 'kind', this.bodies.buffer, 1, 52, 48);
    gl.drawArrays(gl.POINTS, 0, this.bodies.count);
  }

  /** Lines that stay. @param {Float32Array} points ends of segments */
  setCoast(points) { this.coast = this.buffer(points); }

  /** Draws the coast. @param {Float64Array} matrix of points of the Earth */
  drawCoast(matrix, colour) {
    const { gl, plain, coast } = this;
    if (!coast || coast.count === 0) return;
    this.use(plain);
    gl.uniformMatrix4fv(plain.at('matrix'), false, new Float32Array(matrix));
    gl.uniform3f(plain.at('eye'), 0, 0, 0);
    gl.uniform4fv(plain.at('colour'), colour);
    this.input(plain, 'p0', coast.buffer, 3, 0, 0);
    gl.drawArrays(gl.LINES, 0, coast.count);
  }

  /** Lines or triangles that are drawn once. @param {'lines' | 'strip' | 'triangles' | 'points'} what @param {Float32Array | number[]} points */
  draw(what, points, colour) {
    const { gl, plain } = this, data = points instanceof Float32Array ? points : new Float32Array(points);
    if (data.length === 0) return;
    this.use(plain);
    gl.uniform4fv(plain.at('colour'), colour);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.scratch);
    gl.bufferData(gl.ARRAY_BUFFER, data, gl.STREAM_DRAW);
    this.input(plain, 'p0', this.scratch, 3, 0, 0);
    if (colour[3] < 1) {
      gl.enable(gl.BLEND);
      gl.depthMask(false);
    }
    gl.drawArrays({ lines: gl.LINES, strip: gl.LINE_STRIP, triangles: gl.TRIANGLES, points: gl.POINTS }[what], 0, data.length / 3);
    gl.disable(gl.BLEND);
    gl.depthMask(true);
  }
}
