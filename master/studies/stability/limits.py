"""Stability limits of the three exchange schemes on a mass and a spring, with or without a mass behind it.

Undamped, the serial exchange of end values is stable up to H sqrt(k / m) = 2 (it is the symplectic Euler method), the parallel one
nowhere, the energy-consistent step everywhere. Below its limit the serial exchange has narrow tongues of resonance with a light mass
behind the spring. The map takes the spectral radius of one macro step: the coupling itself steps every
unit vector of the state, the exchanged values included.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from master.coupling.choose import SCHEMES, coupling
from master.coupling.ledger import Columns
from master.errors import RunError
from master.results.figures import STYLE
from master.studies.stability.coupled import MASS, SPRING, Half, built, paired, scalar_bond
from master.studies.stability.units.linear_fmu.slave import Mass, MassUnit, Spring, SpringUnit

FREQUENCIES = np.logspace(-1.0, 3.0, 61)  # H sqrt(k / m)
RATIOS = np.logspace(-3.0, 3.0, 49)  # mass behind the spring over the mass on it
TOLERANCE = 1e-10  # of the coupling; a long step's round-off is above 1e-12
GROWTH = 1e-5  # of a step: what round-off makes of a double eigenvalue 1
COLUMNS = Columns(("kinetic_energy", "elastic_energy"), (), ("damping_dissipation",), "bond_work")
EXACT_LIMIT = 2.0


@dataclass(frozen=True)
class Limit:
    """A limit found and what theory says; frequencies are H sqrt(k / m)."""

    scheme: str
    found: str
    theory: str
    holds: bool


class UnitEnd:
    """An end of a bond that is a unit of this process: state, port to set, ports to read."""

    rollback, yields, varies = True, False, True

    def __init__(self, unit: Any, held: str, mean: str, answer: str, derivative: str, sign: float, before: float) -> None:
        self.unit, self.solves = unit, 0
        self._held, self._mean, self._answer, self._derivative, self._sign, self._before = held, mean, answer, derivative, sign, before
        self._saved = unit.state

    def begin(self) -> None:
        """See `master.coupling.scheme.End`."""
        self._saved = self.unit.state

    def solve(self, time: float, step: float, held: np.ndarray) -> np.ndarray:
        """See `master.coupling.scheme.End`."""
        self.unit.state = self._saved
        self.unit.step(time, step, {self._held: held})
        return self.unit.output(self._answer)

    def meet(self, time: float, step: float, free: np.ndarray, mobility: np.ndarray) -> None:
        """See `master.coupling.scheme.End`: it cannot."""

    def result(self) -> np.ndarray:
        """The value exchanged before the step."""
        return np.array([self._before])

    def mean(self) -> np.ndarray:
        """See `master.coupling.scheme.End`."""
        return self.unit.output(self._mean)

    def derivative(self) -> np.ndarray:
        """See `master.coupling.scheme.End`."""
        return self._sign * self.unit.output(self._derivative).reshape(1, 1)

    def commit(self) -> None:
        """See `master.coupling.scheme.End`."""

    def cancel(self) -> None:
        """See `master.coupling.scheme.End`."""
        self.unit.state = self._saved


def spectral_radius(scheme: str, spring: SpringUnit, mass: MassUnit, step: float) -> float:
    """Largest modulus of an eigenvalue of one macro step of `step` [s]."""
    explicit = scheme != "energy-consistent"
    columns = []
    for unit in np.eye(5 + 2 * explicit):
        spring.state = spring.state._replace(z=unit[:3])
        mass.state = mass.state._replace(z=unit[3:5])
        effort, flow = unit[5:] if explicit else (0.0, 0.0)
        first, second = ("end_force", "end_velocity") if explicit else ("force", "velocity")
        ends = (
            UnitEnd(spring, "velocity", "force", first, "impedance", -1.0, effort),
            UnitEnd(mass, "force", "velocity", second, "mobility", 1.0, flow),
        )
        done = coupling(scheme, *ends, scalar_bond(), step, TOLERANCE).advance(0.0, step)
        if done.step < step:
            return math.inf  # the step was halved: not this step
        exchanged = [*spring.output(first), *mass.output(second)] if explicit else []
        columns.append(np.concatenate([spring.state.z, mass.state.z, exchanged]))
    return float(np.abs(np.linalg.eigvals(np.column_stack(columns))).max())


def stability_map(frequencies: np.ndarray = FREQUENCIES, ratios: np.ndarray = RATIOS) -> dict[str, np.ndarray]:
    """Spectral radius (ratios, frequencies) by scheme: ground, spring k, mass, spring k, mass m; k = m = 1, so that the step is the
    frequency. The first spring leaves the pair no free drift: drift has the double, defective eigenvalue 1, which a round-off of eps k H
    in the forces splits into 1 +- H sqrt(k / m) sqrt(eps), real or complex by chance (1e-5 at 1000), while a run merely drifts.
    """
    found = {scheme: np.empty((len(ratios), len(frequencies))) for scheme in SCHEMES}
    mass = MassUnit(Mass())
    mass.initialize(0.0, {})
    for i, ratio in enumerate(ratios):
        spring = SpringUnit(Spring(mass=float(ratio), stiffness=1.0))
        spring.initialize(0.0, {})
        for j, frequency in enumerate(frequencies):
            for scheme in SCHEMES:
                found[scheme][i, j] = spectral_radius(scheme, spring, mass, float(frequency))
    return found


def grows(scheme: str, frequency: float, folder: Path, steps: int = 200) -> bool:
    """Whether the energy of mass and spring FMU, coupled with steps of this H sqrt(k / m), grows in a run."""
    spring = Half(built(SPRING, folder), {}, ("end_force",), COLUMNS)
    mass = Half(built(MASS, folder), {"start_velocity": 1.0}, ("end_velocity",), COLUMNS)
    with paired(spring, mass, scalar_bond(), scheme, frequency, 1e-12) as pair:

        def energy() -> float:
            return float(sum(unit.get(tuple(COLUMNS.energy)).sum() for unit in (pair.impedance, pair.mobility)))

        before, most = energy(), 1.0 + GROWTH
        if scheme == "serial":  # its energy swings below the limit, without growing
            most = 1.0 + 4.0 / max(1e-3, 1.0 - frequency**2 / 4.0)
        try:
            for _ in pair.run(steps * frequency):
                if energy() > 1e3 * most * before:
                    return True
        except RunError:
            return True
        return energy() > most * before


def limits(folder: Path) -> list[Limit]:
    """The limits found with the FMUs."""
    low, high = 1.0, 3.0
    while high - low > 0.03:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if grows("serial", middle, folder) else (middle, high)
    serial = 0.5 * (low + high)
    parallel = [x for x in (0.05, 0.5, 1.5) if not grows("parallel", x, folder)]
    ours = [x for x in (0.1, 2.0, 30.0, 1000.0) if grows("energy-consistent", x, folder)]
    return [
        Limit("serial", f"{serial:.3f}", f"{EXACT_LIMIT:g}", abs(serial - EXACT_LIMIT) <= 0.02 * EXACT_LIMIT),
        Limit("parallel", f"stable at {parallel}" if parallel else "unstable at 0.05, 0.5, 1.5", "never stable", not parallel),
        Limit("energy-consistent", f"grows at {ours}" if ours else "stable at 0.1, 2, 30, 1000", "always stable", not ours),
    ]


def draw(path: Path, found: dict[str, np.ndarray], frequencies: np.ndarray = FREQUENCIES, ratios: np.ndarray = RATIOS) -> None:
    """The map as an image: growth of a step in shades of grey, its limit as a line."""
    titles = {"energy-consistent": "Energy-consistent", "serial": "Serial (Gauss–Seidel)", "parallel": "Parallel (Jacobi)"}
    with rc_context({**STYLE, "axes.grid": False}):
        figure = Figure(figsize=(9.2, 3.6))
        FigureCanvasAgg(figure)
        panels = figure.subplots(1, 3, sharey=True)
        for axes, (scheme, title) in zip(panels, titles.items(), strict=True):
            growth = np.log10(np.maximum(found[scheme], 1e-12))
            shown = axes.pcolormesh(frequencies, ratios, np.clip(growth, 0.0, 3.0), cmap="Greys", vmin=0.0, vmax=3.0, shading="nearest")
            unstable = found[scheme] > 1.0 + GROWTH
            if unstable.any() and not unstable.all():
                axes.contour(frequencies, ratios, unstable.astype(float), [0.5], colors=["#b2432f"], linewidths=1.0)
            words = "unstable everywhere" if unstable.all() else "unstable" if unstable.any() else "stable everywhere"
            place: Any = {"transform": axes.transAxes, "ha": "right" if unstable.any() else "center", "va": "center"}
            x = 0.95 if unstable.any() else 0.5
            axes.text(x, 0.5, words, **place, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8})
            if words == "unstable":
                axes.text(0.05, 0.5, "stable", transform=axes.transAxes, va="center")
            axes.set(xscale="log", yscale="log", title=title, xlabel="H √(k / m)")
            axes.set_xticks(10.0 ** np.arange(-1, 4))
        panels[0].set_ylabel("mass behind the spring / mass on it")
        figure.colorbar(shown, ax=panels, label="log₁₀ of the growth per step", extend="max")
        figure.savefig(path)


def map_rows(
    found: dict[str, np.ndarray], frequencies: np.ndarray = FREQUENCIES, ratios: np.ndarray = RATIOS
) -> list[dict[str, float]]:
    """The map as rows of a table."""
    return [
        {"mass_ratio": float(r), "h_sqrt_k_m": float(x), **{scheme: float(radius[i, j]) for scheme, radius in found.items()}}
        for i, r in enumerate(ratios)
        for j, x in enumerate(frequencies)
    ]
