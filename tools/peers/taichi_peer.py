"""Taichi: all steps of a run in one kernel, on one thread."""
import time

import numpy as np
import taichi as ti

from methods import Splitting

_ready = []


@ti.data_oriented
class Peer:
    def __init__(self, model, dtype):
        if dtype not in _ready:  # types are explicit, so that one runtime serves both precisions
            if not _ready:
                ti.init(arch=ti.cpu, cpu_max_num_threads=1, fast_math=True, log_level=ti.ERROR)
            _ready.append(dtype)
        self.dtype, self.real = dtype, ti.f32 if dtype == np.float32 else ti.f64
        self.model, (self.n, self.entries) = model, model.neighbour.shape
        self.neighbour = self.constant(model.neighbour, ti.i32)
        self.kw, self.kl = self.constant(model.kw), self.constant(model.kl)
        self.x, self.y, self.v, self.g = (self.vectors(self.n) for _ in range(4))
        self.k = self.vectors((self.n, 12))
        self.g.from_numpy(model.g.astype(dtype))
        self.coefficients = {}

    def constant(self, values, type=None):
        field = ti.field(type or self.real, np.shape(values))
        field.from_numpy(np.asarray(values, np.int32 if type else self.dtype))
        return field

    def vectors(self, shape):
        return ti.Vector.field(3, self.real, shape)

    @ti.func
    def at(self, x: ti.template(), i):
        p, a = x[i], self.g[i]
        for e in ti.static(range(self.entries)):
            d = x[self.neighbour[i, e]] - p
            a += (self.kw[i, e] - self.kl[i, e] * ti.rsqrt(d.dot(d))) * d
        return a

    @ti.func
    def step_pass(self, x: ti.template(), y: ti.template(), hk, hd):
        for i in range(self.n):
            self.v[i] += hk * self.at(x, i)
            y[i] = x[i] + hd * self.v[i]

    @ti.kernel
    def accelerations(self):
        ti.loop_config(serialize=True)
        for i in range(self.n):
            self.y[i] = self.at(self.x, i)

    @ti.kernel
    def splitting(self, kick: ti.template(), drift: ti.template(), start: ti.f64, h64: ti.f64,
                  steps: ti.i32):
        h = ti.cast(h64, self.real)
        ti.loop_config(serialize=True)
        for i in range(self.n):
            self.v[i] += ti.cast(start, self.real) * h * self.at(self.x, i)
        ti.loop_config(serialize=True)
        for pair in range(steps * kick.shape[0] // 2):
            s, t = 2 * pair % kick.shape[0], (2 * pair + 1) % kick.shape[0]
            self.step_pass(self.x, self.y, h * kick[s], h * drift[s])
            self.step_pass(self.y, self.x, h * kick[t], h * drift[t])

    @ti.kernel
    def runge_kutta(self, c: ti.template(), AA: ti.template(), bx: ti.template(), bv: ti.template(),
                    h64: ti.f64, steps: ti.i32):
        h = ti.cast(h64, self.real)
        ti.loop_config(serialize=True)
        for _ in range(steps):
            for s in range(c.shape[0]):
                for i in range(self.n):
                    sum_k = self.v[i] * 0
                    for j in range(s):
                        sum_k += AA[s, j] * self.k[i, j]
                    self.y[i] = self.x[i] + h * (c[s] * self.v[i] + h * sum_k)
                for i in range(self.n):
                    self.k[i, s] = self.at(self.y, i)
            for i in range(self.n):
                sum_x, sum_v = self.v[i] * 0, self.v[i] * 0
                for j in range(c.shape[0]):
                    sum_x += bx[j] * self.k[i, j]
                    sum_v += bv[j] * self.k[i, j]
                self.x[i] += h * (self.v[i] + h * sum_x)
                self.v[i] += h * sum_v

    def acceleration(self, x):
        self.x.from_numpy(np.asarray(x, self.dtype))
        self.accelerations()
        return self.y.to_numpy()

    def run(self, method, h, steps):
        self.x.from_numpy(self.model.x.astype(self.dtype))
        self.v.from_numpy(self.model.v.astype(self.dtype))
        if id(method) not in self.coefficients:
            arrays = method[:2] if isinstance(method, Splitting) else method[:-1]
            self.coefficients[id(method)] = [self.constant(a) for a in arrays]
        arrays = self.coefficients[id(method)]
        ti.sync()
        start = time.process_time()
        if isinstance(method, Splitting):
            self.splitting(*arrays, method.start, h, steps)
        else:
            self.runge_kutta(*arrays, h, steps)
        ti.sync()
        return self.x.to_numpy().astype(float), time.process_time() - start
