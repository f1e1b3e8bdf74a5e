"""From any pose to a stable equilibrium: Newton's method first, and where it does not end in one, descent.

Descent is Levenberg's method with a step that is solved for: a pose is followed by that which minimises

    energy + damping / 2 |move|^2,    the damping such that the tangent is positive definite,

approximately, by Newton corrections that stop as soon as a share of the promised energy is released (the first is Levenberg's own; those
after it take out the stretch that turning by finite angles has made). Where the tangent is not definite the pose may also leave along a
direction of negative curvature, without which a saddle could hold it. In still water every pose has less potential energy than the one
before, and only stable equilibria are left where the descent can end (More and Sorensen 1983); how soon is another matter where a long
slack line lies on a bed without friction and hardly any energy tells one shape from another. In a current the work of the drag along the
way counts as released too: the line moves as if overdamped.
"""

import math
from typing import NamedTuple

import numpy as np

from ..arrays import Array
from ..compiled import kernel
from .balance import Balance, Factors, limited

TOLERANCE = 1e-11  # of the line's weight or largest end force (times its longest element, for moments)
ROUND_OFF = 1e-7  # accepted once the residual no longer falls,
_COARSEST = 1e-5  # and where the line is so stiff that its round-off is larger, that up to here
LOST = 1e12  # residual from which there is no way back
CORRECTIONS = 60  # of Newton's method
DESCENTS = 1000
TURN = 0.25  # rad of one correction
_INNER = 6  # corrections of one step of a descent
_SHARE = 0.1  # of the promised energy that a step must release
_LEAST_DAMPING = 1e-7  # 1/m
_MOST_DAMPING = 1e15
_POWERS = 6  # inverse iterations for a direction of negative curvature


class Rest(NamedTuple):
    """Where a search has ended: the balance there, whether it is an equilibrium and a stable one, and the corrections made."""

    balance: Balance
    converged: bool
    stable: bool
    iterations: int


def relax(start: Balance, descents: int) -> Rest:
    """Stable equilibrium near a pose: Newton's if that is one, else where `descents` steps of descent from the pose end."""
    found = newton(start)
    return found if found.stable else descend(start, descents)


def newton(balance: Balance) -> Rest:
    """Equilibrium by Newton's method, sections turned by at most TURN in a correction; it may be an unstable one, or none."""
    best, iteration = math.inf, 0
    for iteration in range(CORRECTIONS):
        if not balance.size < LOST:
            break
        if settled(balance.size, balance.rounding, best):
            return _rest(balance, balance.stable(), iteration)
        best = min(best, balance.size)
        factors = Factors(balance, 0.0)
        if not factors.regular:
            break
        balance = balance.after(limited(factors.correction(balance.residual), TURN))
    return Rest(balance, False, False, iteration)


def _rest(balance: Balance, stable: bool, iteration: int) -> Rest:
    """Where a search has come to rest: an equilibrium unless an element is turned inside out."""
    sound = not balance.flaw()
    return Rest(balance, sound, sound and stable, iteration)


@kernel
def settled(size, rounding, best):
    """Whether a residual is as small as it gets: `rounding` is what round-off makes of it, `best` the smallest before."""
    return size <= TOLERANCE or (size <= round_off(rounding) and size > 0.3 * best)


@kernel
def round_off(rounding):
    """Residual that is accepted once it no longer falls."""
    return max(ROUND_OFF, min(rounding, _COARSEST))


def descend(balance: Balance, limit: int) -> Rest:
    """Stable equilibrium by descent from a pose, in at most `limit` steps."""
    damping, turn, best, iteration = 0.0, TURN, math.inf, 0
    for iteration in range(limit):
        definite = balance.definite()
        if settled(balance.size, balance.rounding, best) and (definite or balance.stable()):
            return _rest(balance, True, iteration)
        best = min(best, balance.size)
        if not definite:
            damping = max(damping, _LEAST_DAMPING)
            while damping < _MOST_DAMPING and not balance.definite(damping):
                damping *= 4.0
        after, ratio = _step(balance, damping, turn, definite)
        if after is None:
            damping, turn = max(4.0 * damping, _LEAST_DAMPING), 0.4 * turn
            if damping > _MOST_DAMPING:
                break
            continue
        balance = after
        if ratio > 0.5:
            damping = 0.25 * damping if damping > 4.0 * _LEAST_DAMPING else 0.0
        turn = min(2.0 * turn, TURN)
    return _rest(balance, False, iteration) if balance.size <= round_off(balance.rounding) else Rest(balance, False, False, iteration)


def _step(balance: Balance, damping: float, turn: float, definite: bool) -> tuple[Balance | None, float]:
    """Balance after one step, None if it releases too little, and the energy released over that promised."""
    factors = Factors(balance, damping)
    if not factors.regular:
        return None, 0.0
    move = limited(factors.correction(balance.residual), TURN)
    anchored = True
    if not definite:
        move = limited(move, turn)
        away = _downward(balance, factors, turn)
        if balance.promise(away) > balance.promise(move):
            move, anchored = away, False
    promised = balance.promise(move)
    here, way, work = balance, np.zeros_like(move), 0.0
    for _ in range(_INNER):
        there = here.after(move)
        if not there.size < LOST:
            break
        work -= 0.5 * float(((here.pull + there.pull) * move).sum())
        released = balance.potential - there.potential + work
        if abs(released) < balance.blur:  # only the forces tell
            released = -0.5 * float(((balance.residual + there.residual) * (way + move)).sum())
        if released > _SHARE * promised or (definite and there.size < 0.5 * balance.size and there.size < round_off(there.rounding)):
            return there, released / promised
        here, way = there, way + move if anchored else way
        anchored = True
        factors = Factors(here, damping)
        if not factors.regular:
            break
        right = here.residual + damping * here.scales.metric * way
        here.hold(right)
        move = limited(factors.correction(right), TURN)
    return None, 0.0


def _downward(balance: Balance, factors: Factors, turn: float) -> Array:
    """Direction (n, 6) of the softest mode, no section turned by more than `turn`, not uphill; by inverse iteration."""
    metric = balance.scales.metric
    mode = np.random.default_rng(0).standard_normal(metric.shape) / np.sqrt(metric)
    for _ in range(_POWERS):
        right = metric * mode
        balance.hold(right)
        mode = factors.correction(right)
        mode /= math.sqrt(float((metric * mode * mode).sum()))
    mode *= turn / max(float(np.abs(mode[:, 3:]).max()), 1e-12)
    return -mode if float((balance.residual * mode).sum()) > 0.0 else mode
