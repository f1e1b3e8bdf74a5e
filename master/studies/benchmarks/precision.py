"""The work-precision figure of a case: CPU time against error, one line per contestant, told apart by dash and marker."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes

from master.results.figures import _figure

_LOOKS = (("-", "o"), ("--", "s"), (":", "^"), ("-.", "D"), ((0, (1, 1)), "v"), ((0, (5, 1, 1, 1, 1, 1)), "P"), ((0, (8, 3)), "X"))
_SHADES = ("#161616", "#6b6b6b")


def draw(path: Path, title: str, rows: Sequence[dict[str, Any]], error: str, label: str, uncertainty: float, work: str = "cpu_s") -> None:
    """Rows with keys `contestant`, `error` (labelled `label`) and `work` [s]; rows whose error is no number above zero are left out."""
    with _figure(path, title, (7.6, 4.4)) as figure:
        axes: Axes = figure.subplots()
        for i, one in enumerate(dict.fromkeys(row["contestant"] for row in rows)):
            mine = sorted((row[error], row[work]) for row in rows if row["contestant"] == one and row[error] > 0.0)
            line, marker = _LOOKS[i % len(_LOOKS)]
            shade = _SHADES[i % 2]
            axes.loglog(*zip(*mine, strict=True), color=shade, linestyle=line, marker=marker, markerfacecolor="white", label=one)
        axes.axvline(uncertainty, color="#8a8a8a", linewidth=1.0, linestyle="-.", label="uncertainty of the reference")
        axes.set(xlabel=label, ylabel="CPU time [s]")
        axes.legend(fontsize=8.0, loc="center left", bbox_to_anchor=(1.0, 0.5))
