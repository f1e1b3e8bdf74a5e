"""The paper's figures 3 to 9 and the energy balance, as PNG files from the recorded signals and shapes.

Lines differ in dash and marker as well as in colour, so that a grey print reads as well as the screen.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from scipy.interpolate import CubicHermiteSpline

from master.results.recorder import Shapes, Table

INITIAL, MIDDLE, FINAL, ENVELOPE = "#b2432f", "#3a76a8", "#161616", "#8a8a8a"
INITIAL_LINE: Any = {"color": INITIAL, "linestyle": (0, (5, 2, 1, 2))}
FINAL_LINE: Any = {"color": FINAL, "linestyle": "-"}
DOTS: Any = {"color": ENVELOPE, "linestyle": "none", "marker": "o", "markersize": 2.6}
STYLE: Any = {
    "figure.dpi": 150,
    "figure.constrained_layout.use": True,
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "#555555",
    "axes.grid": True,
    "grid.color": "#e3e3e3",
    "grid.linewidth": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
}
HANG_OFF = {"pipe.top_work": "pipe.hang-off", "vessel.bond_work": "vessel.hang-off", "mover.bond_work": "mover.pipe"}
_PARTS = 8  # of an element, at whose ends a curve is drawn
ARC_LENGTH = "Arc length from the foot S [m]"


@contextmanager
def _figure(path: Path, title: str, size: tuple[float, float] = (6.4, 3.6)) -> Iterator[Figure]:
    """A figure on a canvas of its own (no global state of pyplot), saved as `path`."""
    with rc_context(STYLE):
        figure = Figure(figsize=size)
        FigureCanvasAgg(figure)
        figure.suptitle(title, x=0.01, ha="left", fontsize=11, fontweight="bold")
        yield figure
        figure.savefig(path)


def _seconds(time: float) -> str:
    return f"t = {time:g} s"


def configurations(path: Path, shapes: Shapes, instants: Sequence[float]) -> None:
    """Figure 3: the pipe at the start, at the given instants and at the end, from the side and from behind."""
    picked = sorted({0, *(shapes.nearest(t) for t in instants), len(shapes.time) - 1})
    colours = [INITIAL, *[MIDDLE] * (len(picked) - 2), FINAL][-len(picked) :]
    dashes: list[Any] = [(0, (5, 2)), *[(0, (1.5, 1.5)), (0, (6, 1.5, 1.5, 1.5))] * len(picked)]
    markers = ["s", *["o", "^", "v", "D"] * len(picked)]
    with _figure(path, "Figure 3   Pipe configurations", (7.2, 4.0)) as figure:
        side, behind = figure.subplots(1, 2, sharey=True, width_ratios=[3, 2])
        for rank, index in enumerate(picked):
            last = rank == len(picked) - 1
            look: Any = {"color": colours[rank], "linestyle": "-" if last else dashes[rank]}
            x, y, z = shapes.position[index].T
            for axes, horizontal in ((side, x), (behind, y)):
                axes.plot(horizontal, -z, **look, label=_seconds(round(shapes.time[index], 6)))
                filled = look["color"] if last else "white"
                axes.plot(horizontal[-1], -z[-1], marker="o" if last else markers[rank], markersize=6,
                          color=look["color"], markerfacecolor=filled, clip_on=False)  # fmt: skip
        side.set(xlabel="Forward x [m]", ylabel="Height above the seabed [m]", title="From the side")
        behind.set(xlabel="Starboard y [m]", title="From behind")
        behind.tick_params(labelleft=True)  # the panels may differ in height
        side.set_aspect("equal", adjustable="box")
        span = np.ptp(shapes.position[picked, :, 1])
        if span < 1e-3:
            behind.set_xlim(-1.0, 1.0)
        side.legend(loc="upper left")


def length(path: Path, signals: Table, reference: float) -> None:
    """Figure 4: the length of the deformed centreline over time, as the stretch over the unloaded length."""
    with _figure(path, "Figure 4   Length of the pipe") as figure:
        axes = figure.subplots()
        axes.plot(signals.column("time"), 1e3 * (signals.column("pipe_length") - reference), **FINAL_LINE)
        axes.set(xlabel="Time t [s]", ylabel=f"Length − {reference:g} m  [mm]")
        axes.margins(x=0)


def bending(shapes: Shapes) -> tuple[np.ndarray, np.ndarray]:
    """Arc lengths (k,) [m], _PARTS to an element, and the bending moment (times, k) [N m] there.

    Its square is the cubic with the slopes 2 (m_2 n_3 - m_3 n_2) of eq. (26) at the nodes.
    """
    part = np.arange(_PARTS) / _PARTS
    s = np.append((shapes.s[:-1, None] + np.diff(shapes.s)[:, None] * part).ravel(), shapes.s[-1])
    (m2, m3), (n2, n3) = shapes.moment[..., 1:].transpose(2, 0, 1), shapes.shear.transpose(2, 0, 1)
    square = CubicHermiteSpline(shapes.s, m2**2 + m3**2, 2.0 * (m2 * n3 - m3 * n2), axis=1)(s)
    return s, np.sqrt(np.maximum(square, 0.0))  # where it passes through 0 the cubic may dip below


def along(path: Path, title: str, label: str, time: np.ndarray, s: np.ndarray, field: np.ndarray, lower_envelope: bool) -> None:
    """A quantity (times, k) along the pipe at the start and at the end with its extremes over all recording instants."""
    with _figure(path, title) as figure:
        axes = figure.subplots()
        extremes = "largest, smallest over time" if lower_envelope else "largest over time"
        axes.plot(s, field.max(axis=0) / 1e3, **DOTS, label=extremes)
        if lower_envelope:
            axes.plot(s, field.min(axis=0) / 1e3, **DOTS)
        axes.plot(s, field[0] / 1e3, **INITIAL_LINE, label=_seconds(time[0]))
        axes.plot(s, field[-1] / 1e3, **FINAL_LINE, label=_seconds(round(time[-1], 6)))
        axes.set(xlabel=ARC_LENGTH, ylabel=label)
        axes.margins(x=0.01)
        axes.legend()


def vectors(path: Path, title: str, labels: tuple[str, str], shapes: Shapes, field: np.ndarray) -> None:
    """Vectors of the section plane (N, 2) along the pipe at the end, as their components on t2 and t3 on one scale."""
    with _figure(path, f"{title} at {_seconds(round(shapes.time[-1], 6))}", (6.4, 4.2)) as figure:
        panels = figure.subplots(2, 1, sharex=True, sharey=True)
        for axes, component, label, colour in zip(panels, field.T / 1e3, labels, (FINAL, MIDDLE), strict=True):
            axes.vlines(shapes.s, 0.0, component, color=colour, linewidth=1.0)
            axes.plot(shapes.s, component, color=colour, linewidth=0.8, marker="o", markersize=2.4)
            axes.axhline(0.0, color="#555555", linewidth=0.8)
            axes.set_ylabel(label)
        panels[1].set_xlabel(ARC_LENGTH)
        panels[1].margins(x=0.02)


def _draw_lines(axes: Any, time: np.ndarray, columns: dict[str, np.ndarray], unit: float) -> None:
    """Label each line at the legend; dashes tell lines apart without colour. Columns that stay zero are left out."""
    dashes: list[Any] = ["-", (0, (5, 2)), (0, (1.2, 1.4)), (0, (5, 2, 1, 2)), (0, (8, 2)), (0, (3, 1, 1, 1, 1, 1))]
    colours = [FINAL, INITIAL, MIDDLE, "#4d8c57", "#8a6db1", "#b98a2f"]
    shown = {name: values for name, values in columns.items() if np.any(values)}
    for rank, (name, values) in enumerate(shown.items()):
        style = {"color": colours[rank % 6], "linestyle": dashes[rank % 6]}
        axes.plot(time, values / unit, **style, label=name.replace("_", " ").replace(".", ": "))
    if not shown:
        return
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8, handlelength=2.6)


def _kind(name: str) -> str:
    """What a column is by the ending of its name."""
    if name in HANG_OFF:
        return "bond"
    return {"energy": "stored", "work": "supplied", "dissipation": "dissipated"}.get(name.rpartition("_")[2], "")


def energy(path: Path, signals: Table, kinds: Mapping[str, str]) -> None:
    """The energy over time: exchanged through the bond, supplied, stored (less that at the start), dissipated, and what is left.

    What is left, made by the interface among it, comes with what the energy check allows of it at every instant.
    """
    time = signals.column("time")

    def of(kind: str) -> dict[str, np.ndarray]:
        found = {name: signals.column(name) for name in kinds if kinds[name] == kind}
        return {re.sub("_(energy|work|dissipation)$", "", HANG_OFF.get(n, n)): column - column[0] for n, column in found.items()}

    panels_of = {"Through the bond, work done on": of("bond"), "Supplied from outside": of("supplied")}
    panels_of |= {"Stored": of("stored"), "Dissipated": of("dissipated")}
    shown = {title: columns for title, columns in panels_of.items() if any(np.any(c) for c in columns.values())}
    if not shown:
        shown = {"Through the bond, exchanged": {"sum of amounts": signals.column("exchanged")}}
    largest = max((float(np.abs(c).max()) for columns in shown.values() for c in columns.values()), default=0.0)
    unit, symbol = next(((u, s) for u, s in ((1e6, "MJ"), (1e3, "kJ")) if largest >= u), (1.0, "J"))
    with _figure(path, "Energy balance", (7.6, 1.8 * len(shown) + 2.4)) as figure:
        *panels, residual = figure.subplots(len(shown) + 1, 1, sharex=True)
        for axes, (title, columns) in zip(panels, shown.items(), strict=True):
            _draw_lines(axes, time, columns, unit)
            axes.set(title=title, ylabel=f"Energy [{symbol}]")
        made = np.cumsum(np.abs(signals.column("interface_residual")))
        rest = {"made by the interface": made, "closure of the ledger": np.abs(signals.column("closure"))}
        if "allowed" in signals:
            bound = signals.column("allowed")
            residual.plot(time, bound, color=ENVELOPE, linewidth=1.0)
            where: Any = {"ha": "right", "va": "bottom", "fontsize": 8, "color": "#555555"}
            residual.annotate("limit of the energy check", (time[-1], bound[-1]), **where)
        _draw_lines(residual, time, {n: np.maximum(c, 1e-12) for n, c in rest.items()}, 1.0)
        residual.set_xlim(time[0], time[-1] or 1.0)
        residual.set(title="Left over", ylabel="Energy [J]", xlabel="Time t [s]", yscale="log")


def draw_all(
    folder: Path, signals: Table, shapes: Shapes | None, instants: Sequence[float], kinds: Mapping[str, str] | None = None
) -> list[Path]:
    """Draw every figure that the recorded data allow into `folder`; return the files in order.

    `kinds` says which columns are stored, supplied, dissipated and bond; without it the endings of their names do.
    """
    files = []

    def draw(name: str, function: Callable[..., None], *arguments: Any) -> None:
        files.append(folder / name)
        function(files[-1], *arguments)

    if shapes is not None:
        norm_shear = np.linalg.norm(shapes.shear, axis=-1)
        m_labels, n_labels = ("m₂ [kN m]", "m₃ [kN m]"), ("n₂ [kN]", "n₃ [kN]")
        tension, moment, shear, at_nodes = "Figure 5   Tension", "Bending moment", "Shear force", (shapes.time, shapes.s)
        draw("fig3_configurations.png", configurations, shapes, instants)
        draw("fig4_length.png", length, signals, float(shapes.s[-1]))
        draw("fig5_tension.png", along, tension, "n₁ [kN]", *at_nodes, shapes.tension, True)
        draw("fig6_bending_vectors.png", vectors, f"Figure 6   {moment}", m_labels, shapes, shapes.moment[-1, :, 1:])
        draw("fig7_shear_vectors.png", vectors, f"Figure 7   {shear}", n_labels, shapes, shapes.shear[-1])
        draw("fig8_bending.png", along, f"Figure 8   {moment}", "‖(m₂, m₃)‖ [kN m]", shapes.time, *bending(shapes), False)
        draw("fig9_shear.png", along, f"Figure 9   {shear}", "‖(n₂, n₃)‖ [kN]", *at_nodes, norm_shear, False)
    draw("energy.png", energy, signals, {name: _kind(name) for name in signals.names} if kinds is None else kinds)
    return files
