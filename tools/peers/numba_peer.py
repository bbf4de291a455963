"""Numba: whole runs in compiled code, of any springs or of those of a regular grid."""
import time

import numba
import numpy as np

from methods import Splitting

jit = numba.njit(fastmath=True, error_model="numpy")


def gathered(entries):
    """Accelerations with the springs of each particle; their number is a constant, so that LLVM
    computes several at once."""
    @jit
    def accelerations(x, springs, a):
        neighbour, kw, kl, g = springs
        for i in range(x.shape[1]):
            px, py, pz = x[0, i], x[1, i], x[2, i]
            ax, ay, az = g[0, i], g[1, i], g[2, i]
            for e in range(entries):
                j = neighbour[i, e]
                dx, dy, dz = x[0, j] - px, x[1, j] - py, x[2, j] - pz
                f = kw[i, e] - kl[i, e] / np.sqrt(dx * dx + dy * dy + dz * dz)
                ax += f * dx
                ay += f * dy
                az += f * dz
            a[0, i], a[1, i], a[2, i] = ax, ay, az
    return accelerations


@jit
def on_grid(x, springs, a):
    """Accelerations with springs between i and i + offset: each force is computed once, and all
    loops are over consecutive numbers. Terms of pairs without a spring are 0."""
    offset, k, kl, w, g, force = springs
    n = x.shape[1]
    a[:] = 0
    fx, fy, fz = force[0], force[1], force[2]
    for e in range(len(offset)):
        count, at = n - offset[e], offset[e]
        ke, le = k[e], kl[e]
        x0, y0, z0, x1, y1, z1 = x[0], x[1], x[2], x[0, at:], x[1, at:], x[2, at:]
        for i in range(count):
            dx, dy, dz = x1[i] - x0[i], y1[i] - y0[i], z1[i] - z0[i]
            f = ke[i] - le[i] / np.sqrt(dx * dx + dy * dy + dz * dz)
            fx[i], fy[i], fz[i] = f * dx, f * dy, f * dz
        for c in range(3):
            begin, end, f = a[c], a[c, at:], force[c]
            for i in range(count):
                begin[i] += f[i]
            for i in range(count):
                end[i] -= f[i]
    for c in range(3):
        for i in range(n):
            a[c, i] = a[c, i] * w[i] + g[c, i]


def loops(accelerations):
    """Both kinds of methods, compiled with the accelerations."""
    @jit
    def splitting(x, v, springs, kick, drift, start, h, steps):
        a = np.empty_like(x)
        flat_x, flat_v, flat_a = x.reshape(-1), v.reshape(-1), a.reshape(-1)
        accelerations(x, springs, a)
        v += start * h * a
        for _ in range(steps):
            for s in range(len(kick)):
                accelerations(x, springs, a)
                hk, hd = h * kick[s], h * drift[s]
                for i in range(flat_x.size):
                    flat_v[i] += hk * flat_a[i]
                    flat_x[i] += hd * flat_v[i]
        return x

    @jit
    def runge_kutta(x, v, springs, c, AA, bx, bv, h, steps):
        k = np.zeros((len(c), x.size), x.dtype)
        flat_x, flat_v, stage = x.reshape(-1), v.reshape(-1), x.copy()
        flat = stage.reshape(-1)
        for _ in range(steps):
            for s in range(len(c)):
                flat[:] = flat_x + (h * c[s]) * flat_v
                if s > 1:
                    flat += (h * h) * np.dot(AA[s, :s], k[:s])
                accelerations(stage, springs, k[s].reshape(x.shape))
            flat_x += h * flat_v + (h * h) * np.dot(bx, k)
            flat_v += h * np.dot(bv, k)
        return x

    return accelerations, splitting, runge_kutta


_any, _grid = {}, loops(on_grid)


class Peer:
    """grid: the springs in its form, else None."""

    def __init__(self, model, dtype, grid=None):
        self.dtype = dtype
        self.x, self.v, g = (np.ascontiguousarray(a.T, dtype) for a in (model.x, model.v, model.g))
        if grid:
            self.functions = _grid
            self.springs = (grid.offset, *(a.astype(dtype) for a in (grid.k, grid.kl, grid.w)), g,
                            np.empty_like(g))
        else:
            entries = model.neighbour.shape[1]
            if entries not in _any:
                _any[entries] = loops(gathered(entries))
            self.functions = _any[entries]
            self.springs = (model.neighbour.astype(np.int64), model.kw.astype(dtype),
                            model.kl.astype(dtype), g)

    def acceleration(self, x):
        a = np.empty_like(self.x)
        self.functions[0](np.ascontiguousarray(x.T, self.dtype), self.springs, a)
        return a.T

    def run(self, method, h, steps):
        """x at the end, and the CPU time of the steps in s. steps is even in all peers."""
        coefficients = [np.asarray(c, self.dtype) for c in method[:-1]]
        function = self.functions[2]
        if isinstance(method, Splitting):
            function, coefficients[2] = self.functions[1], self.dtype(method.start)
        x, v = self.x.copy(), self.v.copy()
        start = time.process_time()
        x = function(x, v, self.springs, *coefficients, self.dtype(h), steps)
        return x.T.astype(float), time.process_time() - start
