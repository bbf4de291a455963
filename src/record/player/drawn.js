// drawn - which springs and particles are drawn besides the faces, and how large.
//
// A spring belongs to a surface if both its ends are corners of faces that hang together. Particles
// inside a closed surface, as in a block, are hidden with their springs.

class Groups {
  constructor(n) { this.parent = Int32Array.from({length: n}, (_, i) => i); }

  find(i) {
    const parent = this.parent;
    while (parent[i] !== i) i = parent[i] = parent[parent[i]];
    return i;
  }

  join(i, j) { this.parent[this.find(i)] = this.find(j); }
}

// Solid angle of a triangle as seen from p, over 4 pi, signed (Van Oosterom and Strackee 1983)
function solidAngle(p, x, a, b, c) {
  const [u, v, w] = [a, b, c].map(i => [0, 1, 2].map(d => x[3 * i + d] - p[d]));
  const [lu, lv, lw] = [u, v, w].map(e => Math.hypot(...e));
  return Math.atan2(dot(u, cross(v, w)), lu * lv * lw + dot(u, v) * lw + dot(v, w) * lu
    + dot(w, u) * lv) / (2 * Math.PI);
}

// The winding number of the faces around particle i is 1 or -1 inside a closed surface.
function isEnclosed(i, faces, x) {
  const p = x.subarray(3 * i, 3 * i + 3);
  let winding = 0;
  for (let f = 0; f < faces.length; f += 3)
    winding += solidAngle(p, x, faces[f], faces[f + 1], faces[f + 2]);
  return Math.abs(winding) > 0.5;
}

// 1: inside a closed surface. One particle of each group that springs tie to a surface is examined.
function hiddenParticles({particles: n, ij, faces}, surfaces, onSurface, x) {
  const groups = new Groups(n), hidden = new Uint8Array(n), known = new Map();
  for (let s = 0; s < ij.length; s += 2)
    if (!onSurface[ij[s]] && !onSurface[ij[s + 1]]) groups.join(ij[s], ij[s + 1]);
  for (let s = 0; s < ij.length; s += 2) {
    if (onSurface[ij[s]] === onSurface[ij[s + 1]]) continue;
    const group = groups.find(onSurface[ij[s]] ? ij[s + 1] : ij[s]);
    if (!known.has(group)) known.set(group, isEnclosed(group, faces, x));
  }
  for (let i = 0; i < n; i++) hidden[i] = !onSurface[i] && known.get(groups.find(i)) ? 1 : 0;
  return hidden;
}

function median(values) {
  const sorted = Float32Array.from(values).sort();
  return sorted.length ? sorted[sorted.length - 1 >> 1] : 0;
}

function distance(x, i, j) {
  return Math.hypot(x[3 * i] - x[3 * j], x[3 * i + 1] - x[3 * j + 1], x[3 * i + 2] - x[3 * j + 2]);
}

// Joints of two springs are as thick as these; other particles by their mass.
function radiiOf({mass, particles: n}, {springs, spheres}, thickness) {
  const joined = new Uint32Array(n), typical = median(spheres.map(i => mass[i]));
  for (const end of springs) joined[end]++;
  const size = i => Math.min(Math.max(Math.cbrt(mass[i] / typical) || 1, 0.6), 3);
  return spheres.map(i => thickness * size(i) * (joined[i] === 2 ? 1 : 2));
}

// {springs: their ends, spheres: particles, radii: theirs, thickness: radius of the springs}
// x: the positions of the first frame, in units of the half diagonal of the box
function chooseDrawn(recording, x) {
  const {particles: n, ij, faces} = recording;
  const surfaces = new Groups(n), onSurface = new Uint8Array(n);
  for (let f = 0; f < faces.length; f++) {
    onSurface[faces[f]] = 1;
    surfaces.join(faces[f], faces[f - f % 3]);
  }
  const hidden = hiddenParticles(recording, surfaces, onSurface, x);
  const spheres = [], springs = [], lengths = [];
  for (let i = 0; i < n; i++) if (!onSurface[i] && !hidden[i]) spheres.push(i);
  for (let s = 0; s < ij.length; s += 2) {
    const i = ij[s], j = ij[s + 1];
    const isInside = onSurface[i] && onSurface[j] && surfaces.find(i) === surfaces.find(j);
    if (isInside || hidden[i] || hidden[j]) continue;
    springs.push(i, j);
    lengths.push(distance(x, i, j));
  }
  const thickness = springs.length ? Math.min(Math.max(median(lengths) / 8, 0.005), 0.016) : 0.03;
  const drawn = {springs, spheres, thickness};
  return {...drawn, radii: radiiOf(recording, drawn, thickness)};
}
