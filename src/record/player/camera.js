// camera - looks at the scene from a point on a sphere around it.

const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                         a[0] * b[1] - a[1] * b[0]];
const unit = a => a.map(c => c / (Math.hypot(...a) || 1));
const combine = (...terms) => [0, 1, 2].map(d => terms.reduce((sum, [f, a]) => sum + f * a[d], 0));

const TANGENT = Math.tan(Math.PI / 180 * 17);   // of half the vertical angle of view
const STEEPEST = 1.55;

class Camera {
  // points: a sample of the motion, with coordinates below 1; planes: [{normal}]
  constructor(gravity, points, planes) {
    Object.assign(this, {points, planes});
    this.up = Math.hypot(...gravity) ? unit(gravity.map(g => -g)) : [0, 0, 1];
    this.east = unit(cross(Math.abs(this.up[1]) < 0.9 ? [0, 1, 0] : [0, 0, 1], this.up));
    this.north = cross(this.up, this.east);
    this.reset();
  }

  extent(direction) {
    const along = this.points.map(p => dot(p, direction));
    return [Math.min(...along), Math.max(...along)];
  }

  // A planar scene is seen from its front.
  reset() {
    const [east, north, up] = [this.east, this.north, this.up].map(direction => {
      const [low, high] = this.extent(direction);
      return high - low;
    });
    const thin = 0.03 * Math.max(east, north, up);
    this.elevation = up <= thin ? 1 : 0.3;
    this.azimuth = north <= thin ? -1.4 : east <= thin ? -0.17 : this.clearAzimuth();
    this.home = this.axes();
    const middle = [this.home.right, this.home.top].map(direction => {
      const [low, high] = this.extent(direction);
      return [(low + high) / 2, direction];
    });
    this.target = this.middle = combine(...middle);
    this.zoom = 1;
  }

  // From which no plane is seen from below or along its surface; if there are several, near -1
  clearAzimuth() {
    const steps = [...Array(13).keys()].flatMap(i => [i, -i]).map(i => -1 - i * Math.PI / 12);
    const views = steps.map(azimuth => {
      const {back} = Object.assign(Object.create(this), {azimuth}).axes();
      return {azimuth, clear: Math.min(0.2, ...this.planes.map(p => dot(p.normal, back)))};
    });
    return views.reduce((best, view) => (view.clear > best.clear + 1e-9 ? view : best)).azimuth;
  }

  // Unit vectors to the right, upwards and towards the eye
  axes() {
    const {azimuth: a, elevation: e} = this;
    const back = combine([Math.cos(e) * Math.cos(a), this.east],
                         [Math.cos(e) * Math.sin(a), this.north], [Math.sin(e), this.up]);
    const right = unit(cross(this.up, back));
    return {right, top: cross(back, right), back};
  }

  // From which all points are in view at first, with a margin
  distance(aspect) {
    const {right, top, back} = this.home;
    let farthest = 0.1;
    for (const point of this.points) {
      const p = combine([1, point], [-1, this.middle]);
      const wide = Math.max(Math.abs(dot(p, right)) / aspect, Math.abs(dot(p, top)));
      farthest = Math.max(farthest, dot(p, back) + 1.15 * wide / TANGENT);
    }
    return farthest / this.zoom;
  }

  // Columns of the matrices
  matrices(aspect) {
    const {right, top, back} = this.axes(), distance = this.distance(aspect);
    const eye = combine([1, this.target], [distance, back]);
    const near = distance / 100, far = distance + 20, f = 1 / TANGENT;
    const axes = [0, 1, 2].flatMap(d => [right[d], top[d], back[d], 0]);
    return {
      view: [...axes, -dot(right, eye), -dot(top, eye), -dot(back, eye), 1],
      projection: [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1,
                   0, 0, 2 * far * near / (near - far), 0],
    };
  }

  turn(dx, dy) {
    this.azimuth -= dx;
    this.elevation = Math.max(-STEEPEST, Math.min(STEEPEST, this.elevation + dy));
  }

  // dx, dy in heights of the picture
  move(dx, dy, aspect) {
    const {right, top} = this.axes(), size = 2 * TANGENT * this.distance(aspect);
    this.target = combine([1, this.target], [-dx * size, right], [dy * size, top]);
  }

  magnify(factor) { this.zoom = Math.max(0.05, Math.min(200, this.zoom * factor)); }
}
