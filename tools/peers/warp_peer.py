"""NVIDIA Warp on the CPU: all steps of a run in one kernel of one thread."""
import time

import numpy as np
import warp as wp

from methods import Splitting

wp.config.quiet = True
wp.config.enable_backward = False
_compiled = {}


def compile_for(dtype, entries):
    """Kernels for a precision and a number of neighbours, a constant so that loops unroll."""
    if (dtype, entries) in _compiled:
        return _compiled[dtype, entries]
    real, vector = (wp.float32, wp.vec3f) if dtype == np.float32 else (wp.float64, wp.vec3d)
    vectors, table, count = wp.array(dtype=vector), wp.array2d(dtype=real), wp.constant(entries)
    reals, indices = wp.array(dtype=real), wp.array2d(dtype=wp.int32)
    stages = wp.array2d(dtype=vector)

    @wp.func
    def at(x: vectors, i: int, neighbour: indices, kw: table, kl: table, g: vectors):
        p = x[i]
        a = g[i]
        for e in range(count):
            d = x[neighbour[i, e]] - p
            a += (kw[i, e] - kl[i, e] / wp.sqrt(wp.dot(d, d))) * d
        return a

    @wp.func
    def step_pass(x: vectors, y: vectors, v: vectors, neighbour: indices, kw: table, kl: table,
                  g: vectors, hk: real, hd: real):
        for i in range(x.shape[0]):
            w = v[i] + hk * at(x, i, neighbour, kw, kl, g)
            v[i] = w
            y[i] = x[i] + hd * w

    @wp.kernel(module="unique")
    def accelerations(x: vectors, a: vectors, neighbour: indices, kw: table, kl: table, g: vectors):
        for i in range(x.shape[0]):
            a[i] = at(x, i, neighbour, kw, kl, g)

    @wp.kernel(module="unique")
    def splitting(x: vectors, y: vectors, v: vectors, neighbour: indices, kw: table, kl: table,
                  g: vectors, kick: reals, drift: reals, start: real, h: real, steps: int):
        for i in range(x.shape[0]):
            v[i] = v[i] + start * h * at(x, i, neighbour, kw, kl, g)
        n = kick.shape[0]
        for pair in range(steps * n // 2):
            s = 2 * pair % n
            t = (2 * pair + 1) % n
            step_pass(x, y, v, neighbour, kw, kl, g, h * kick[s], h * drift[s])
            step_pass(y, x, v, neighbour, kw, kl, g, h * kick[t], h * drift[t])

    @wp.kernel(module="unique")
    def runge_kutta(x: vectors, y: vectors, v: vectors, neighbour: indices, kw: table, kl: table,
                    g: vectors, k: stages, c: reals, AA: table, bx: reals, bv: reals, h: real,
                    steps: int):
        for _ in range(steps):
            for s in range(c.shape[0]):
                for i in range(x.shape[0]):
                    q = c[s] * v[i]
                    for j in range(s):
                        q += (h * AA[s, j]) * k[i, j]
                    y[i] = x[i] + h * q
                for i in range(x.shape[0]):
                    k[i, s] = at(y, i, neighbour, kw, kl, g)
            for i in range(x.shape[0]):
                q = v[i]
                w = v[i]
                for j in range(c.shape[0]):
                    q += (h * bx[j]) * k[i, j]
                    w += (h * bv[j]) * k[i, j]
                x[i] = x[i] + h * q
                v[i] = w

    _compiled[dtype, entries] = accelerations, splitting, runge_kutta
    return _compiled[dtype, entries]


class Peer:
    def __init__(self, model, dtype):
        self.dtype, self.model = dtype, model
        self.real, self.vector = ((wp.float32, wp.vec3f) if dtype == np.float32
                                  else (wp.float64, wp.vec3d))
        self.kernels = compile_for(dtype, model.neighbour.shape[1])
        self.springs = [wp.array(model.neighbour, dtype=wp.int32, device="cpu"),
                        self.reals(model.kw), self.reals(model.kl), self.vectors(model.g)]
        self.y = self.vectors(model.x)
        self.k = wp.zeros((len(model.x), 12), self.vector, device="cpu")

    def reals(self, values):
        return wp.array(np.asarray(values, self.dtype), dtype=self.real, device="cpu")

    def vectors(self, values):
        return wp.array(values.astype(self.dtype), dtype=self.vector, device="cpu")

    def acceleration(self, x):
        wp.launch(self.kernels[0], 1, [self.vectors(x), self.y, *self.springs], device="cpu")
        return self.y.numpy().copy()

    def run(self, method, h, steps):
        x, v = self.vectors(self.model.x), self.vectors(self.model.v)
        if isinstance(method, Splitting):
            kernel, more = self.kernels[1], [*map(self.reals, method[:2]), self.real(method.start)]
        else:
            kernel, more = self.kernels[2], [self.k, *map(self.reals, method[:-1])]
        given = [x, self.y, v, *self.springs, *more, self.real(h), steps]
        start = time.process_time()
        wp.launch(kernel, 1, given, device="cpu")
        return x.numpy().astype(float), time.process_time() - start
