"""Elastic seabed: potential and force per length of a pipe against the plane z = 0 (e3 down).

The law is linear with a quadratic foot, continuous with its slope. With the penetration p = z + d/8, d the outer diameter and w the
submerged weight per length (for a section that floats, that of the heaviest, or one that is given),

    force = 0 (p < 0),   10 w p^2 / ((d/8 - d/40) d) (0 <= p <= d/20),   w (p - d/40) / (d/8 - d/40) above,

so that a pipe lying at z = 0 is carried by exactly its weight (published pipelay law, shifted by d/8 because the foot lies at z = 0).
"""

import math

from .compiled import inner


@inner
def contact(z, diameter, weight):
    """Potential [J/m], force [N/m, upward positive] and stiffness [N/m^2] of the bed on a pipe at depth coordinate z."""
    p = z + 0.125 * diameter
    if p <= 0.0:
        return 0.0, 0.0, 0.0
    stiffness = weight / (0.1 * diameter)
    knee = 0.05 * diameter
    if p <= knee:
        a = 10.0 * weight / (0.1 * diameter * diameter)
        return a * p**3 / 3.0, a * p * p, 2.0 * a * p
    q = p - 0.025 * diameter
    at_knee = 0.025 * diameter
    foot = 10.0 * weight / (0.1 * diameter * diameter) * knee**3 / 3.0
    return foot + 0.5 * stiffness * (q * q - at_knee * at_knee), stiffness * q, stiffness


@inner
def mean_contact(z_old, z_new, diameter, weight):
    """Mean of the force over the way from one position to another, a discrete gradient, and its derivative with respect to z_new.

    force * (z_new - z_old) is the potential's increase exactly: on each of its three pieces the law is a parabola, of which Simpson's
    rule takes the mean without the cancellation of a difference of potentials.
    """
    step = z_new - z_old
    if step == 0.0:
        _, force, k = contact(z_old, diameter, weight)
        return force, 0.5 * k
    low, high = min(z_old, z_new), max(z_old, z_new)
    mean, start = 0.0, -0.125 * diameter
    for end in (-0.075 * diameter, math.inf):
        a, b = max(low, start), min(high, end)
        if b > a:
            ends = contact(a, diameter, weight)[1] + contact(b, diameter, weight)[1]
            mean += (b - a) / (high - low) * (ends + 4.0 * contact(0.5 * (a + b), diameter, weight)[1]) / 6.0
        start = end
    _, force, k = contact(z_new, diameter, weight)
    if math.fabs(step) < 1e-6 * diameter:
        return mean, 0.5 * k
    return mean, (force - mean) / step
