// recording - reads the block of data: the scene, and the frames whose lines are complete. The
// format stands in src/record/html.h, the code of integers in src/record/integer_code.h.

const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
const VALUES = new Uint8Array(128);
[...DIGITS].forEach((digit, value) => { VALUES[digit.charCodeAt(0)] = value; });

// `count` signed integers of `width` bits. Of `word` the `left` lowest bits are not read yet.
function decodeIntegers(text, count, width) {
  const integers = new Int32Array(count);
  let next = 0, word = 0, left = 0;
  const fill = bits => {
    for (; left < bits; left += 6) word = word << 6 | VALUES[text.charCodeAt(next++)];
  };
  const read = bits => {   // at most 16
    fill(bits);
    left -= bits;
    return word >>> left & (1 << bits) - 1;
  };
  const readOnes = () => {
    let ones = 0;
    for (;;) {
      fill(1);
      const run = Math.min(Math.clz32(~(word << 32 - left)), left);
      ones += run;
      left -= run;
      if (left) break;
    }
    left--;
    return ones;
  };
  for (let i = 0; i < count;) {
    const k = read(6), end = Math.min(i + 64, count);
    for (; i < end; i++) {
      const high = k < width ? readOnes() * 2 ** k : 0;
      const z = high + (k > 16 ? read(k - 16) * 65536 + read(16) : read(k));
      integers[i] = z % 2 ? -(z + 1) / 2 : z / 2;
    }
  }
  return integers;
}

function decodeDifferences(text, count, stride) {
  const values = decodeIntegers(text, count, 32);
  for (let i = stride; i < count; i++) values[i] += values[i - stride];
  return values;
}

const decodeFloats = (text, count) => new Float32Array(decodeDifferences(text, count, 1).buffer);

// The components of a frame; `last` and `before` are those of the two frames before.
function decodeFrame(text, n, width, last, before, out) {
  const mask = 2 ** width - 1, differences = decodeIntegers(text, out.length, width);
  let residual = 0;
  for (let i = 0; i < out.length; i++) {
    residual = (i % n ? residual : 0) + differences[i] & mask;
    out[i] = residual + 2 * last[i] - before[i] & mask;
  }
}

// Frame k of an array of `components` numbers a particle, for all k
function decodeFrames(frames, key, Type, components, n) {
  const decoded = [], zeros = new Type(components * n);
  for (const frame of frames) {
    const k = decoded.length, last = decoded[k - 1] || zeros, before = decoded[k - 2] || last;
    decoded.push(new Type(components * n));
    decodeFrame(frame[key], n, 8 * Type.BYTES_PER_ELEMENT, last, before, decoded[k]);
    frame[key] = null;
  }
  return decoded;
}

// A line that was cut off is no JSON, or is "".
function parseLines(text) {
  const lines = [];
  for (const line of text.trim().split("\n")) {
    try {
      lines.push(JSON.parse(line));
    } catch {
      break;
    }
  }
  return lines;
}

// {name, counts and constants of the scene, frames, x: coordinates of each frame, speed: of each}
function readRecording(text) {
  const [scene, ...frames] = parseLines(text);
  if (!frames.length) throw new Error("This page has no frame yet.");
  const n = scene.particles, ns = scene.springs;
  return {
    ...scene, total: scene.frames, frames,
    x: decodeFrames(frames, "x", Uint16Array, 3, n),
    speed: decodeFrames(frames, "speed", Uint8Array, 1, n),
    mass: decodeFloats(scene.mass, n),
    pinned: decodeDifferences(scene.pinned, n, 1),
    ij: decodeDifferences(scene.ij, 2 * ns, 2),
    k: decodeFloats(scene.k, ns),
    rest: decodeFloats(scene.rest, ns),
    faces: decodeDifferences(scene.faces, 3 * scene.triangles, 3),
  };
}

// Positions of frame k as x0 y0 z0 x1 ... in units of `scale` from `centre`. In halves, as
// high - low might overflow.
function positionsOf(recording, k, centre, scale, out) {
  const {low, high} = recording.frames[k], q = recording.x[k], n = recording.particles;
  for (let c = 0; c < 3; c++) {
    const start = (low[c] / 2 - centre[c] / 2) / scale * 2;
    const size = (high[c] / 2 - low[c] / 2) / scale / 65535 * 2;
    for (let i = 0; i < n; i++) out[3 * i + c] = start + size * q[c * n + i];
  }
}
