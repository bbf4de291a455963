"""The cloths of `msim_bench precision` without damping and impacts, and their data as peers store
them."""
from typing import NamedTuple

import msim
import numpy as np

# particles per side, end in s
SCENES = {"trampoline": (24, 0.1), "folding": (24, 0.5), "stiff": (16, 0.2)}


def build(name, side):
    """As in tools/msim_bench/precision_scenes.c."""
    scene = msim.Scene(gravity=(0, 0, 0 if name == "trampoline" else -9.81))
    inner = range(1, side - 1)
    edge = [i for i in range(side * side) if not (i // side in inner and i % side in inner)]
    cloth = msim.Scene()
    cloth.add_cloth((side, side), (0, 0, 0), (0, 1, 0), (1, 0, 0), mass=0.3,
                    k=1e5 if name == "stiff" else 1e3,
                    pinned=edge if name == "trampoline" else "first_corners")
    v, rest = np.zeros((side * side, 3)), cloth.rest
    if name == "trampoline":
        v[:, 2] = 0.2 * np.sin(np.pi * cloth.x[:, 0]) * np.sin(np.pi * cloth.x[:, 1])
        v[edge] = 0
        rest = 0.9 * rest
    scene.add_particles(cloth.x, cloth.mass, v)
    scene.add_springs(cloth.ij, cloth.k, rest)
    scene.pin(np.flatnonzero(cloth.pinned))
    return scene


class Model(NamedTuple):
    """a_i = g_i + sum_e (kw_ie - kl_ie / |d|) d,  d = x_j - x_i,  j = neighbour_ie.

    kw = k/m_i, kl = k L/m_i, 0 for pinned particles. Rows are padded to the same length by
    neighbours with kw = kl = 0. Neighbours are in ascending order, so that those of consecutive
    particles are mostly consecutive."""

    x: np.ndarray  # (n, 3)
    v: np.ndarray
    g: np.ndarray
    neighbour: np.ndarray  # (n, entries), int32
    kw: np.ndarray
    kl: np.ndarray


def model_of(scene):
    n = len(scene)
    half = np.concatenate([scene.ij, scene.ij[:, ::-1]])
    order = np.lexsort((half[:, 1], half[:, 0]))
    i, j = half[order].T
    entry = np.arange(len(i)) - np.searchsorted(i, i)
    free = ~scene.pinned
    weight = (free / scene.mass)[i] * np.tile(scene.k, 2)[order]
    neighbour = np.repeat((np.arange(n, dtype=np.int32)[:, None] + 1) % n, entry.max() + 1, 1)
    kw, kl = np.zeros(neighbour.shape), np.zeros(neighbour.shape)
    neighbour[i, entry] = j
    kw[i, entry] = weight
    kl[i, entry] = weight * np.tile(scene.rest, 2)[order]
    return Model(scene.x.copy(), scene.v.copy(), free[:, None] * scene.gravity, neighbour, kw, kl)


class Grid(NamedTuple):
    """Springs between particles i and i + offset_e, k and k L in row e at i; w = 1/m, 0 if pinned.

    Only cloths and lattices in the order of their rows have as few offsets as neighbours."""

    offset: np.ndarray
    k: np.ndarray
    kl: np.ndarray
    w: np.ndarray


def grid_of(scene):
    i, j = np.sort(scene.ij, 1).T
    offset, row = np.unique(j - i, return_inverse=True)
    k, kl = np.zeros((len(offset), len(scene))), np.zeros((len(offset), len(scene)))
    k[row, i], kl[row, i] = scene.k, scene.k * scene.rest
    return Grid(offset.astype(np.int64), k, kl, ~scene.pinned / scene.mass)
