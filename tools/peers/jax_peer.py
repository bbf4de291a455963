"""JAX: all steps of a run in one compiled loop, on one thread."""
import os
import time

os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
import jax
import jax.numpy as jnp
import numpy as np

from methods import Splitting

jax.config.update("jax_enable_x64", True)


@jax.jit
def at(x, neighbour, kw, kl, g):
    """x: (3, n); the rest of the model transposed likewise, so that XLA computes long rows."""
    d = x[:, neighbour] - x[:, None]
    return g + ((kw - kl * jax.lax.rsqrt((d * d).sum(0))) * d).sum(1)


@jax.jit
def splitting(x, v, springs, kick, drift, start, h, steps):
    def step(_, state):
        def stage(s, xv):
            v = xv[1] + h * kick[s] * at(xv[0], *springs)
            return xv[0] + h * drift[s] * v, v
        return jax.lax.fori_loop(0, len(kick), stage, state)
    return jax.lax.fori_loop(0, steps, step, (x, v + start * h * at(x, *springs)))[0]


@jax.jit
def runge_kutta(x, v, springs, c, AA, bx, bv, h, steps):
    def step(_, state):
        x, v = state
        k = jnp.zeros((len(c), *x.shape), x.dtype)
        for s in range(len(c)):
            shift = h * (c[s] * v + h * jnp.tensordot(AA[s, :s], k[:s], 1))
            k = k.at[s].set(at(x + shift, *springs))
        return x + h * (v + h * jnp.tensordot(bx, k, 1)), v + h * jnp.tensordot(bv, k, 1)
    return jax.lax.fori_loop(0, steps, step, (x, v))[0]


class Peer:
    def __init__(self, model, dtype):
        self.dtype = dtype
        self.x, self.v = jnp.array(model.x.T, dtype), jnp.array(model.v.T, dtype)
        self.springs = (jnp.array(model.neighbour.T), jnp.array(model.kw.T, dtype),
                        jnp.array(model.kl.T, dtype), jnp.array(model.g.T, dtype))

    def acceleration(self, x):
        return np.asarray(at(jnp.array(x.T, self.dtype), *self.springs)).T

    def run(self, method, h, steps):
        given = [jnp.array(c, self.dtype) for c in method[:-1]]
        function = splitting if isinstance(method, Splitting) else runge_kutta
        start = time.process_time()
        x = function(self.x, self.v, self.springs, *given, self.dtype(h), steps).block_until_ready()
        return np.asarray(x).T.astype(float), time.process_time() - start
