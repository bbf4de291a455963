"""Writes explicit_*.json of this folder: results of six explicit methods with 40 digits.

usage: python3 explicit.py FOLDER

Each method is written from its publication only, as a loop over springs in plain Python, and runs
in decimal arithmetic; `noise` is the change by double precision, from which the tolerances follow.

  dop853           Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.5: the
                   weights of Dormand and Prince's order 8, here as a method for y' = f(y)
  rkc              Sommeijer, Shampine and Verwer, J. Comput. Appl. Math. 88 (1998) 315: Chebyshev
                   polynomials by cosh, not by the recurrence
  rkn6             Blanes and Moan, J. Comput. Appl. Math. 142 (2002) 313, SRKN_11^6
  force-gradient   Omelyan, Mryglod and Folk, Phys. Rev. E 66 (2002) 026701: the coefficients
                   follow from order 4, and order 6 for an oscillator
  respa            Tuckerman, Berne and Martyna, J. Chem. Phys. 97 (1992) 1990
  takahashi-imada  J. Phys. Soc. Japan 53 (1984) 3765: the frequency of an oscillator in closed form
"""
import json
import math
import sys
from decimal import Decimal, getcontext
from pathlib import Path

getcontext().prec = 40

# ---- forces, with numbers of the type `num`, Decimal or float ----


def root(a):
    return a.sqrt() if isinstance(a, Decimal) else math.sqrt(a)


def add_springs(springs, x, v, f, num):
    for i, j, k, rest, damping in springs:
        d = [x[j][c] - x[i][c] for c in range(3)]
        length = root(sum(a * a for a in d))
        along = sum(d[c] * (v[j][c] - v[i][c]) for c in range(3)) / length
        pull = num(k) * (length - num(rest)) + num(damping) * along
        for c in range(3):
            f[i][c] += pull * d[c] / length
            f[j][c] -= pull * d[c] / length


def acceleration(scene, num, springs=None, outer=True):
    """a(x, v) by the given springs, or all; outer: with gravity and drag."""
    springs = scene["springs"] if springs is None else springs

    def a(x, v):
        f = [[num(0)] * 3 for _ in x]
        add_springs(springs, x, v, f, num)
        for p, mass in enumerate(scene["mass"]):
            for c in range(3):
                f[p][c] /= num(mass)
                if outer:
                    f[p][c] += num(scene["gravity"][c]) - num(scene["drag"]) * v[p][c] / num(mass)
            if p in scene["pinned"]:
                f[p] = [num(0)] * 3
        return f
    return a


def add(base, *terms):
    """base + sum of weight * vector"""
    return [[base[p][c] + sum(w * y[p][c] for w, y in terms) for c in range(3)]
            for p in range(len(base))]


# ---- Runge-Kutta: y = (x, v), f = (v, a) ----

DOP853 = [  # the coefficients of the stages; the weights of the result last
    {},
    {0: "5.26001519587677318785587544488e-2"},
    {0: "1.97250569845378994544595329183e-2", 1: "5.91751709536136983633785987549e-2"},
    {0: "2.95875854768068491816892993775e-2", 2: "8.87627564304205475450678981324e-2"},
    {0: "2.41365134159266685502369798665e-1", 2: "-8.84549479328286085344864962717e-1",
     3: "9.24834003261792003115737966543e-1"},
    {0: "3.7037037037037037037037037037e-2", 3: "1.70828608729473871279604482173e-1",
     4: "1.25467687566822425016691814123e-1"},
    {0: "3.7109375e-2", 3: "1.70252211019544039314978060272e-1",
     4: "6.02165389804559606850219397283e-2", 5: "-1.7578125e-2"},
    {0: "3.70920001185047927108779319836e-2", 3: "1.70383925712239993810214054705e-1",
     4: "1.07262030446373284651809199168e-1", 5: "-1.53194377486244017527936158236e-2",
     6: "8.27378916381402288758473766002e-3"},
    {0: "6.24110958716075717114429577812e-1", 3: "-3.36089262944694129406857109825",
     4: "-8.68219346841726006818189891453e-1", 5: "2.75920996994467083049415600797e1",
     6: "2.01540675504778934086186788979e1", 7: "-4.34898841810699588477366255144e1"},
    {0: "4.77662536438264365890433908527e-1", 3: "-2.48811461997166764192642586468",
     4: "-5.90290826836842996371446475743e-1", 5: "2.12300514481811942347288949897e1",
     6: "1.52792336328824235832596922938e1", 7: "-3.32882109689848629194453265587e1",
     8: "-2.03312017085086261358222928593e-2"},
    {0: "-9.3714243008598732571704021658e-1", 3: "5.18637242884406370830023853209",
     4: "1.09143734899672957818500254654", 5: "-8.14978701074692612513997267357",
     6: "-1.85200656599969598641566180701e1", 7: "2.27394870993505042818970056734e1",
     8: "2.49360555267965238987089396762", 9: "-3.0467644718982195003823669022"},
    {0: "2.27331014751653820792359768449", 3: "-1.05344954667372501984066689879e1",
     4: "-2.00087205822486249909675718444", 5: "-1.79589318631187989172765950534e1",
     6: "2.79488845294199600508499808837e1", 7: "-2.85899827713502369474065508674",
     8: "-8.87285693353062954433549289258", 9: "1.23605671757943030647266201528e1",
     10: "6.43392746015763530355970484046e-1"},
    {0: "5.42937341165687622380535766363e-2", 5: "4.45031289275240888144113950566",
     6: "1.89151789931450038304281599044", 7: "-5.8012039600105847814672114227",
     8: "3.1116436695781989440891606237e-1", 9: "-1.52160949662516078556178806805e-1",
     10: "2.01365400804030348374776537501e-1", 11: "4.47106157277725905176885569043e-2"},
]


def dop853(scene, num, h):
    a = acceleration(scene, num)

    def step(x, v):
        slopes = []
        for row in DOP853:
            weights = [(h * num(w), slopes[j]) for j, w in row.items()]
            stage = (add(x, *((w, s[0]) for w, s in weights)),
                     add(v, *((w, s[1]) for w, s in weights)))
            slopes.append((stage[1], a(*stage)))
        return stage
    return step


def chebyshev(j, w):
    """T_j, T_j' and T_j'' at w > 1, from T_j = cosh(j arcosh w)"""
    s = root(w * w - 1)
    both = (w + s) ** j, (w - s) ** j
    t, u = (both[0] + both[1]) / 2, (both[0] - both[1]) / 2
    first = j * u / s
    return t, first, (j * j * t - w * first) / (s * s)


def rkc(scene, num, h, stages):
    a = acceleration(scene, num)
    w0 = 1 + num(2) / 13 / stages ** 2
    t = [chebyshev(j, w0) for j in range(stages + 1)]
    w1 = t[stages][1] / t[stages][2]
    b = [t[j][2] / t[j][1] ** 2 if j > 1 else None for j in range(stages + 1)]
    b[0], b[1] = b[2], 1 / w0

    def step(x, v):
        f = v, a(x, v)
        y = [(x, v), (add(x, (b[1] * w1 * h, f[0])), add(v, (b[1] * w1 * h, f[1])))]
        for j in range(2, stages + 1):
            mu, nu, m = 2 * b[j] * w0 / b[j - 1], -b[j] / b[j - 2], 2 * b[j] * w1 / b[j - 1]
            g = -(1 - b[j - 1] * t[j - 1][0]) * m
            last = y[-1][1], a(*y[-1])
            y.append(tuple(add(start, (mu, y[-1][k]), (-mu, start), (nu, y[-2][k]), (-nu, start),
                               (m * h, last[k]), (g * h, f[k]))
                           for k, start in enumerate((x, v))))
        return y[-1]
    return step


# ---- composition methods ----


def kicks_and_drifts(scene, num, h, b, d, gradient):
    a = acceleration(scene, num)

    def step(x, v):
        for i, kick in enumerate(b):
            at = add(x, (gradient * h * h, a(x, v))) if gradient and 2 * i == len(d) else x
            v = add(v, (kick * h, a(at, v)))
            if i < len(d):
                x = add(x, (d[i] * h, v))
        return x, v
    return step


def rkn6(scene, num, h):
    b = [num(s) for s in ("0.0414649985182624", "0.198128671918067", "-0.0400061921041533",
                          "0.0752539843015807", "-0.0115113874206879")]
    d = [num(s) for s in ("0.123229775946271", "0.290553797799558", "-0.127049212625417",
                          "-0.246331761062075", "0.357208872795928")]
    b.append(1 / num(2) - sum(b))
    return kicks_and_drifts(scene, num, h, b + b[::-1], d + [1 - 2 * sum(d)] + d[::-1], 0)


def oscillator_defects(unknowns):
    """The step of an oscillator minus the exact rotation: coefficients of z^4, z^6 and z^3, z^5."""
    a1, b1, b2, g = unknowns
    half = Decimal(1) / 2
    b, d = [b1, b2, 1 - 2 * (b1 + b2), b2, b1], [a1, half - a1, half - a1, a1]
    position, momentum = [[1], [0]], [[0], [1]]  # polynomials in z, of x0 and of v0/w

    def take(to, weight, power, source):
        for p, q in zip(to, source):
            p += [Decimal(0)] * (len(q) + power - len(p))
            for i, value in enumerate(q):
                p[i + power] += weight * value
    for i, kick in enumerate(b):
        at = [list(p) for p in position]
        if i == 2:
            take(at, -g, 2, position)
        take(momentum, -kick, 1, at)
        if i < 4:
            take(position, d[i], 1, momentum)
    return [position[0][4] - Decimal(1) / 24, position[0][6] + Decimal(1) / 720,
            position[1][3] + Decimal(1) / 6, position[1][5] - Decimal(1) / 120]


def solve(matrix, right):
    """Gaussian elimination with pivots"""
    n, rows = len(right), [row + [r] for row, r in zip(matrix, right)]
    for k in range(n):
        rows[k:] = sorted(rows[k:], key=lambda row: -abs(row[k]))
        for i in range(k + 1, n):
            rows[i] = [a - rows[i][k] / rows[k][k] * b for a, b in zip(rows[i], rows[k])]
    y = [Decimal(0)] * n
    for k in reversed(range(n)):
        y[k] = (rows[k][n] - sum(rows[k][j] * y[j] for j in range(k + 1, n))) / rows[k][k]
    return y


def force_gradient_numbers():
    """Newton's method with difference quotients, from near the published root"""
    u, small = [Decimal(s) for s in ("0.24", "0.09", "0.29", "0.023")], Decimal("1e-15")
    for _ in range(12):
        f = oscillator_defects(u)
        columns = [[(p - q) / small for p, q in zip(oscillator_defects(
            [w + small * (i == k) for i, w in enumerate(u)]), f)] for k in range(4)]
        u = [w - s for w, s in zip(u, solve([list(row) for row in zip(*columns)], f))]
    assert max(map(abs, oscillator_defects(u))) < Decimal("1e-35")
    return u


def force_gradient(scene, num, h):
    a1, b1, b2, g = (num(w) for w in force_gradient_numbers())
    half = 1 / num(2)
    return kicks_and_drifts(scene, num, h, [b1, b2, 1 - 2 * (b1 + b2), b2, b1],
                            [a1, half - a1, half - a1, a1], g)


def respa(scene, num, h, stiff, inner):
    springs = scene["springs"]
    hard = acceleration(scene, num, [springs[e] for e in stiff], outer=False)
    soft = acceleration(scene, num, [s for e, s in enumerate(springs) if e not in stiff])
    small = h / inner

    def step(x, v):
        v = add(v, (h / 2, soft(x, v)))
        for _ in range(inner):
            v = add(v, (small / 2, hard(x, v)))
            x = add(x, (small, v))
            v = add(v, (small / 2, hard(x, v)))
        return x, add(v, (h / 2, soft(x, v)))
    return step


# ---- scenes and files ----

THREE = {"n": 3, "mass": [1.0, 0.5, 2.0],
         "x": [[0.0, 0.0, 0.0], [1.1, 0.1, 0.2], [1.9, -0.6, 0.4]],
         "v": [[0.1, 0.2, -0.3], [0.4, -1.0, 0.5], [0.3, 0.3, 0.0]], "pinned": [],
         "springs": [[0, 1, 120.0, 1.0, 0.0], [1, 2, 80.0, 1.0, 0.0]],
         "gravity": [0.0, 0.5, -9.81], "drag": 0.0, "planes": []}
DAMPED = {**THREE, "springs": [[0, 1, 120.0, 1.0, 0.3], [1, 2, 80.0, 1.0, 0.2]], "drag": 0.1}
# By Gershgorin's bound, (2 (60 + 40) N s/m + drag)/0.5 kg, h = 0.05 s takes 6 stages.
VISCOUS = {**THREE, "springs": [[0, 1, 120.0, 1.0, 60.0], [1, 2, 80.0, 1.0, 40.0]], "drag": 1.0}
# One spring has h w = 3.9, and takes 4 steps, each half as long as the longest stable one.
CORD = {"n": 8, "mass": [1.0] * 8, "pinned": [0],
        "x": [[0.5 * i, 0.05 * (i % 3), -0.02 * i * i] for i in range(8)],
        "v": [[0.0, 0.1 * i, -0.1 * i] for i in range(8)],
        "springs": [[i, i + 1, 19000.0 if i == 4 else 50.0, 0.5, 0.0] for i in range(7)],
        "gravity": [0.0, 0.0, -9.81], "drag": 0.0, "planes": []}
OSCILLATOR = {"n": 2, "mass": [1.0, 1.0], "x": [[0.0, 0.0, 0.0], [0.3, -0.2, 0.1]],
              "v": [[0.0, 0.0, 0.0], [1.0, 2.0, -0.5]], "pinned": [0],
              "springs": [[0, 1, 100.0, 0.0, 0.0]], "gravity": [0.0, 0.0, 0.0], "drag": 0.0,
              "planes": []}


def integrate(make, scene, num, h, steps):
    step = make(scene, num, num(h))
    x, v = ([[num(c) for c in row] for row in scene[key]] for key in "xv")
    for _ in range(steps):
        x, v = step(x, v)
    return [[[float(c) for c in row] for row in y] for y in (x, v)]


def oscillate(z, steps, x0, v0, w):
    """sin(theta/2) = z/2 sqrt(1 - z^2/12) for a step of z = h w"""
    theta = steps * 2 * math.asin(z / 2 * math.sqrt(1 - z * z / 12))
    return (x0 * math.cos(theta) + v0 / w * math.sin(theta),
            v0 * math.cos(theta) - w * x0 * math.sin(theta))


def takahashi_imada(scene, h, steps):
    w = math.sqrt(scene["springs"][0][2])
    pairs = [[oscillate(h * w, steps, x0, v0, w) if p else (x0, v0)
              for x0, v0 in zip(scene["x"][p], scene["v"][p])] for p in range(2)]
    return [[[pair[k] for pair in row] for row in pairs] for k in (0, 1)]


def largest(rows, other=None):
    other = other or [[0.0] * 3] * len(rows)
    return max(abs(a - b) for row, row2 in zip(rows, other) for a, b in zip(row, row2))


def run(name, h, steps, exact, rough):
    tolerances = [max(50 * largest(a, b), 1e-12 * max(1, largest(a)))
                  for a, b in zip(exact, rough)]
    return {"id": f"{name}/N={steps}", "integrator": name, "options": {}, "h": h, "steps": steps,
            "x": exact[0], "v": exact[1], "tol_x": tolerances[0], "tol_v": tolerances[1],
            "flags": []}


def computed(name, make, scene, h, steps):
    return run(name, h, steps, integrate(make, scene, Decimal, h, steps),
               integrate(make, scene, float, h, steps))


def main(folder):
    both = [(0.02, 50), (0.005, 200)]
    cases = {
        "smooth": ("no damping and no drag", THREE,
                   [computed(name, make, THREE, h, n) for h, n in both for name, make in
                    (("dop853", dop853), ("rkn6", rkn6), ("force_gradient", force_gradient))]),
        "damped": ("dampers and drag", DAMPED,
                   [computed("dop853", dop853, DAMPED, h, n) for h, n in both] +
                   [computed("rkc", lambda s, num, h: rkc(s, num, h, 2), DAMPED, h, n)
                    for h, n in both]),
        "viscous": ("strong dampers", VISCOUS,
                    [computed("rkc", lambda s, num, h: rkc(s, num, h, 6), VISCOUS, 0.05, 20),
                     computed("dop853", dop853, VISCOUS, 0.01, 100)]),
        "cord": ("one stiff spring", CORD,
                 [computed("respa", lambda s, num, h: respa(s, num, h, [4], 4), CORD, 0.02,
                           50)]),
        "oscillator": ("a spring of rest length 0", OSCILLATOR,
                       [run("takahashi_imada", h, n, *[takahashi_imada(OSCILLATOR, h, n)] * 2)
                        for h, n in ((0.002, 500), (0.001, 1000))])}
    for name, (description, scene, runs) in cases.items():
        t_end = runs[0]["h"] * runs[0]["steps"]
        case = {"format": "msim-oracle-1", "name": f"explicit_{name}", "description": description,
                "scene": scene, "t_end": t_end, "truth": None, "runs": runs}
        text = json.dumps(case, separators=(",", ":"))
        text = text.replace('{"id"', '\n{"id"') + "\n"
        (Path(folder) / f"explicit_{name}.json").write_text(text)


if __name__ == "__main__":
    main(sys.argv[1])
