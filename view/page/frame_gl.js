// Draws 16-bit pixels with a stretch: by WebGL2, or on a 2D canvas where there is none.

/**
 * What is drawn where. `origin`: place on the canvas of the outer corner of pixel 0, 0; `scale`: pixels of
 * the screen per pixel of the image; `soft`: digital numbers, 0 for a linear stretch.
 * @typedef {{ originX: number, originY: number, scale: number, black: number, white: number,
 *   soft: number, invert: boolean }} Drawing
 */

/**
 * Place on a canvas of the outer edge of an image's pixel 0. Where a pixel of the image covers one of the screen or more, it
 * is a whole pixel: else all edges of an image could lie on middles of the screen's pixels, and be drawn half a pixel off.
 * @param {number} side of the canvas @param {number} centre place on the image at its middle @param {number} scale pixels of the screen per pixel of the image
 */
export function originOf(side, centre, scale) {
  const origin = side / 2 - (centre + 0.5) * scale;
  return scale >= 1 ? Math.round(origin) : origin;
}

/** Where the corner of the frame is on a canvas, and pixels of the canvas per pixel of the frame.
 * @param {{x: number, y: number, scale: number}} view @param {{width: number, height: number}} canvas @param {number} n binning of the image @param {number} ratio pixels of the canvas per px of the page */
export function placeOf(view, { width, height }, n, ratio) {
  const scale = view.scale * ratio;
  return { x: originOf(width, (view.x + 0.5) / n - 0.5, scale * n), y: originOf(height, (view.y + 0.5) / n - 0.5, scale * n), scale };
}

const VERTEX = `#version 300 es
void main() { // one triangle over the whole canvas
  vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
  gl_Position = vec4(corner, 0.0, 1.0);
}`;

const FRAGMENT = `#version 300 es
precision highp float; precision highp int; precision highp usampler2D;
uniform usampler2D image;
uniform vec2 size, canvas, origin;
uniform float scale, black, white, soft;
uniform bool invert;
out vec4 colour;
void main() {
  vec2 screen = vec2(gl_FragCoord.x, canvas.y - gl_FragCoord.y);
  vec2 place = (screen - origin) / scale; // pixel i covers i to i + 1
  if (any(lessThan(place, vec2(0.0))) || any(greaterThanEqual(place, size))) discard;
  float value;
  if (scale >= 1.0) {
    value = float(texelFetch(image, ivec2(place), 0).r);
  } else { // mean of the pixels below this one
    float reach = 0.5 / scale;
    ivec2 a = max(ivec2(floor(place - reach + 0.5)), ivec2(0));
    ivec2 b = max(min(ivec2(floor(place + reach + 0.5)), ivec2(size)), a + 1);
    int skip = max(1, (b.x - a.x) / 8);
    float sum = 0.0, count = 0.0;
    for (int y = a.y; y < b.y; y += skip) {
      for (int x = a.x; x < b.x; x += skip) {
        sum += float(texelFetch(image, ivec2(x, y), 0).r);
        count += 1.0;
      }
    }
    value = sum / count;
  }
  float grey = (value - black) / (white - black);
  if (soft > 0.0) grey = asinh((value - black) / soft) / asinh((white - black) / soft);
  grey = clamp(grey, 0.0, 1.0);
  colour = vec4(vec3(invert ? 1.0 - grey : grey), 1.0);
}`;

/** Grey level of a value, 0 to 1: the same as in the shader. @param {Drawing} d */
export function greyOf(value, d) {
  const grey = d.soft > 0
    ? Math.asinh((value - d.black) / d.soft) / Math.asinh((d.white - d.black) / d.soft)
    : (value - d.black) / (d.white - d.black);
  const clamped = Math.min(1, Math.max(0, grey));
  return d.invert ? 1 - clamped : clamped;
}

function compile(gl, kind, source) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, source);
  gl.compileShader(shader);
  return shader;
}

class WebglPainter {
  constructor(canvas, gl) {
    this.canvas = canvas;
    this.gl = gl;
    this.most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    this.prepare();
  }

  prepare() {
    const gl = this.gl, program = gl.createProgram();
    gl.attachShader(program, compile(gl, gl.VERTEX_SHADER, VERTEX));
    gl.attachShader(program, compile(gl, gl.FRAGMENT_SHADER, FRAGMENT));
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      throw new Error(`the shader was refused: ${gl.getProgramInfoLog(program)}`);
    }
    gl.useProgram(program);
    this.places = {};
    for (const name of ['size', 'canvas', 'origin', 'scale', 'black', 'white', 'soft', 'invert']) {
      this.places[name] = gl.getUniformLocation(program, name);
    }
    gl.bindVertexArray(gl.createVertexArray());
    this.textures = [this.makeTexture(), this.makeTexture()]; // of the whole frame, and of a part of it
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 2);
    this.held = [null, null];
  }

  makeTexture() {
    const gl = this.gl, texture = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, texture);
    for (const [name, value] of [[gl.TEXTURE_MIN_FILTER, gl.NEAREST], [gl.TEXTURE_MAG_FILTER, gl.NEAREST],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]]) {
      gl.texParameteri(gl.TEXTURE_2D, name, value);
    }
    return texture;
  }

  /** @param {Pixels | null} image @param {Drawing} d @param {Pixels | null} [part] drawn over it @param {Drawing | null} [partDrawing] */
  draw(image, d, part = null, partDrawing = null) {
    const gl = this.gl, canvas = this.canvas;
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (image) this.paint(0, image, d);
    if (part) this.paint(1, part, partDrawing);
  }

  paint(place, image, d) {
    const gl = this.gl, canvas = this.canvas;
    gl.bindTexture(gl.TEXTURE_2D, this.textures[place]);
    if (this.held[place] !== image) {
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.R16UI, image.width, image.height, 0, gl.RED_INTEGER, gl.UNSIGNED_SHORT, image.data);
      this.held[place] = image;
    }
    const at = this.places;
    gl.uniform2f(at.size, image.width, image.height);
    gl.uniform2f(at.canvas, canvas.width, canvas.height);
    gl.uniform2f(at.origin, d.originX, d.originY);
    for (const name of ['scale', 'black', 'white', 'soft']) gl.uniform1f(at[name], d[name]);
    gl.uniform1i(at.invert, d.invert ? 1 : 0);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  fits(image) { return image.width <= this.most && image.height <= this.most; }

  /** The pixels as the graphics processor holds them. @param {number} [place] 0: the whole frame; 1: the part of it */
  readBack(place = 0) {
    const gl = this.gl, image = this.held[place];
    if (!image) return null;
    const buffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.textures[place], 0);
    const all = new Uint32Array(4 * image.width * image.height);
    gl.readPixels(0, 0, image.width, image.height, gl.RGBA_INTEGER, gl.UNSIGNED_INT, all);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(buffer);
    return Uint16Array.from({ length: image.width * image.height }, (_, i) => all[4 * i]);
  }
}

/** @typedef {{width: number, height: number, data: Uint16Array}} Pixels */

/** Ranges of the image's pixels that lie below each pixel of the screen along an axis; empty outside the image. */
function rangesOf(count, origin, scale, size) {
  const from = new Int32Array(count), to = new Int32Array(count), reach = scale >= 1 ? 0 : 0.5 / scale;
  for (let k = 0; k < count; k++) {
    const place = (k + 0.5 - origin) / scale;
    if (!(place >= 0 && place < size)) continue;
    from[k] = reach ? Math.max(0, Math.floor(place - reach + 0.5)) : Math.floor(place);
    to[k] = Math.max(from[k] + 1, reach ? Math.min(size, Math.floor(place + reach + 0.5)) : 0);
  }
  return { from, to };
}

/** What is known of the columns of a picture: those that show the image, and which of its pixels. `several`: columns that show the mean of more than one. */
function spanOf(count, origin, scale, size) {
  const { from, to } = rangesOf(count, origin, scale, size), several = [];
  let left = count, right = 0, gap = false;
  for (let x = 0; x < count; x++) {
    if (to[x] === 0) continue;
    left = Math.min(left, x);
    right = x + 1;
    if (to[x] > from[x] + 1) several.push(x);
    gap = gap || from[x] !== from[left] + x - left;
  }
  return { left, right, from, to, several, gap };
}

/** Pixels of the image along a side of one of the screen up to which all of them are in the mean. */
const MEAN_MOST = 6;

/** Rows of the picture whose pixels show one of the image each. One function with all loops: the browser compiles it well while the
 * first picture is drawn, not after thousands of short calls. @param {Uint32Array} words @param {number} pitch words of a row */
function pickRows(words, pitch, { data, width }, { left, right, from, gap }, rows, colours) {
  for (let y = 0; y < rows.to.length; y++) {
    if (rows.to[y] !== rows.from[y] + 1) continue;
    const at = y * pitch, row = rows.from[y] * width, first = row + from[left] - left;
    if (gap) for (let x = left; x < right; x++) words[at + x] = colours[data[row + from[x]]];
    else for (let x = left; x < right; x++) words[at + x] = colours[data[first + x]];
  }
}

/** Rows of the picture whose pixels show the mean of a few of the image: from sums up to each column. @param {Uint32Array} words @param {number} pitch words of a row */
function meanRows(words, pitch, { data, width }, { left, right, from, to }, rows, colours) {
  const sums = new Uint32Array(width + 1), first = from[left], end = to[right - 1];
  for (let y = 0; y < rows.to.length; y++) {
    const a = rows.from[y] * width, n = rows.to[y] - rows.from[y], b = a + width, at = y * pitch;
    if (n <= 0) continue;
    let sum = 0;
    if (n === 1) for (let i = first; i < end; i++) { sum = (sum + data[a + i]) >>> 0; sums[i + 1] = sum; }
    else if (n === 2) for (let i = first; i < end; i++) { sum = (sum + data[a + i] + data[b + i]) >>> 0; sums[i + 1] = sum; }
    else {
      for (let i = first; i < end; i++) {
        for (let j = 0; j < n; j++) sum = (sum + data[a + j * width + i]) >>> 0;
        sums[i + 1] = sum;
      }
    }
    for (let x = left; x < right; x++) { // rounded; differences are right also where the sums wrap
      const count = n * (to[x] - from[x]), part = (sums[to[x]] - sums[from[x]]) | 0;
      words[at + x] = colours[((2 * part + count) / (2 * count)) | 0];
    }
  }
}

/** Mean of pixels of the image below one of the screen, of at most some 4 x 4 of them. */
function meanOf({ data, width }, ax, bx, ay, by) {
  const skipX = Math.max(1, (bx - ax) >> 2), skipY = Math.max(1, (by - ay) >> 2);
  let sum = 0, count = 0;
  for (let j = ay; j < by; j += skipY) {
    for (let i = ax; i < bx; i += skipX) { sum += data[j * width + i]; count++; }
  }
  return Math.round(sum / count);
}

export class CanvasPainter {
  /** @param {any} canvas @param {any} [context] its own one */
  constructor(canvas, context = canvas.getContext('2d', { willReadFrequently: true })) { // in memory: it is filled from there
    this.canvas = canvas;
    this.context = context;
    this.plain = true;
    this.background = ''; // colour beside the image, where marks are drawn on the same canvas; '': nothing
    this.filled = ''; // where the words have the image
    this.held = [null, null];
    this.out = null;
    this.greys = { key: '', colours: new Uint32Array(65536) };
  }

  fits() { return true; }

  /** Colours of all values, as words of the picture. @param {Drawing} d */
  coloursOf(d) {
    const key = [d.black, d.white, d.soft, d.invert].join();
    if (this.greys.key !== key) {
      const { colours } = this.greys, of = (value) => 0xff000000 | Math.round(255 * greyOf(value, d)) * 0x010101;
      // all values below black, and all from white on, have the same colour
      const low = Math.min(65536, Math.max(0, Math.ceil(d.black))), high = Math.min(65536, Math.max(low, Math.ceil(d.white)));
      this.greys.key = key;
      colours.fill(of(d.black), 0, low);
      for (let value = low; value < high; value++) colours[value] = of(value);
      colours.fill(of(d.white), high);
    }
    return this.greys.colours;
  }

  /** @param {Pixels | null} image @param {Drawing} d @param {Pixels | null} [part] drawn over it @param {Drawing | null} [partDrawing] */
  draw(image, d, part = null, partDrawing = null) {
    const { width, height } = this.canvas;
    this.held = [image, part];
    if (!image || width === 0 || height === 0) {
      this.context.clearRect(0, 0, width, height);
      return;
    }
    if (!this.out || this.out.width !== width || this.out.height !== height) {
      this.out = this.context.createImageData(width, height);
      this.words = new Uint32Array(this.out.data.buffer);
    }
    const span = spanOf(width, d.originX, d.scale, image.width), rows = rangesOf(height, d.originY, d.scale, image.height);
    const top = rows.to.findIndex((to) => to > 0), bottom = rows.to.findLastIndex((to) => to > 0) + 1, where = [span.left, span.right, top, bottom].join();
    const here = where === this.filled && !part;
    if (!here) this.words.fill(0);
    this.filled = part ? '' : where;
    this.paint(image, d, span, rows);
    if (part) this.paint(part, partDrawing, spanOf(width, partDrawing.originX, partDrawing.scale, part.width), rangesOf(height, partDrawing.originY, partDrawing.scale, part.height));
    if (this.background && span.left < span.right && top >= 0) {
      this.context.putImageData(this.out, 0, 0, span.left, top, span.right - span.left, bottom - top);
      this.context.fillStyle = this.background;
      for (const [x0, y0, x1, y1] of [[0, 0, width, top], [0, bottom, width, height], [0, top, span.left, bottom], [span.right, top, width, bottom]]) {
        if (x1 > x0 && y1 > y0) this.context.fillRect(x0, y0, x1 - x0, y1 - y0);
      }
    } else if (here) this.context.putImageData(this.out, 0, 0, span.left, top, Math.max(0, span.right - span.left), bottom - top);
    else this.context.putImageData(this.out, 0, 0);
  }

  paint(image, d, span, rows) {
    const { width, height } = this.canvas, colours = this.coloursOf(d), { from, to } = span;
    const few = 4 * span.several.length < span.right - span.left;
    if (few && span.left < span.right) pickRows(this.words, width, image, span, rows, colours);
    if (!few && 1 / d.scale < MEAN_MOST) {
      meanRows(this.words, width, image, span, rows, colours);
      return;
    }
    for (let y = 0; y < height && span.left < span.right; y++) {
      const ay = rows.from[y], by = rows.to[y], at = y * width;
      if (by === 0) continue;
      if (by === ay + 1 && few) {
        for (const x of span.several) this.words[at + x] = colours[meanOf(image, from[x], to[x], ay, by)];
      } else {
        for (let x = span.left; x < span.right; x++) this.words[at + x] = colours[meanOf(image, from[x], to[x], ay, by)];
      }
    }
  }

  /** @param {number} [place] 0: the whole frame; 1: the part of it */
  readBack(place = 0) { return this.held[place] ? this.held[place].data : null; }
}

/** True if WebGL is computed by the processor: filling a 2D canvas takes less time then. */
function isSoftware() {
  const gl = document.createElement('canvas').getContext('webgl2'), more = gl && gl.getExtension('WEBGL_debug_renderer_info');
  const name = more ? String(gl.getParameter(more.UNMASKED_RENDERER_WEBGL)) : '';
  const lose = gl && gl.getExtension('WEBGL_lose_context');
  if (lose) lose.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

/** A painter for a canvas. @param {HTMLCanvasElement} canvas @param {boolean} plain without WebGL @param {boolean} [forced] with it, also where it is software */
export function makePainter(canvas, plain, forced = false) {
  const gl = plain || (!forced && isSoftware()) ? null : canvas.getContext('webgl2', { antialias: false, alpha: true, premultipliedAlpha: true });
  if (!gl) return new CanvasPainter(canvas);
  const painter = new WebglPainter(canvas, gl);
  canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
  canvas.addEventListener('webglcontextrestored', () => {
    painter.prepare();
    canvas.dispatchEvent(new Event('redraw'));
  });
  return painter;
}
