// An object's shape near the camera: its facets in the light of the Sun, with the attitude of the run.
import { getNumbers } from './api.js';
import { across, add, cross, EARTH_M, length, perspective, product, scaled, turnedBack, unit } from './space_math.js';

/** Numbers of the answers (view/space_shapes.h). */
const HEAD = 2, TRIANGLE = 13, POSE_HEAD = 6, JOINT = 12;
/** Numbers of a vertex: place, normal, colour. */
const VERTEX = 9;
/** Distance in radii of the body from which on it is a point. */
const FAR_RADII = 800;

const LIT = `#version 300 es
uniform mat4 matrix; uniform mat3 turn; uniform vec3 offset;
in vec3 p, n, c; out vec3 normal, colour;
void main() { normal = turn * n; colour = c; gl_Position = matrix * vec4(turn * p + offset, 1.0); }`;
const SURFACE = `#version 300 es
precision highp float;
uniform vec3 sun; uniform float sunlit;
in vec3 normal, colour; out vec4 pixel;
void main() {
  float light = 0.05 + 1.1 * sunlit * max(dot(normalize(normal), sun), 0.0); // a little, so that the dark side is seen
  pixel = vec4(pow(min(colour * light, vec3(1.0)), vec3(1.0 / 2.2)), 1.0);
}`;

/**
 * Vertices in the frame of the body.
 * @param {Float64Array} shape answer of space/shape @param {Float64Array} pose answer of space/pose
 */
export function bodyVertices(shape, pose) {
  const count = shape[1], out = new Float32Array(3 * VERTEX * count);
  for (let k = 0, to = 0; k < count; k++) {
    const from = HEAD + TRIANGLE * k, joint = shape[from], corners = [];
    for (let i = 0; i < 3; i++) {
      const corner = [...shape.subarray(from + 4 + 3 * i, from + 7 + 3 * i)];
      if (joint < 0) {
        corners.push(corner);
      } else {
        const at = POSE_HEAD + JOINT * joint;
        corners.push([0, 1, 2].map((row) => pose[at + 9 + row] + pose[at + 3 * row] * corner[0] + pose[at + 3 * row + 1] * corner[1] + pose[at + 3 * row + 2] * corner[2]));
      }
    }
    const [a, b, c] = corners, normal = unit(cross(add(b, a, -1), add(c, a, -1)));
    for (const corner of corners) {
      out.set(corner, to);
      out.set(normal, to + 3);
      out.set(shape.subarray(from + 1, from + 4), to + 6);
      to += VERTEX;
    }
  }
  return out;
}

export class ShapePass {
  /**
   * @param {import('./space_gl.js').SpacePainter} painter
   * @param {{ object: number, radius_m: number }[]} shapes @param {() => void} changed called when there is more to draw
   */
  constructor(painter, shapes, changed) {
    this.painter = painter;
    this.changed = changed;
    /** @type {Map<number, { radius: number, shape: Float64Array | null, pose: Float64Array | null, poseAt: number, sensor: number, buffer: any, asked: boolean, problem: string, problemAt: number }>} */
    this.shapes = new Map(shapes.map((one) => [one.object, { radius: one.radius_m, shape: null, pose: null, poseAt: NaN, sensor: -1, buffer: null, asked: false, problem: '', problemAt: NaN }]));
    this.program = this.shapes.size ? painter.program(LIT, SURFACE) : null;
  }

  /** Radius of an object with a shape, Earth radii; 0: it has none. @param {number} object */
  radiusOf(object) {
    const one = this.shapes.get(object);
    return one ? one.radius / EARTH_M : 0;
  }

  /** Asks for what is needed at a time; one request of an object at a time. */
  async ask(object, one, sensor, time) {
    if (one.asked || (one.problem && one.problemAt === time && one.sensor === sensor)) return;
    one.asked = true;
    try {
      one.shape = one.shape || await getNumbers('space/shape', { object });
      one.pose = await getNumbers('space/pose', { sensor, object, from: time });
      one.poseAt = time;
      one.problem = '';
      if (one.shape[0] > 0 || !one.buffer) { // joints move
        if (one.buffer) this.painter.gl.deleteBuffer(one.buffer.buffer);
        one.buffer = this.painter.buffer(bodyVertices(one.shape, one.pose));
      }
    } catch (error) {
      one.problem = error.message; // said in the line below the picture; asked for again at another time
      one.problemAt = time;
      one.poseAt = NaN;
    }
    one.sensor = sensor;
    one.asked = false;
    this.changed();
  }

  /**
   * Draws an object if the camera is near. @returns {{ sunlit: number, recorded: boolean, current: boolean, ends: { sun: number[], eye: number[] } } | null}
   * current: the attitude is that of the time; ends: of the lines to Sun and observer, Earth radii from the body; null: it is a point, or not there yet
   * @param {number} object @param {{ sensor: number, time: number, sun: number[], place: number[], observer: number[] | null }} scene
   * @param {{ eye: number[], field: number, aspect: number, turned: Float64Array }} camera
   */
  draw(object, scene, camera) {
    const one = this.shapes.get(object), away = scaled(add(scene.place, camera.eye, -1), EARTH_M), range = length(away);
    if (!one || !(range < FAR_RADII * one.radius / camera.field)) return null;
    if (one.poseAt !== scene.time || one.sensor !== scene.sensor) this.ask(object, one, scene.sensor, scene.time);
    if (!one.buffer) return null;
    const { gl } = this.painter, { program } = this, reach = 5 * one.radius;
    const near = Math.max(0.01 * one.radius, range - reach, 1e-3 * range);
    const matrix = product(perspective(camera.field, camera.aspect, near, range + reach), camera.turned);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    this.painter.matrix = new Float32Array(matrix);
    this.painter.eye = new Float32Array(scaled(away, -1)); // lines below are relative to the body, m
    this.painter.use(program);
    gl.uniform3fv(program.at('offset'), new Float32Array(away));
    gl.uniform3fv(program.at('sun'), new Float32Array(scene.sun));
    gl.uniform1f(program.at('sunlit'), one.pose[4]);
    const q = one.pose.subarray(0, 4);
    gl.uniformMatrix3fv(program.at('turn'), false, new Float32Array([[1, 0, 0], [0, 1, 0], [0, 0, 1]].flatMap((axis) => turnedBack(q, axis))));
    ['p', 'n', 'c'].forEach((name, k) => this.painter.input(program, name, one.buffer.buffer, 3, 4 * VERTEX, 12 * k));
    gl.enable(gl.CULL_FACE); // a facet is seen from its outside only
    gl.drawArrays(gl.TRIANGLES, 0, 3 * one.shape[1]);
    gl.disable(gl.CULL_FACE);
    return { sunlit: one.pose[4], recorded: one.pose[5] === 1, current: one.poseAt === scene.time && one.sensor === scene.sensor, ends: this.drawDirections(one, scene) };
  }

  /** The beam of the Sun that lights it, and the line to the observer. Lengths in m from the body. */
  drawDirections(one, { sun, place, observer }) {
    const r = one.radius, x = across(sun), y = cross(sun, x), rays = [];
    for (let k = 0; k < 12; k++) {
      const turn = Math.PI * k / 6, side = add(scaled(x, 0.8 * r * Math.cos(turn)), y, 0.8 * r * Math.sin(turn));
      rays.push(...add(side, sun, 2.6 * r), ...add(side, sun, 1.1 * r));
    }
    if (one.pose[4] > 0) this.painter.draw('lines', rays, [1, 0.86, 0.35, 0.25 + 0.5 * one.pose[4]]);
    this.painter.draw('lines', [...scaled(sun, 1.1 * r), ...scaled(sun, 2.6 * r)], [1, 0.86, 0.35, one.pose[4] > 0 ? 1 : 0.35]);
    const eye = observer ? unit(add(observer, place, -1)) : null;
    if (eye) this.painter.draw('lines', [...scaled(eye, 1.1 * r), ...scaled(eye, 2.6 * r)], [0.34, 0.71, 0.91, 1]);
    return { sun: scaled(sun, 2.6 * r / EARTH_M), eye: eye && scaled(eye, 2.6 * r / EARTH_M) };
  }
}
