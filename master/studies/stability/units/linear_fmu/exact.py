"""Exact step of z' = A z + b u under a held u, with the integrals of z and of a dissipated power z^T Q z.

The integral of the power follows C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Autom.
Control 23 (1978); the constant u is one more state.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import expm


class Transition(NamedTuple):
    """Maps of (z, u) at the start of a step."""

    end: np.ndarray  # (n, n + 1) to z at the end
    integral: np.ndarray  # (n, n + 1) to the integral of z over the step
    loss: np.ndarray  # (n + 1, n + 1) quadratic form of the dissipated energy


def transition(A: np.ndarray, b: np.ndarray, Q: np.ndarray, h: float) -> Transition:
    """The step of length h [s]; A (n, n), b (n,), Q (n + 1, n + 1) over (z, u)."""
    n = len(b)
    held = np.zeros((n + 1, n + 1))
    held[:n, :n], held[:n, n] = A, b
    power = np.zeros((2 * n + 2, 2 * n + 2))
    power[: n + 1, : n + 1], power[: n + 1, n + 1 :], power[n + 1 :, n + 1 :] = -held.T, Q, held
    blocks = expm(h * power)
    flow = blocks[n + 1 :, n + 1 :]
    summed = np.zeros((2 * n + 2, 2 * n + 2))
    summed[: n + 1, : n + 1], summed[: n + 1, n + 1 :] = held, np.eye(n + 1)
    return Transition(flow[:n], expm(h * summed)[:n, n + 1 :], flow.T @ blocks[: n + 1, n + 1 :])
