"""Data of nodes and elements as the lanes take them: a quantity with k components is an array (k, p), contiguous along the line.

Behind the last node the line goes on, straight on, as if it had no stiffness, weight, drag or mass: what is done there to fill the lanes
adds nothing. p leaves room for the last lanes of nodes and, one further on, of the upper ends of elements.
"""

import numpy as np

from ..compiled import inner, kernel
from .lanes import WIDTH


@inner
def room(n):
    """Length p of the columns of a line of n nodes."""
    return (n // WIDTH + 2) * WIDTH


@inner
def fill_column(a, k, out, beyond=1.0):
    """Component k of a (m, k) into out (p,), the last entry repeated `beyond` times it."""
    m = a.shape[0]
    for i in range(m):
        out[i] = a[i, k]
    for i in range(m, out.shape[0]):
        out[i] = beyond * a[m - 1, k]


@inner
def fill(a, out, beyond=1.0):
    """Transpose of a (m, k) into out (k, p), the last row of a repeated `beyond` times it."""
    for k in range(a.shape[1]):
        fill_column(a, k, out[k], beyond)


@inner
def fill_straight(a, out):
    """Transpose of positions a (m, 3) into out (3, p), going on in the direction of the last two."""
    fill(a, out)
    m = a.shape[0]
    for k in range(3):
        for i in range(m, out.shape[1]):
            out[k, i] += (i - m + 1) * (a[m - 1, k] - a[m - 2, k])


@inner
def take(columns, out):
    """Rows out (m, k) of columns (k, p)."""
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            out[i, k] = columns[k, i]


@kernel
def columns(a, n, beyond):
    """Columns of a (m, k), of a line of n nodes; none of an array without rows."""
    if a.shape[0] == 0:
        return np.empty((a.shape[1], 0))
    out = np.empty((a.shape[1], room(n)))
    fill(a, out, beyond)
    return out


@kernel
def column(a, n, beyond):
    """Column (p,) of a (m,); none of an array without entries."""
    return columns(a.reshape(a.shape[0], 1), n, beyond)[0]


@inner
def vector_of(columns, k, at):
    """Components k, k + 1, k + 2 of columns at a node or a group of nodes."""
    return (columns[k, at], columns[k + 1, at], columns[k + 2, at])


@inner
def attitude(quaternion, at):
    """Quaternion, from columns, of a node or a group of nodes."""
    return (quaternion[0, at], quaternion[1, at], quaternion[2, at], quaternion[3, at])


@inner
def chord(position, a, b):
    """phi_b - phi_a from columns of positions, or of displacements."""
    return (position[0, b] - position[0, a], position[1, b] - position[1, a], position[2, b] - position[2, a])
