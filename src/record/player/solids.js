// solids - surfaces of colliders as triangles: {position, normal}, three numbers for each corner.

const AROUND = 48, ARC = 12;   // strips around an axis and along a quarter of a circle

// The rotation of v by the vector w: Rodrigues' formula
function rotate(w, v) {
  const angle = Math.hypot(...w), u = unit(w);
  return combine([Math.cos(angle), v], [Math.sin(angle), cross(u, v)],
                 [(1 - Math.cos(angle)) * dot(u, v), u]);
}

// Right-handed axes, the last one along `direction`
function axesAlong(direction) {
  const w = unit(direction), u = unit(cross(Math.abs(w[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0], w));
  return [u, cross(w, u), w];
}

// A quarter of a circle around (0, z) from the angle `from`, as [r, z, normal r, normal z]
function arc(radius, z, from) {
  return Array.from({length: ARC + 1}, (_, i) => {
    const angle = from + Math.PI / 2 * i / ARC, [c, s] = [Math.cos(angle), Math.sin(angle)];
    return [radius * c, z + radius * s, c, s];
  });
}

// Corners of two triangles for a strip between two points of a profile, or two corners of a square
const SQUARE = [[0, 0], [1, 0], [1, 1], [0, 0], [1, 1], [0, 1]];

// The surface that a profile sweeps around the third axis
function revolve(profile) {
  const corners = [];
  for (let p = 0; p + 1 < profile.length; p++)
    for (let k = 0; k < AROUND; k++)
      for (const [i, j] of SQUARE) {
        const [r, z, nr, nz] = profile[p + j], angle = 2 * Math.PI * (k + i) / AROUND;
        const c = Math.cos(angle), s = Math.sin(angle);
        corners.push({position: [r * c, r * s, z], normal: [nr * c, nr * s, nz]});
      }
  return corners;
}

function box([a, b, c]) {
  const corners = [], half = [a / 2, b / 2, c / 2];
  for (let axis = 0; axis < 3; axis++)
    for (const side of [-1, 1])
      for (const [i, j] of SQUARE) {
        const position = [], normal = [0, 0, 0];
        position[axis] = side * half[axis];
        position[(axis + 1) % 3] = side * (2 * i - 1) * half[(axis + 1) % 3];
        position[(axis + 2) % 3] = (2 * j - 1) * half[(axis + 2) % 3];
        normal[axis] = side;
        corners.push({position, normal});
      }
  return corners;
}

// Triangles through heights on a grid, without the surface beyond it; normals of each triangle
function heightfield([nx, ny], [dx, dy], heights) {
  const corners = [], at = (i, j) => [i * dx, j * dy, heights[i * ny + j]];
  for (let i = 0; i + 1 < nx; i++)
    for (let j = 0; j + 1 < ny; j++)
      for (const t of [[at(i, j), at(i + 1, j), at(i + 1, j + 1)],
                       [at(i, j), at(i + 1, j + 1), at(i, j + 1)]]) {
        const [a, b] = [1, 2].map(k => t[k].map((x, c) => x - t[0][c]));
        const normal = unit(cross(a, b));
        corners.push(...t.map(position => ({position, normal})));
      }
  return corners;
}

const PROFILES = {
  sphere: (radius) => [...arc(radius, 0, -Math.PI / 2), ...arc(radius, 0, 0)],
  capsule: (radius, half) => [...arc(radius, -half, -Math.PI / 2), ...arc(radius, half, 0)],
  cylinder: (r, half) => [[0, -half, 0, -1], [r, -half, 0, -1], [r, -half, 1, 0], [r, half, 1, 0],
                          [r, half, 0, 1], [0, half, 0, 1]],
};

// collider: as in scene files. Positions are in units of `scale` from `centre`; normals point to
// the side of the particles.
function makeSolid(collider, centre, scale) {
  const {type, from, to, radius, size, rotation, inside, origin} = collider;
  const along = from ? to.map((c, i) => c - from[i]) : [0, 0, 1];
  const middle = collider.center || origin || from.map((c, i) => c + along[i] / 2);
  const axes = rotation || origin ? [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(
    e => rotate(rotation || [0, 0, 0], e))
    : axesAlong(along);
  const corners = size ? box(size) : type === "sdf" ? []
    : type === "heightfield" ? heightfield(collider.n, collider.spacing, collider.heights)
    : revolve(PROFILES[type](radius, from ? Math.hypot(...along) / 2 : 0));
  const place = v => combine([v[0], axes[0]], [v[1], axes[1]], [v[2], axes[2]]);
  return {
    inside,
    middle: middle.map((m, i) => (m - centre[i]) / scale),
    position: corners.flatMap(c => place(c.position).map((p, i) => (
      (p + middle[i] - centre[i]) / scale))),
    normal: corners.flatMap(c => place(c.normal).map(n => (inside ? -n : n))),
  };
}

// {position, normal} of a solid in a pose: the place of its middle and a rotation vector, 6 numbers
function placeSolid({position, normal, middle}, pose, centre, scale) {
  const to = pose.slice(0, 3).map((x, i) => (x - centre[i]) / scale);
  const axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(e => rotate(pose.slice(3), e));
  const turn = (from, origin, target) => {
    const out = new Float32Array(from.length);
    for (let i = 0; i < from.length; i += 3)
      for (let c = 0; c < 3; c++) {
        out[i + c] = target[c];
        for (let k = 0; k < 3; k++) out[i + c] += (from[i + k] - origin[k]) * axes[k][c];
      }
    return out;
  };
  return {position: turn(position, middle, to), normal: turn(normal, [0, 0, 0], [0, 0, 0])};
}
