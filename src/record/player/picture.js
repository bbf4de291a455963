// picture - draws a state by WebGL 2: faces, springs as tubes, particles as spheres, marks of
// pinned particles, colliders as solids, and planes as grids.

// From small to large values, light enough for shading and of rising lightness (as viridis)
const RAMP = [[0.36, 0.46, 0.76], [0.2, 0.6, 0.68], [0.24, 0.74, 0.57], [0.64, 0.86, 0.36],
              [0.99, 0.88, 0.2]];

const COMMON = `#version 300 es
precision highp float;
uniform mat4 view, projection;
uniform float height;
`;
const SHADE = `
in float shade;
out vec4 result;
const vec3 ramp[${RAMP.length}] = vec3[](${RAMP.map(c => `vec3(${c})`)});
vec4 shaded(vec3 normal) {
  float t = clamp(shade, 0., 1.) * ${RAMP.length - 1}.;
  int i = min(int(t), ${RAMP.length - 2});
  vec3 colour = mix(ramp[i], ramp[i + 1], t - float(i));
  float light = max(dot(normal, vec3(-.36, .64, .68)), 0.), sky = .5 + .5 * normal.y;
  return vec4(colour * (.46 + .2 * sky + .42 * light) + .1 * pow(light, 24.), 1);
}
`;

const SHADERS = {
  surface: [`
in vec3 position, normal;
in float value;
out vec3 point, direction;
out float shade;
void main() {
  vec4 p = view * vec4(position, 1);
  point = p.xyz;
  direction = mat3(view) * normal;
  shade = value;
  gl_Position = projection * p;
}`, SHADE + `
in vec3 point, direction;
void main() {
  vec3 n = normalize(direction);
  result = shaded(dot(n, point) > 0. ? -n : n);
}`],
  // A strip that faces the eye, shaded as a cylinder
  tube: [`
uniform float thickness;
in vec2 corner;
in vec3 from, to;
in vec2 values;
out vec3 across, front;
out float side, shade;
void main() {
  vec3 a = (view * vec4(from, 1)).xyz, b = (view * vec4(to, 1)).xyz;
  vec3 p = mix(a, b, corner.y), axis = b - a;
  across = normalize(cross(axis, -p) + vec3(1e-12, 0, 0));
  front = normalize(cross(across, axis) + vec3(0, 0, 1e-12));
  side = corner.x;
  shade = mix(values.x, values.y, corner.y);
  float pixel = -p.z / (projection[1][1] * height);
  gl_Position = projection * vec4(p + across * side * max(thickness, pixel), 1);
}`, SHADE + `
in vec3 across, front;
in float side;
void main() { result = shaded(normalize(across * side + front * sqrt(max(1. - side * side, 0.)))); }
`],
  sphere: [`
in vec3 position;
in float value, radius;
out float shade;
void main() {
  vec4 p = view * vec4(position, 1);
  shade = value;
  gl_Position = projection * p;
  gl_PointSize = max(radius * projection[1][1] * height / gl_Position.w, 2.);
}`, SHADE + `
void main() {
  vec2 p = vec2(2, -2) * (gl_PointCoord - .5);
  float rest = 1. - dot(p, p);
  if (rest < 0.) discard;
  result = shaded(vec3(p, sqrt(rest)));
}`],
  // Slightly farther from the eye than it is: faces sag between particles on its surface.
  solid: [`
in vec3 position, normal;
out vec3 direction;
void main() {
  direction = mat3(view) * normal;
  gl_Position = projection * vec4(1.006 * (view * vec4(position, 1)).xyz, 1);
}`, `
uniform vec3 colour;
in vec3 direction;
out vec4 result;
void main() {
  vec3 n = normalize(direction);
  float light = max(dot(n, vec3(-.36, .64, .68)), 0.), sky = .5 + .5 * n.y;
  result = vec4(colour * (.55 + .25 * sky + .4 * light), 1);
}`],
  // A ring of the same size at any distance
  pin: [`
uniform float size;
in vec3 position;
void main() {
  gl_Position = projection * view * vec4(position, 1);
  gl_Position.z -= .02 * gl_Position.w;
  gl_PointSize = size;
}`, `
uniform vec3 colour;
out vec4 result;
void main() {
  float r = length(2. * gl_PointCoord - 1.);
  float ring = smoothstep(1., .9, r) * (r < .45 ? .35 : smoothstep(.45, .55, r));
  if (ring == 0.) discard;
  result = vec4(colour, 1) * ring;
}`],
  // A grid that fades with the distance from the scene and ends where another plane begins
  plane: [`
uniform vec3 middle, along, beside;
uniform float extent;
in vec2 corner;
out vec3 point;
out vec2 place;
void main() {
  place = corner * extent;
  point = middle + place.x * along + place.y * beside;
  gl_Position = projection * view * vec4(point, 1);
}`, `
uniform vec3 colour;
uniform float spacing, extent;
uniform vec4 planes[8];
uniform int nplanes;
in vec3 point;
in vec2 place;
out vec4 result;
void main() {
  for (int i = 0; i < nplanes; i++)
    if (dot(planes[i].xyz, point) < planes[i].w - 1e-4) discard;
  vec2 cell = place / spacing, width = fwidth(cell);
  vec2 away = abs(fract(cell - .5) - .5) / width;
  float line = (1. - min(min(away.x, away.y), 1.)) * clamp(.5 / max(width.x, width.y), 0., 1.);
  float fade = smoothstep(extent, .3 * extent, length(place));
  result = vec4(colour, 1) * (.1 + .38 * line) * fade;
}`],
};

function compile(gl, kind, source) {
  const shader = gl.createShader(kind);
  gl.shaderSource(shader, COMMON + source);
  gl.compileShader(shader);
  return shader;
}

function makeProgram(gl, [vertex, fragment]) {
  const program = gl.createProgram();
  gl.attachShader(program, compile(gl, gl.VERTEX_SHADER, vertex));
  gl.attachShader(program, compile(gl, gl.FRAGMENT_SHADER, fragment));
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost())
    throw new Error(gl.getProgramInfoLog(program));
  return program;
}

// Normals of the particles: sums over their faces, weighted by area
function addNormals(x, faces, normals) {
  normals.fill(0);
  for (let f = 0; f < faces.length; f += 3) {
    const a = 3 * faces[f], b = 3 * faces[f + 1], c = 3 * faces[f + 2];
    const ux = x[b] - x[a], uy = x[b + 1] - x[a + 1], uz = x[b + 2] - x[a + 2];
    const vx = x[c] - x[a], vy = x[c + 1] - x[a + 1], vz = x[c + 2] - x[a + 2];
    const nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
    normals[a] += nx; normals[a + 1] += ny; normals[a + 2] += nz;
    normals[b] += nx; normals[b + 1] += ny; normals[b + 2] += nz;
    normals[c] += nx; normals[c + 1] += ny; normals[c + 2] += nz;
  }
}

function copyTriples(x, indices, out) {
  for (let i = 0; i < indices.length; i++)
    for (let d = 0; d < 3; d++) out[3 * i + d] = x[3 * indices[i] + d];
}

class Picture {
  // planes: [{normal, offset}], solids: of makeSolid, both in the units of the picture
  constructor(canvas, recording, drawn, planes, solids, spacing) {
    // Edges are smoothed where a GPU draws; in software that would take half the frames per second.
    const gl = this.gl = canvas.getContext("webgl2", {failIfMajorPerformanceCaveat: true})
      || canvas.getContext("webgl2", {antialias: false});
    if (!gl) throw new Error("This page draws with WebGL 2, which this browser does not offer.");
    Object.assign(this, {canvas, recording, drawn, planes, solids, spacing});
    this.pins = [...recording.pinned.keys()].filter(i => recording.pinned[i]);
    this.programs = {};
    this.makeArrays();
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  makeArrays() {
    const {gl, drawn, recording: {particles: n, faces}} = this;
    const springs = drawn.springs.length, spheres = drawn.spheres.length;
    this.position = this.buffer(3 * n);
    this.normal = this.buffer(3 * n);
    this.value = this.buffer(n);
    this.ends = this.buffer(3 * springs);
    this.endValues = this.buffer(springs);
    this.centres = this.buffer(3 * spheres);
    this.centreValues = this.buffer(spheres);
    this.pinCentres = this.buffer(3 * this.pins.length);
    this.strip = this.buffer([-1, 0, 1, 0, -1, 1, 1, 1]);
    this.square = this.buffer([-1, -1, 1, -1, -1, 1, 1, 1]);
    this.radii = this.buffer(Float32Array.from(drawn.radii));
    this.solidBuffers = this.solids.map(({position, normal}) => (
      {position: this.buffer(position), normal: this.buffer(normal)}));
    this.faces = gl.createBuffer();
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.faces);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, faces, gl.STATIC_DRAW);
  }

  // An array and its copy in the memory of the GPU
  buffer(content) {
    const buffer = {array: new Float32Array(content), id: this.gl.createBuffer()};
    this.upload(buffer);
    return buffer;
  }

  upload({array, id}) {
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, id);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, array, this.gl.DYNAMIC_DRAW);
  }

  // Shows solid i with other positions and normals.
  setSolid(i, {position, normal}) {
    const buffers = this.solidBuffers[i];
    buffers.position.array.set(position);
    buffers.normal.array.set(normal);
    this.upload(buffers.position);
    this.upload(buffers.normal);
  }

  // x: positions; values: colours of the particles, 0 to 1
  setState(x, values) {
    const {drawn, recording} = this;
    this.position.array.set(x);
    this.value.array.set(values);
    addNormals(x, recording.faces, this.normal.array);
    copyTriples(x, drawn.springs, this.ends.array);
    copyTriples(x, drawn.spheres, this.centres.array);
    copyTriples(x, this.pins, this.pinCentres.array);
    drawn.springs.forEach((i, s) => { this.endValues.array[s] = values[i]; });
    drawn.spheres.forEach((i, s) => { this.centreValues.array[s] = values[i]; });
    for (const name of ["position", "normal", "value", "ends", "endValues", "centres",
                        "centreValues", "pinCentres"])
      this.upload(this[name]);
  }

  use(name, uniforms) {
    const {gl} = this, program = this.programs[name] ||= makeProgram(gl, SHADERS[name]);
    gl.useProgram(program);
    for (const [key, value] of Object.entries({...this.matrices, ...uniforms})) {
      const at = gl.getUniformLocation(program, key);
      if (key === "nplanes") gl.uniform1i(at, value);
      else if (typeof value === "number") gl.uniform1f(at, value);
      else if (key === "planes") gl.uniform4fv(at, value);
      else if (value.length === 16) gl.uniformMatrix4fv(at, false, value);
      else gl.uniform3fv(at, value);
    }
    this.program = program;
  }

  // divisor 1: one element an instance. stride and offset in numbers
  attribute(name, {id}, size, divisor = 0, stride = size, offset = 0) {
    const {gl} = this, at = gl.getAttribLocation(this.program, name);
    gl.bindBuffer(gl.ARRAY_BUFFER, id);
    gl.enableVertexAttribArray(at);
    gl.vertexAttribPointer(at, size, gl.FLOAT, false, 4 * stride, 4 * offset);
    gl.vertexAttribDivisor(at, divisor);
  }

  drawSurface() {
    const {gl, recording: {faces}} = this;
    this.use("surface", {});
    this.attribute("position", this.position, 3);
    this.attribute("normal", this.normal, 3);
    this.attribute("value", this.value, 1);
    gl.drawElements(gl.TRIANGLES, faces.length, gl.UNSIGNED_INT, 0);
  }

  drawSprings() {
    const {gl, drawn} = this;
    this.use("tube", {thickness: drawn.thickness});
    this.attribute("corner", this.strip, 2);
    this.attribute("from", this.ends, 3, 1, 6);
    this.attribute("to", this.ends, 3, 1, 6, 3);
    this.attribute("values", this.endValues, 2, 1);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, drawn.springs.length / 2);
  }

  drawSpheres() {
    this.use("sphere", {});
    this.attribute("position", this.centres, 3);
    this.attribute("value", this.centreValues, 1);
    this.attribute("radius", this.radii, 1);
    this.gl.drawArrays(this.gl.POINTS, 0, this.drawn.spheres.length);
  }

  // Those inside which particles stay only from within: the eye looks into them.
  drawSolids(colour) {
    const {gl, solids, solidBuffers} = this;
    this.use("solid", {colour});
    gl.enable(gl.CULL_FACE);
    solids.forEach(({inside, position}, i) => {
      gl.cullFace(inside ? gl.FRONT : gl.BACK);
      this.attribute("position", solidBuffers[i].position, 3);
      this.attribute("normal", solidBuffers[i].normal, 3);
      gl.drawArrays(gl.TRIANGLES, 0, position.length / 3);
    });
    gl.disable(gl.CULL_FACE);
  }

  drawPins(colour) {
    this.use("pin", {colour, size: Math.max(10, this.canvas.height / 50)});
    this.attribute("position", this.pinCentres, 3);
    this.gl.drawArrays(this.gl.POINTS, 0, this.pins.length);
  }

  // The grid has a node at the foot of the origin, the middle of the scene.
  drawPlane(index, colour) {
    const {gl, planes} = this, {normal, offset} = planes[index], extent = 2.2;
    const along = unit(cross(Math.abs(normal[1]) < 0.9 ? [0, 1, 0] : [0, 0, 1], normal));
    const others = planes.filter((_, i) => i !== index).slice(0, 8);
    this.use("plane", {
      colour, extent, spacing: this.spacing, nplanes: others.length,
      middle: normal.map(c => c * offset), along, beside: cross(normal, along),
      planes: [...others.flatMap(p => [...p.normal, p.offset]), ...Array(32).fill(0)].slice(0, 32),
    });
    this.attribute("corner", this.square, 2);
    gl.drawArrays(gl.TRIANGLE_STRIP, 0, 4);
  }

  // colours: {pin, grid} as [r, g, b]
  draw(camera, colours) {
    const {gl, canvas} = this, {width, height} = canvas;
    this.matrices = {...camera.matrices(width / height), height};
    gl.viewport(0, 0, width, height);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.recording.triangles) this.drawSurface();
    if (this.drawn.springs.length) this.drawSprings();
    if (this.drawn.spheres.length) this.drawSpheres();
    if (this.solids.length) this.drawSolids(colours.grid);
    gl.enable(gl.BLEND);
    gl.depthMask(false);
    this.planes.forEach((_, i) => this.drawPlane(i, colours.grid));
    if (this.pins.length) this.drawPins(colours.pin);
    gl.depthMask(true);
    gl.disable(gl.BLEND);
  }
}
