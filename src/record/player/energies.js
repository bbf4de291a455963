// energies - curves of the energies, with a cursor at the present time.
//
// The gravitational energy is counted from the start, as its zero is arbitrary.

const CURVES = [["kinetic", "kinetic"], ["elastic", "elastic"],
                ["gravitational", "gravitational, from start"], ["drift", "total drift"]];
const PREFIXES = {"-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G"};

// The power of ten of the prefix for numbers up to a value
function prefixOf(value) {
  const power = value ? Math.floor(Math.log10(Math.abs(value)) / 3) * 3 : 0;
  return Math.max(-9, Math.min(9, power));
}

// A number with three digits or, where `isRound`, with as many as it needs
function withUnit(value, unit, power = prefixOf(value), isRound = false) {
  const number = value / 10 ** power, text = number.toPrecision(3);
  return `${isRound || !value ? +text : text} ${PREFIXES[power]}${unit}`.replace("-", "−");
}

// 1, 2 or 5 times a power of ten, at least value
function roundStep(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 5, 10].map(f => f * power).find(step => step >= value * (1 - 1e-9));
}

class Energies {
  constructor(canvas, cursor, list, frames) {
    Object.assign(this, {canvas, cursor, frames});
    const first = frames[0], total = f => f.kinetic + f.elastic + f.gravitational;
    this.curves = {
      kinetic: frames.map(f => f.kinetic),
      elastic: frames.map(f => f.elastic),
      gravitational: frames.map(f => f.gravitational - first.gravitational),
      drift: frames.map(f => total(f) - total(first)),
    };
    const all = Object.values(this.curves);
    this.low = Math.min(...all.map(c => c.reduce((a, b) => Math.min(a, b))));
    this.high = Math.max(...all.map(c => c.reduce((a, b) => Math.max(a, b))));
    if (this.low === this.high) this.high = this.low + 1e-9;
    this.labels = CURVES.map(([name, text]) => {
      const item = document.createElement("li"), value = document.createElement("b");
      item.style.setProperty("--colour", `var(--${name})`);
      item.append(`${text} `, value);
      list.append(item);
      return value;
    });
  }

  x(t, area) {
    const [first, last] = this.ends();
    return area.left + (last > first ? (t - first) / (last - first) : 0) * area.width;
  }

  y(value, area) {
    return area.top + (this.high - value) / (this.high - this.low) * area.height;
  }

  ends() { return [this.frames[0].t, this.frames[this.frames.length - 1].t]; }

  // The time at a place on the canvas
  timeAt(x) {
    const {left, width} = this.area, [first, last] = this.ends();
    return first + Math.min(Math.max((x - left) / width, 0), 1) * (last - first);
  }

  draw(style) {
    const {canvas} = this, ratio = window.devicePixelRatio;
    const {clientWidth: width, clientHeight: height} = canvas;
    canvas.width = width * ratio;
    canvas.height = height * ratio;
    // of the curves, in CSS pixels
    const area = this.area = {left: 56, top: 6, width: Math.max(width - 60, 1),
                              height: Math.max(height - 26, 1)};
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = "11px system-ui, sans-serif";
    this.drawAxes(pen, area, style);
    for (const [name] of CURVES)
      this.drawCurve(pen, area, this.curves[name], style.getPropertyValue(`--${name}`));
  }

  drawAxes(pen, area, style) {
    const step = roundStep((this.high - this.low) / (area.height > 90 ? 5 : 3));
    const power = prefixOf(Math.max(this.high, -this.low));
    pen.strokeStyle = style.getPropertyValue("--line");
    pen.fillStyle = style.getPropertyValue("--quiet");
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (let i = Math.ceil(this.low / step); i * step <= this.high; i++) {
      const y = Math.round(this.y(i * step, area)) + 0.5;
      pen.beginPath();
      pen.moveTo(area.left, y);
      pen.lineTo(area.left + area.width, y);
      pen.stroke();
      pen.fillText(withUnit(i * step, "J", power, true), area.left - 6, y);
    }
    this.drawTimes(pen, area);
  }

  drawTimes(pen, area) {
    const [first, last] = this.ends();
    if (first === last) return;
    const step = roundStep((last - first) / Math.max(area.width / 110, 2));
    pen.textBaseline = "alphabetic";
    for (let i = Math.ceil(first / step); i * step <= last * (1 + 1e-9); i++) {
      const x = this.x(i * step, area);
      pen.textAlign = x > area.left + area.width - 20 ? "right" : "center";
      pen.fillText(withUnit(i * step, "s", prefixOf(last), true), x, area.top + area.height + 16);
    }
  }

  drawCurve(pen, area, curve, colour) {
    pen.strokeStyle = colour;
    pen.lineWidth = 1.5;
    pen.setLineDash(curve === this.curves.drift ? [4, 3] : []);
    pen.beginPath();
    this.frames.forEach(({t}, k) => pen.lineTo(this.x(t, area), this.y(curve[k], area)));
    pen.stroke();
    pen.setLineDash([]);
  }

  // Between frame k and the next, at the share s
  show(t, k, s) {
    this.cursor.style.transform = `translateX(${this.x(t, this.area)}px)`;
    CURVES.forEach(([name], i) => {
      const curve = this.curves[name], next = curve[Math.min(k + 1, curve.length - 1)];
      this.labels[i].textContent = withUnit(curve[k] + s * (next - curve[k]), "J");
    });
  }
}
