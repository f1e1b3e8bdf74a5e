"""Rules between several parameters: plain functions of numbers, for the dataclasses, and for kernels, which compile them."""

import math

MOST_STRETCH = 0.05  # mean strain up to which a line may be stretched: the law (20) is that of small strains
SUBSTEPS = (1, 3, 9, 27, 81, 243, 729)
WORDS = (  # templates, and how many of the values they take
    ("max_substeps = %g: must be one of " + ", ".join(map(str, SUBSTEPS)), 1),
    (
        f"length = %g: must be at least %.6g m, or the line is stretched by more than {100.0 * MOST_STRETCH:g}%% "
        "to the distance from foot to top, %.6g m",
        3,
    ),
    (f"top_range = %g: must be at most %.6g m, where the line is stretched by {100.0 * MOST_STRETCH:g}%%", 2),
    ("seabed.reference_weight = nothing: must be given where no section is heavier or lighter than water", 0),
    ("top_quaternion = (%g, %g, %g, %g): must have length 1, or be all zero", 4),
)
_SUBSTEPS, _LENGTH, _RANGE, _BEARING, _QUATERNION = range(len(WORDS))
Refusal = tuple[int, tuple[float, float, float, float]]


def refusal(length, top, quaternion, top_range, substeps, bearing):
    """Number and values of the words that refuse these parameters; -1 if none do.

    length [m]; top (3,), quaternion (4,): pose of the top; top_range [m]; bearing: the largest [N/m], 1 where there is no bed.
    """
    allowed = False
    for parts in SUBSTEPS:
        allowed = allowed or substeps == parts
    if not allowed:
        return _SUBSTEPS, (substeps, 0.0, 0.0, 0.0)
    longest, distance = (1.0 + MOST_STRETCH) * length, math.hypot(top[0], top[1])
    span = math.hypot(distance, top[2])
    if span > longest:
        return _LENGTH, (length, span / (1.0 + MOST_STRETCH), span, 0.0)
    if math.hypot(distance + top_range, top[2]) > longest:
        return _RANGE, (top_range, math.sqrt(longest * longest - top[2] * top[2]) - distance, 0.0, 0.0)
    if not bearing > 0.0:
        return _BEARING, (0.0, 0.0, 0.0, 0.0)
    norm = math.hypot(math.hypot(quaternion[0], quaternion[1]), math.hypot(quaternion[2], quaternion[3]))
    if norm > 0.0 and abs(norm - 1.0) > 1e-6:
        return _QUATERNION, (quaternion[0], quaternion[1], quaternion[2], quaternion[3])
    return -1, (0.0, 0.0, 0.0, 0.0)
