"""Collocation in three stages: Gauss (order 6, for the arm) and Radau IIA (order 5, for the stiff cylinder).

Tables: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, Tables IV.5.2 and IV.5.6.
"""

from __future__ import annotations

import numpy as np

_G, _R = np.sqrt(15.0), np.sqrt(6.0)
GAUSS_NODES = np.array([0.5 - _G / 10, 0.5, 0.5 + _G / 10])
RADAU_NODES = np.array([(4 - _R) / 10, (4 + _R) / 10, 1.0])


def table(nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (3, 3) and weights (3,): integrals of the nodes' Lagrange polynomials to each node and to 1."""
    powers = np.vander(nodes, increasing=True)
    ends = np.append(nodes, 1.0)[:, None]
    order = np.arange(1, 4)
    integrals = (ends**order / order) @ np.linalg.inv(powers)
    return integrals[:3], integrals[3]
