"""Velocity of the water at a depth: the current's profile, linear between levels."""

from ..compiled import inner


@inner
def current_at(z, levels, velocities):
    """Current (3,) at depth coordinate z: linear between `levels` (n,), ascending, constant beyond; `velocities` (n, 3) [m/s]."""
    x, y, w = velocities[0, 0] + 0.0 * z, velocities[0, 1] + 0.0 * z, velocities[0, 2] + 0.0 * z
    for k in range(1, levels.shape[0]):
        f = min(max((z - levels[k - 1]) / (levels[k] - levels[k - 1]), 0.0), 1.0)
        x = x + f * (velocities[k, 0] - velocities[k - 1, 0])
        y = y + f * (velocities[k, 1] - velocities[k - 1, 1])
        w = w + f * (velocities[k, 2] - velocities[k - 1, 2])
    return (x, y, w)


@inner
def current_slope(z, levels, velocities):
    """Derivative (3,) of the current with respect to the depth coordinate z [1/s]."""
    n = levels.shape[0]
    if z <= levels[0] or z >= levels[n - 1]:
        return (0.0, 0.0, 0.0)
    k = 1
    while levels[k] < z:
        k += 1
    rate = 1.0 / (levels[k] - levels[k - 1])
    return (
        rate * (velocities[k, 0] - velocities[k - 1, 0]),
        rate * (velocities[k, 1] - velocities[k - 1, 1]),
        rate * (velocities[k, 2] - velocities[k - 1, 2]),
    )
