"""The energy ledger: what the FMUs report of themselves, summed over the whole and checked after every step.

Each FMU reports energies E and, cumulative since the start, works W done on it from outside, dissipations D, and the
work B done on it through the bond; its own identity is dE = dW + dB - dD. Summed over all FMUs the bond cancels, so

    closure = sum of (E - E_start) - (W - W_start) + (D - D_start)

is zero but for the interface residual, the sum of dB, and round-off. The check relies on nothing the master computed: a
flipped sign or a wrong axis of a port leaves every FMU's own identity intact, and shows here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import RunError
from .scheme import Step

ROUND_OFF = 1e-12  # of the largest energy, work or dissipation: what differences of large sums may lose
REFINEMENTS = 8  # times one step may be sent back before the check fails

Idle = Callable[[NDArray[Any]], float]
Action = Literal["stop", "refine", "warn"]


class EnergyCheckFailed(RunError):  # noqa: N818
    """The ledger does not close; the text is one line with time, numbers and the likely culprit."""


@dataclass(frozen=True)
class Columns:
    """Names of an FMU's energy outputs [J]; those that it does not have are left out. `bond` None: nothing coupled."""

    energy: Sequence[str] = ()
    work: Sequence[str] = ()
    dissipation: Sequence[str] = ()
    bond: str | None = None


class Source(Protocol):
    """What an account is kept of: an FMU, or anything that reads like one."""

    @property
    def name(self) -> str: ...

    @property
    def ports(self) -> Mapping[str, Any]: ...

    def get(self, names: tuple[str, ...]) -> NDArray[Any]: ...


class _Account:
    """One FMU's columns, and the signs with which they enter its balance."""

    def __init__(self, fmu: Source, columns: Columns) -> None:
        groups = [(columns.energy, 1.0), (columns.work, -1.0), (columns.dissipation, 1.0)]
        kept = [(name, sign) for names, sign in groups for name in names if name in fmu.ports]
        if columns.bond is not None:
            kept.append((columns.bond, 0.0))
        self.fmu, self.names = fmu, tuple(name for name, _ in kept)
        kinds = zip(("stored", "supplied", "dissipated"), (columns.energy, columns.work, columns.dissipation), strict=True)
        self.kinds = [(name, kind) for kind, names in kinds for name in names if name in fmu.ports]
        if columns.bond is not None:
            self.kinds.append((columns.bond, "bond"))
        self.signs = np.array([sign for _, sign in kept])
        self.has_bond = columns.bond is not None
        self.start = self.last = self.now = fmu.get(self.names)

    def read(self) -> None:
        self.now = self.fmu.get(self.names)

    @property
    def closure(self) -> float:
        """Energy + dissipation - work from outside, since the start; for an FMU on a bond this is the bond's work."""
        return float(self.signs @ (self.now - self.start))

    @property
    def bond(self) -> float:
        """Work through the bond in this step."""
        return float(self.now[-1] - self.last[-1]) if self.has_bond else 0.0

    @property
    def balance(self) -> float:
        """The FMU's own identity over this step: zero to its solver's tolerance."""
        return float(self.signs @ (self.now - self.last)) - self.bond

    @property
    def moved(self) -> float:
        """Energy that went through the bond in this step; without a bond the largest change of any column."""
        return abs(self.bond) if self.has_bond else float(np.abs(self.now - self.last).max(initial=0.0))


class Ledger:
    """Books of the energy (70), (77), and proof of (89), (90), step by step.

    Opens with the FMUs initialised and at rest between two steps; call `check` after every step.

    `tolerance` is what is allowed of the closure error, and of the interface residuals' amounts together, relative to the energy
    exchanged so far: the sum of |dB| of the first FMU (of a single FMU without a bond: of the largest change of any column); to it
    comes ROUND_OFF of the largest column. No less than `rest` [J] counts as exchanged: what the efforts do at flows that count as rest in a
    macro step, of which the first steps may be small parts.
    `action` on a violation: "stop" raises EnergyCheckFailed, "refine" sends the step back to be halved and stops when
    that does not help, "warn" keeps the first complaint and goes on. Without sources, where no FMU reports energies, the
    check is the bond's residual alone, summed with its sign; `idle` is then the power [W] that counts as nothing, and what may be lost to
    round-off is that of the products of effort and flow, of which the work is the sum.
    """

    def __init__(
        self,
        sources: Sequence[tuple[Source, Columns]],
        tolerance: float = 1e-8,
        action: Action = "stop",
        idle: Idle | None = None,
        rest: float = 0.0,
    ) -> None:
        self.tolerance, self.action, self._idle, self._rest = tolerance, action, idle, rest
        self._accounts = [_Account(fmu, columns) for fmu, columns in sources]
        self._refused = 0
        self.exchanged = 0.0  # running totals [J]; the interface residual adds up absolute values
        self.interface_residual = self.closure = self.largest_closure = 0.0
        self.step_residual = 0.0
        self.largest = self._largest()  # magnitude so far of any column
        self.allowed = self._allowed(0.0, self.largest)
        self.complaint = ""  # the first violation, in one line

    @property
    def names(self) -> list[str]:
        """Names of `row`: every column with its FMU, then the totals [J]."""
        columns = [f"{account.fmu.name}.{name}" for account in self._accounts for name in account.names]
        return [*columns, "interface_residual", "interface_residual_sum", "closure", "exchanged", "allowed"]

    @property
    def kinds(self) -> dict[str, str]:
        """What the columns of the FMUs are: stored, supplied, dissipated, bond."""
        return {f"{account.fmu.name}.{name}": kind for account in self._accounts for name, kind in account.kinds}

    @property
    def row(self) -> list[float]:
        """The columns after the last step, the residual of that step, its running sum, closure, exchanged energy, what is allowed [J]."""
        columns = [value for account in self._accounts for value in account.last.tolist()]
        return [*columns, self.step_residual, self.interface_residual, self.closure, self.exchanged, self.allowed]

    def check(self, step: Step) -> bool:
        """Read all FMUs and judge the step; False sends it back. Raises EnergyCheckFailed."""
        if self._accounts:
            return self.record(step.time + step.step)
        moved = step.step * max(abs(float(step.effort @ step.flow)), self._idle(step.effort) if self._idle else 0.0)
        largest = self.largest + step.step * float(np.abs(step.effort) @ np.abs(step.flow))
        return self._judge(step.time + step.step, self.exchanged + moved, self.closure + step.residual, step.residual, largest)

    def record(self, time: float) -> bool:
        """As `check`, for a step that ended at `time`."""
        accounts = self._accounts
        for account in accounts:
            account.read()
        exchanged = self.exchanged + accounts[0].moved
        closure = sum(account.closure for account in accounts)
        residual = sum(account.bond for account in accounts) if len(accounts) > 1 else 0.0
        return self._judge(time, exchanged, closure, residual, max(self.largest, self._largest()))

    def _allowed(self, exchanged: float, largest: float) -> float:
        return self.tolerance * max(exchanged, self._rest) + ROUND_OFF * largest

    def _judge(self, time: float, exchanged: float, closure: float, residual: float, largest: float) -> bool:
        accounts, allowed = self._accounts, self._allowed(exchanged, largest)
        made = self.interface_residual + abs(residual)
        # the bond's residuals are inside the closure; judged by themselves too, so that neither another error nor each other can hide them
        passed = abs(closure) <= allowed and made <= allowed
        if not passed and self._sent_back(time, closure, residual, exchanged, allowed):
            return False
        for account in accounts:
            account.last = account.now
        self.exchanged, self.closure, self.step_residual, self._refused = exchanged, closure, residual, 0
        self.largest, self.allowed = largest, allowed
        self.interface_residual = made
        self.largest_closure = max(self.largest_closure, abs(closure))
        return True

    def summary(self) -> dict[str, float]:
        """The figures of the run [J]."""
        return {
            "exchanged_energy_J": self.exchanged,
            "interface_residual_J": self.interface_residual,
            "ledger_closure_J": self.largest_closure,
            "energy_check_allowed_J": self.allowed,
        }

    def verdict(self) -> str:
        """The outcome in words."""
        what = f"{self.exchanged:.3g} J exchanged" if self.exchanged >= self._rest else f"{self._rest:.3g} J of a macro step at rest"
        figures = (
            f"largest closure error {self.largest_closure:.2g} J, at the end {self.allowed:.2g} J allowed ({self.tolerance:.0e} of the "
            f"{what} and {ROUND_OFF:.0e} of the largest column, {self.largest:.3g} J); "
            f"the bond made {self.interface_residual:.2g} J"
        )
        if not self._accounts:
            figures += "; the units report no energies, so this is the bond's own residual alone"
        if self.complaint:
            return f"energy check failed: {figures}; first {self.complaint.removeprefix('energy check ')}"
        return f"energy check passed: {figures}"

    def _largest(self) -> float:
        """Magnitude of the largest column as last read."""
        return max((abs(value) for account in self._accounts for value in account.now.tolist()), default=0.0)

    def _sent_back(self, time: float, closure: float, residual: float, exchanged: float, allowed: float) -> bool:
        """Deal with a violation; True if the step is to be repeated."""
        own = [f"{account.fmu.name}'s own balance is off by {account.balance:.2g} J" for account in self._accounts]
        own = own or ["the units report no energies"]
        text = (
            f"energy check failed at {time:.9g} s: closure error {closure:.3g} J of {exchanged:.3g} J exchanged (allowed {allowed:.3g} J); "
            f"the bond made {residual:.3g} J in this step, {self.interface_residual + abs(residual):.3g} J in all, {', '.join(own)}"
        )
        self._refused += 1
        if self.action == "refine" and self._refused <= REFINEMENTS:
            return True
        self.complaint = self.complaint or text
        if self.action != "warn":
            raise EnergyCheckFailed(text)
        return False
