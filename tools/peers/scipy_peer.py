"""SciPy's solvers with error control; forces by NumPy, or by Numba as the most a user can do."""
import time

import numpy as np
from scipy.integrate import solve_ivp


class Peer:
    def __init__(self, model, dtype, compiled=False):
        self.model, self.n = model, model.x.size
        self.x = np.ascontiguousarray(model.x.T)
        self.v = np.ascontiguousarray(model.v.T)
        # (entries, n): long rows
        self.neighbour, self.kw, self.kl, self.g = (np.ascontiguousarray(a.T) for a in (
            model.neighbour.astype(np.intp), model.kw, model.kl, model.g))
        self.compiled = None
        if compiled:
            import numba_peer
            self.compiled = numba_peer.Peer(model, np.float64)

    def at(self, x, a):
        """The accelerations at x, (3, n), into a."""
        if self.compiled:
            self.compiled.functions[0](x, self.compiled.springs, a)
            return
        d = np.take(x, self.neighbour, 1) - x[:, None]
        factor = self.kw - self.kl / np.sqrt(np.einsum("cei,cei->ei", d, d))
        np.einsum("ei,cei->ci", factor, d, out=a)
        a += self.g

    def acceleration(self, x):
        a = np.empty_like(self.x)
        self.at(np.ascontiguousarray(x.T), a)
        return a.T

    def slopes(self, _, y):
        f = np.empty_like(y)
        f[:self.n] = y[self.n:]
        self.at(y[:self.n].reshape(3, -1), f[self.n:].reshape(3, -1))
        return f

    def run(self, method, tol, t_end):
        """method: a name of solve_ivp; tol: absolute, in m and m/s, and relative."""
        y = np.concatenate([self.x.ravel(), self.v.ravel()])
        start = time.process_time()
        end = solve_ivp(self.slopes, (0, t_end), y, method, t_eval=[t_end], rtol=tol, atol=tol)
        return end.y[:self.n, -1].reshape(3, -1).T, time.process_time() - start
