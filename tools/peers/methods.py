"""Integration methods of the peers: coefficients from the literature.

Splitting methods alternate v += h kick a(x) and x += h drift v. Runge-Kutta methods are written for
accelerations a(x) alone (Nystroem form): X_i = x + c_i h v + h^2 sum_j AA_ij k_j, k_i = a(X_i)."""
from typing import NamedTuple

import numpy as np
from scipy.integrate import DOP853


class Splitting(NamedTuple):
    """A step is a pass for each kick with the drift that follows. The last kick of a symmetric step
    is at the positions of the first one of the next step and is added to that one; `start`, times
    h a(x), corrects v before the first step."""

    kick: np.ndarray
    drift: np.ndarray
    start: float
    order: int


class RungeKutta(NamedTuple):
    """x' = x + h v + h^2 sum_j bx_j k_j, v' = v + h sum_j bv_j k_j."""

    c: np.ndarray
    AA: np.ndarray
    bx: np.ndarray
    bv: np.ndarray
    order: int


def _symmetric(kicks, drifts, order):
    kick, drift = np.array(kicks), np.array(drifts)
    return Splitting(np.append(2 * kick[0], kick[1:-1]), drift, -kick[0], order)


def _mirrored(kicks, drifts, order):
    """From the first half of the coefficients: the middle kick and drifts follow from sums of 1."""
    drifts = [*drifts, 0.5 - sum(drifts)]
    if order == 4:
        return _symmetric([*kicks, 1 - 2 * sum(kicks), *kicks[::-1]], drifts + drifts[::-1], order)
    middle = 1 - 2 * sum(drifts[:-1])
    kicks = [*kicks, 0.5 - sum(kicks)]
    return _symmetric(kicks + kicks[::-1], [*drifts[:-1], middle, *drifts[-2::-1]], order)


def _runge_kutta(c, A, b, order):
    return RungeKutta(np.array(c), A @ A, b @ A, np.array(b), order)


METHODS = {
    "DOP853": _runge_kutta(DOP853.C, DOP853.A, DOP853.B, 8),
    # Blanes and Moan, J. Comput. Appl. Math. 142 (2002) 313: SRKN_6^4 and SRKN_11^6
    "Blanes-Moan 6": _mirrored([0.0414649985182624, 0.198128671918067, -0.0400061921041533,
                                0.0752539843015807, -0.0115113874206879],
                               [0.123229775946271, 0.290553797799558, -0.127049212625417,
                                -0.246331761062075, 0.357208872795928], 6),
    "Blanes-Moan 4": _mirrored([0.0829844064174052, 0.396309801498368, -0.0390563049223486],
                               [0.245298957184271, 0.604872665711080], 4),
    "RK4": _runge_kutta([0, 0.5, 0.5, 1], np.diag([0.5, 0.5, 1], -1),
                        np.array([1, 2, 2, 1]) / 6, 4),
    "velocity Verlet": Splitting(np.ones(1), np.ones(1), -0.5, 2),
    "symplectic Euler": Splitting(np.ones(1), np.ones(1), 0.0, 1),
}
