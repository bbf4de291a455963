// player - shows the recording: time, controls, colours. `#t=1.5` behind the page's address opens
// it at that time, not playing.

const byId = id => document.getElementById(id);

// Low and high corner of the boxes of all frames
function wholeBox(frames) {
  const low = [...frames[0].low], high = [...frames[0].high];
  for (const frame of frames)
    for (let c = 0; c < 3; c++) {
      low[c] = Math.min(low[c], frame.low[c]);
      high[c] = Math.max(high[c], frame.high[c]);
    }
  return {low, high};
}

/*------------------------------------- colours --------------------------------------------------*/

// Means over the springs of each particle; of: the value of spring s with its length
function meanOfSprings({ij, particles: n}, x, scale, of, out) {
  const count = new Uint32Array(n);
  out.fill(0);
  for (let s = 0; 2 * s < ij.length; s++) {
    const i = ij[2 * s], j = ij[2 * s + 1], value = of(s, distance(x, i, j) * scale);
    out[i] += value;
    out[j] += value;
    count[i]++;
    count[j]++;
  }
  for (let i = 0; i < n; i++) out[i] /= count[i] || 1;
}

// `noise`: what an error of the coordinates, in m, makes of 0
const QUANTITIES = {
  // |l - L|/L; springs of rest length 0 have none
  strain: {
    unit: "%",
    noise: ({rest}, error) => 100 * error / median(rest),
    compute({recording, x, scale}, out) {
      const {rest} = recording;
      meanOfSprings(recording, x, scale, (s, l) => rest[s] && 100 * Math.abs(l - rest[s]) / rest[s],
                    out);
    },
  },
  // k (l - L) where a spring pulls, without damping
  tension: {
    unit: "N",
    noise: ({k}, error) => median(k) * error,
    compute({recording, x, scale}, out) {
      const {k, rest} = recording;
      meanOfSprings(recording, x, scale, (s, l) => Math.max(k[s] * (l - rest[s]), 0), out);
    },
  },
  speed: {
    unit: "m/s",
    noise: () => 0,
    compute({recording: {frames, speed, particles: n}, k, next, share}, out) {
      const a = frames[k].fastest / 255 * (1 - share), b = frames[next].fastest / 255 * share;
      for (let i = 0; i < n; i++) out[i] = a * speed[k][i] + b * speed[next][i];
    },
  },
};

const rampStyle = () => `linear-gradient(90deg, ${RAMP.map(
  c => `rgb(${c.map(v => Math.round(255 * v))})`)})`;

function colourOf(style, name) {
  const digits = style.getPropertyValue(name).trim();
  return [1, 3, 5].map(at => parseInt(digits.slice(at, at + 2), 16) / 255);
}

/*------------------------------------- the player -----------------------------------------------*/

const ICONS = {play: "M3 1v14l11-7z", pause: "M3 1h4v14H3zM9 1h4v14H9z"};

class Player {
  constructor(recording) {
    const {low, high} = wholeBox(recording.frames), n = recording.particles;
    const half = low.map((l, c) => high[c] / 2 - l / 2);
    this.recording = recording;
    this.centre = low.map((l, c) => l / 2 + high[c] / 2);
    this.scale = Math.hypot(...half) || 1;
    this.times = recording.frames.map(frame => frame.t);
    this.x = new Float32Array(3 * n);
    this.values = new Float32Array(n);
    this.near = [new Float32Array(3 * n), new Float32Array(3 * n)];   // frames k and k + 1
    this.held = [-1, -1];                                             // which frames these are
    this.planes = recording.planes.map(({normal, offset}) => (
      {normal, offset: (offset - dot(normal, this.centre)) / this.scale}));
    this.solids = recording.colliders.map(c => makeSolid(c, this.centre, this.scale));
    this.camera = new Camera(recording.gravity, this.samplePoints(), this.planes);
    this.spacing = roundStep(this.scale / 4);
    this.energies = new Energies(byId("energies"), byId("cursor"), byId("values"),
                                 recording.frames);
    this.tops = {};
    this.playing = false;
    this.setTime(this.times[0]);
    this.makePicture();
  }

  makePicture() {
    const {recording, centre, scale} = this;
    positionsOf(recording, 0, centre, scale, this.x);
    this.drawn = chooseDrawn(recording, this.x);
    this.picture = new Picture(byId("picture"), recording, this.drawn, this.planes,
                               this.solids, this.spacing / scale);
    this.changed = true;
  }

  // Some thousand positions of particles in all frames
  samplePoints() {
    const n = this.recording.particles, points = [];
    const frameStep = Math.ceil(this.times.length / 25), step = Math.ceil(n / 100);
    for (let k = 0; k < this.times.length; k += frameStep) {
      positionsOf(this.recording, k, this.centre, this.scale, this.x);
      for (let i = n - 1; i >= 0; i -= step) points.push([...this.x.subarray(3 * i, 3 * i + 3)]);
    }
    return points;
  }

  /*----------------------------------- time -----------------------------------------------------*/

  setTime(t) {
    const last = this.times.length - 1;
    this.t = Math.min(Math.max(t, this.times[0]), this.times[last]);
    let low = 0, high = last;   // the last frame at or before t
    while (low < high) {
      const middle = low + high + 1 >> 1;
      if (this.times[middle] <= this.t) low = middle;
      else high = middle - 1;
    }
    this.k = low;
    this.next = Math.min(low + 1, last);
    const step = this.times[this.next] - this.times[low];
    this.share = step > 0 ? (this.t - this.times[low]) / step : 0;
    this.changed = true;
  }

  showFrame(k) {
    this.pause();
    this.setTime(this.times[Math.min(Math.max(k, 0), this.times.length - 1)]);
  }

  play() {
    if (this.t >= this.times[this.times.length - 1]) this.setTime(this.times[0]);
    this.setPlaying(true);
  }

  pause() { this.setPlaying(false); }

  setPlaying(playing) {
    this.playing = playing;
    byId("play").setAttribute("aria-label", playing ? "Pause" : "Play");
    byId("play").querySelector("path").setAttribute("d", playing ? ICONS.pause : ICONS.play);
  }

  advance(seconds) {
    const [first, last] = [this.times[0], this.times[this.times.length - 1]];
    const t = this.t + seconds * byId("speed").value;
    this.setTime(t > last ? first : t);
  }

  // Makes frames k and k + 1 those in `near`; while playing, one of them mostly is there already
  holdFrames() {
    if (this.held[1] === this.k) {
      this.near.reverse();
      this.held.reverse();
    }
    [this.k, this.next].forEach((k, slot) => {
      if (this.held[slot] !== k)
        positionsOf(this.recording, k, this.centre, this.scale, this.near[slot]);
      this.held[slot] = k;
    });
  }

  // Solids that move, where they are at the present time
  placeSolids() {
    const {frames} = this.recording, a = frames[this.k].poses, b = frames[this.next].poses || a;
    if (!a) return;
    this.solids.forEach((solid, i) => {
      const pose = a[i].map((x, c) => x + this.share * (b[i][c] - x));
      this.picture.setSolid(i, placeSolid(solid, pose, this.centre, this.scale));
    });
  }

  // Positions and values at the present time
  computeState() {
    this.holdFrames();
    const [a, b] = this.near, {x, share} = this;
    for (let i = 0; i < x.length; i++) x[i] = a[i] + share * (b[i] - a[i]);
    QUANTITIES[byId("quantity").value].compute(this, this.values);
  }

  /*----------------------------------- colours --------------------------------------------------*/

  // The value that 1 in 200 exceed, over some frames; at least what two steps of 16 bits make
  topOf(name) {
    if (this.tops[name]) return this.tops[name];
    const {t} = this, frames = this.times.length, n = this.values.length, samples = [];
    const step = Math.max(1, Math.floor(frames / 16)), stride = Math.ceil(n / 5e4);
    for (let k = 0; k < frames; k += step) {
      this.setTime(this.times[k]);
      this.computeState();
      for (let i = k % stride; i < n; i += stride) samples.push(this.values[i]);
    }
    this.setTime(t);
    const sorted = Float32Array.from(samples).sort();
    const noise = QUANTITIES[name].noise(this.recording, 4 * this.scale / 65535);
    const most = sorted[Math.floor(0.995 * (sorted.length - 1))];
    return this.tops[name] = Math.max(most, noise) || 1e-9;
  }

  showRange() {
    const {value: name} = byId("quantity"), {unit} = QUANTITIES[name], top = this.topOf(name);
    const text = unit === "%" ? `${+top.toPrecision(2)} %` : withUnit(top, unit);
    byId("top").textContent = `≥ ${text}`;
    this.changed = true;
  }

  /*----------------------------------- drawing --------------------------------------------------*/

  resize() {
    const canvas = byId("picture"), ratio = Math.min(window.devicePixelRatio, 2);
    const width = Math.max(1, Math.round(canvas.clientWidth * ratio));
    const height = Math.max(1, Math.round(canvas.clientHeight * ratio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
    this.energies.draw(getComputedStyle(document.documentElement));
    this.changed = true;
  }

  draw() {
    const style = getComputedStyle(document.documentElement);
    const top = this.topOf(byId("quantity").value);
    this.computeState();
    for (let i = 0; i < this.values.length; i++) this.values[i] /= top;
    this.picture.setState(this.x, this.values);
    this.placeSolids();
    this.picture.draw(this.camera, {pin: colourOf(style, "--pin"),
                                    grid: colourOf(style, "--grid")});
    this.showTime();
    this.changed = false;
  }

  showTime() {
    const end = this.times[this.times.length - 1], slider = byId("frame");
    const digits = Math.max(0, 2 - Math.floor(Math.log10(end || 1)));
    slider.value = this.k;
    slider.setAttribute("aria-valuetext", `t = ${this.t.toFixed(digits)} s`);
    byId("time").textContent = `${this.t.toFixed(digits)} / ${end.toFixed(digits)} s`;
    this.energies.show(this.t, this.k, this.share);
  }

  loop(before, now) {
    if (this.playing) this.advance((now - before) / 1000);
    if (this.changed && !this.picture.gl.isContextLost()) this.draw();
    requestAnimationFrame(later => this.loop(now, later));
  }
}

/*------------------------------------- controls -------------------------------------------------*/

// Real time for runs of seconds; others take some ten seconds. [speed, its name, if it is usual]
function speedsFor(duration) {
  const usual = duration >= 1 && duration <= 100 || !duration ? 1
    : 10 ** Math.round(Math.log10(duration / 10));
  const names = {0.125: "⅛", 0.25: "¼", 0.5: "½"};
  const nameOf = speed => names[speed] || String(+speed.toPrecision(3));
  return [0.125, 0.25, 0.5, 1, 2, 4, 8].map(factor => factor * usual).map(
    speed => [speed, `${nameOf(speed)}×`, speed === usual]);
}

function connectControls(player) {
  const {recording, times} = player;
  for (const [speed, name, isUsual] of speedsFor(times[times.length - 1] - times[0]))
    byId("speed").add(new Option(name, speed, isUsual, isUsual));
  byId("frame").max = times.length - 1;
  byId("frame").oninput = event => player.showFrame(+event.target.value);
  byId("play").onclick = () => (player.playing ? player.pause() : player.play());
  byId("quantity").onchange = () => player.showRange();
  byId("reset").onclick = () => { player.camera.reset(); player.changed = true; };
  if (!recording.springs) {
    byId("quantity").value = "speed";
    byId("quantity").disabled = true;
  }
  byId("chart").onpointerdown = byId("chart").onpointermove = event => {
    if (!event.buttons) return;
    player.pause();
    const {left} = byId("chart").getBoundingClientRect();
    player.setTime(player.energies.timeAt(event.clientX - left));
  };
}

// One pointer turns; two pointers, Shift or another button than the left move, and two also zoom.
function connectPointers(canvas, player) {
  const pointers = new Map(), {camera} = player;
  canvas.oncontextmenu = event => event.preventDefault();
  canvas.ondblclick = () => byId("reset").click();
  canvas.onpointerdown = event => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
  };
  canvas.onpointerup = canvas.onpointercancel = event => pointers.delete(event.pointerId);
  canvas.onpointermove = event => {
    const before = pointers.get(event.pointerId), {clientWidth, clientHeight} = canvas;
    if (!before) return;
    pointers.set(event.pointerId, event);
    const dx = event.clientX - before.clientX, dy = event.clientY - before.clientY;
    const [other] = [...pointers.values()].filter(p => p.pointerId !== event.pointerId);
    const moves = other || event.shiftKey || event.buttons > 1;
    const share = (other ? 0.5 : 1) / clientHeight;
    if (moves) camera.move(dx * share, dy * share, clientWidth / clientHeight);
    else camera.turn(dx / 160, dy / 160);
    if (other) camera.magnify(gap(event, other) / gap(before, other));
    player.changed = true;
  };
  canvas.addEventListener("wheel", event => {
    event.preventDefault();
    camera.magnify(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.001)));
    player.changed = true;
  }, {passive: false});
}

const gap = (a, b) => Math.max(Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY), 1);

// Keys of the page; with Shift the arrows turn.
function keyAction(player, key, shift) {
  const {camera, k, times} = player;
  const actions = shift ? {
    ArrowLeft: () => camera.turn(-0.1, 0), ArrowRight: () => camera.turn(0.1, 0),
    ArrowUp: () => camera.turn(0, 0.1), ArrowDown: () => camera.turn(0, -0.1),
  } : {
    " ": () => byId("play").click(),
    ArrowLeft: () => player.showFrame(player.share > 0 ? k : k - 1),
    ArrowRight: () => player.showFrame(k + 1),
    ArrowUp: () => camera.magnify(1.1), ArrowDown: () => camera.magnify(1 / 1.1),
    Home: () => player.showFrame(0), End: () => player.showFrame(times.length - 1),
  };
  return {...actions, "+": () => camera.magnify(1.1), "-": () => camera.magnify(1 / 1.1)}[key];
}

function connectKeys(player) {
  document.onkeydown = event => {
    const isOwn = event.target.closest("select, button");
    if (isOwn && event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    if (event.target.closest("select") || event.ctrlKey || event.altKey || event.metaKey) return;
    const action = keyAction(player, event.key, event.shiftKey);
    if (!action) return;
    event.preventDefault();
    action();
    player.changed = true;
  };
}

function connectPage(player) {
  const canvas = byId("picture");
  new ResizeObserver(() => player.resize()).observe(canvas.parentElement);
  matchMedia("(prefers-color-scheme: dark)").onchange = () => player.resize();
  canvas.addEventListener("webglcontextlost", event => event.preventDefault());
  canvas.addEventListener("webglcontextrestored", () => player.makePicture());
}

/*------------------------------------- start ----------------------------------------------------*/

const counted = (count, noun) => `${count.toLocaleString("en")} ${noun}${count === 1 ? "" : "s"}`;

function describe(player) {
  const {recording, times, spacing} = player, missing = recording.frames.length < recording.total;
  document.title = byId("name").textContent = recording.name || "Motion of a mass-spring system";
  byId("counts").textContent = [
    counted(recording.particles, "particle"), counted(recording.springs, "spring"),
    counted(times.length, "frame") + (missing ? ` of ${recording.total.toLocaleString("en")}` : ""),
  ].join(" · ");
  byId("ramp").style.background = rampStyle();
  const pins = player.picture.pins.length ? "<span class=\"pin\">◉</span> pinned<br>" : "";
  const grid = `grid ${withUnit(spacing, "m", prefixOf(spacing), true)}`;
  byId("signs").innerHTML = pins + (recording.planes.length ? grid : "");
}

function start() {
  const player = new Player(readRecording(byId("recording").textContent));
  byId("recording").remove();
  connectControls(player);
  connectPointers(byId("picture"), player);
  connectKeys(player);
  connectPage(player);
  describe(player);
  player.showRange();
  player.resize();
  const time = location.hash.match(/^#t=(.+)/);
  if (time) player.setTime(+time[1]);
  player.setPlaying(!time && player.times.length > 1
    && !matchMedia("(prefers-reduced-motion: reduce)").matches);
  player.draw();
  performance.mark("first frame");
  requestAnimationFrame(now => player.loop(now, now));
}

// In two steps, so that the page says that it is loading
addEventListener("DOMContentLoaded", () => setTimeout(() => {
  try {
    start();
  } catch (error) {
    byId("message").textContent = error.message;
    byId("message").hidden = false;
    throw error;
  }
}));
