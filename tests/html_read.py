"""Decodes the data of a page that the recorder html has written (src/record/html.h)."""
import json
import math
import struct

DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/"
START, END = '<script type="text/plain" id="recording">\n', "</script>\n</html>\n"


def integers(text, count, width):
    """The integers of src/record/integer_code.h"""
    bits = "".join(f"{DIGITS.index(digit):06b}" for digit in text)
    at, values = 0, []

    def read(size):
        nonlocal at
        at += size
        return int(bits[at - size:at] or "0", 2)

    for start in range(0, count, 64):
        k = read(6)
        for _ in range(min(64, count - start)):
            high = 0
            if k < width:
                end = bits.index("0", at)
                high, at = end - at, end + 1
            z = (high << k) + read(k)
            values.append(-(z + 1) // 2 if z % 2 else z // 2)
    assert at <= len(bits) < at + 6 and "1" not in bits[at:], "something follows the integers"
    return values


def sums(differences, stride):
    values = list(differences)
    for i in range(stride, len(values)):
        values[i] = (values[i] + values[i - stride] + 2**31) % 2**32 - 2**31
    return values


def floats(text, count):
    return [struct.unpack("f", struct.pack("i", bits))[0]
            for bits in sums(integers(text, count, 32), 1)]


def triples(values):
    return [tuple(values[i:i + 3]) for i in range(0, len(values), 3)]


class Page:
    """name, planes, mass, ..., and frames: [{step, t, ..., x: [(x, y, z), ...], speed: [...]}]"""

    def __init__(self, path):
        text = path.read_text(encoding="utf-8")
        self.player, data = text.split(START)
        self.is_complete = data.endswith(END)
        lines = data.removesuffix(END).split("\n")
        scene = json.loads(lines[0])
        self.n, self.planned = scene["particles"], scene["frames"]
        self.name, self.gravity, self.planes = scene["name"], scene["gravity"], scene["planes"]
        self.colliders = scene["colliders"]
        self.mass = floats(scene["mass"], self.n)
        self.pinned = sums(integers(scene["pinned"], self.n, 32), 1)
        springs = scene["springs"]
        self.ij = sums(integers(scene["ij"], 2 * springs, 32), 2)
        self.k, self.rest = floats(scene["k"], springs), floats(scene["rest"], springs)
        self.faces = triples(sums(integers(scene["faces"], 3 * scene["triangles"], 32), 3))
        self.frames = [json.loads(line) for line in lines[1:-1]]  # behind the last \n is ""
        self.decode("x", 3, 16)
        self.decode("speed", 1, 8)
        for frame in self.frames:
            self.scale(frame)

    def decode(self, key, components, width):
        count = components * self.n
        before = last = [0] * count
        for k, frame in enumerate(self.frames):
            residuals = integers(frame[key], count, width)
            for i in range(count):
                residuals[i] += residuals[i - 1] if i % self.n else 0
            q = [(r + 2 * a - b) % 2**width for r, a, b in zip(residuals, last, before)]
            before, last = last if k else q, q
            frame[key] = q

    def scale(self, frame):
        """Numbers in place of shares of their range"""
        n, q = self.n, frame["x"]
        axes = [[low * (1 - v / 65535) + high * (v / 65535) for v in q[c * n:(c + 1) * n]]
                for c, (low, high) in enumerate(zip(frame["low"], frame["high"]))]
        frame["x"] = list(zip(*axes))
        frame["speed"] = [frame["fastest"] * v / 255 for v in frame["speed"]]
        assert all(map(math.isfinite, (*frame["speed"], *(c for x in frame["x"] for c in x))))
