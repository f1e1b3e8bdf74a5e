"""What a run keeps: one row of signals per accepted step, one shape of the pipe per recording instant.

A unit is known here by the names of its output ports alone; a port that a scene's unit does not have (no controller,
no vessel) leaves no column. Shapes are asked for at recording instants only: a run without them does no work for them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TextIO

import numpy as np

TIME_ROUNDING = 1e-9  # s; an instant this close to the end of a step counts as reached


class Source(Protocol):
    """A co-simulation unit seen as named output ports."""

    @property
    def ports(self) -> Mapping[str, Any]:
        """The ports by name."""

    def get(self, names: str | tuple[str, ...]) -> np.ndarray:
        """The values of one port, or of several one after the other."""


@dataclass(frozen=True)
class Signal:
    """One output port and the columns it fills, each a name and a unit."""

    unit: str
    port: str
    columns: tuple[tuple[str, str], ...]


def _signal(unit: str, port: str, names: str, measure: str) -> Signal:
    return Signal(unit, port, tuple((name, measure) for name in names.split()))


SIGNALS = (
    _signal("vessel", "position", "x y z", "m"),
    _signal("vessel", "roll", "roll", "rad"),
    _signal("vessel", "pitch", "pitch", "rad"),
    _signal("vessel", "yaw", "yaw", "rad"),
    Signal(
        "vessel",
        "body_velocity",
        (
            *((name, "m/s") for name in ("surge_velocity", "sway_velocity", "heave_velocity")),
            *((name, "rad/s") for name in ("roll_rate", "pitch_rate", "yaw_rate")),
        ),
    ),
    Signal("vessel", "set_point", (("set_point_x", "m"), ("set_point_y", "m"), ("set_point_yaw", "rad"))),
    Signal("vessel", "thrust", (("thrust_surge", "N"), ("thrust_sway", "N"), ("thrust_yaw", "N.m"))),
    _signal("pipe", "top_position", "top_x top_y top_z", "m"),
    _signal("pipe", "force", "top_force_x top_force_y top_force_z", "N"),
    _signal("pipe", "moment", "top_moment_x top_moment_y top_moment_z", "N.m"),
    _signal("pipe", "pipe_length", "pipe_length", "m"),
    _signal("pipe", "largest_tension", "largest_tension", "N"),
    _signal("pipe", "largest_bending_moment", "largest_bending_moment", "N.m"),
    _signal("pipe", "largest_von_mises", "largest_von_mises", "Pa"),
    _signal("pipe", "largest_utilisation", "largest_utilisation", "1"),
)
"""Columns of signals.csv between the time and the ledger; top_force, top_moment: the pull of the pipe on the vessel."""


def csv_line(row: Sequence[float]) -> str:
    """Numbers as they read back to the same bits."""
    return ",".join(map(repr, row))


@dataclass(frozen=True)
class Table:
    """Recorded signals: `values[i, j]` is column j (`names[j]`, in `units[j]`) after step i; row 0 is the start."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: np.ndarray

    def __contains__(self, name: str) -> bool:
        return name in self.names

    def column(self, name: str) -> np.ndarray:
        """One column, shape (steps + 1,)."""
        return self.values[:, self.names.index(name)]

    def columns(self, *names: str) -> np.ndarray:
        """Several columns side by side, shape (steps + 1, len(names))."""
        return self.values[:, [self.names.index(name) for name in names]]

    @property
    def header(self) -> str:
        """First line of the CSV file."""
        return ",".join(f"{name} [{unit}]" for name, unit in zip(self.names, self.units, strict=True))

    def write(self, path: Path) -> None:
        """Write as CSV; numbers are printed so that they read back to the same bits."""
        path.write_text("\n".join([self.header, *map(csv_line, self.values.tolist()), ""]), encoding="utf-8")

    @classmethod
    def read(cls, path: Path) -> Table:
        """The table in a CSV file that may break off within its last line. Raises OSError, ValueError without a row."""
        header, *rows = path.read_text(encoding="utf-8").split("\n")[:-1]
        names, units = zip(*(column.removesuffix("]").rsplit(" [", 1) for column in header.split(",")), strict=True)
        if not rows:
            raise ValueError(f"{path}: has no rows")
        return cls(names, units, np.array([[float(value) for value in row.split(",")] for row in rows]))


@dataclass(frozen=True)
class Shapes:
    """The pipe at the recording instants.

    s (N,) m; time (nt,) s; position (nt, N, 3) m, spatial; effective tension and that of the wall (nt, N) N; moment (nt, N, 3) N.m
    and shear (nt, N, 2) N in the components of the section frame t.
    """

    s: np.ndarray
    time: np.ndarray
    position: np.ndarray
    tension: np.ndarray
    wall_tension: np.ndarray
    moment: np.ndarray
    shear: np.ndarray

    def nearest(self, time: float) -> int:
        """Index of the recording instant nearest to `time`."""
        return int(np.argmin(np.abs(self.time - time)))

    def write(self, path: Path) -> None:
        """Write as a compressed numpy archive; `t` is the time."""
        arrays = {name: getattr(self, name) for name in ("s", "position", "tension", "wall_tension", "moment", "shear")}
        np.savez_compressed(path, t=self.time, **arrays)


class Recorder:
    """Collects signals after every step and shapes at multiples of `recording_step` and at the `snapshots`.

    `sources` maps unit names ("pipe", "vessel") to their ports; `signals` are listed unit by unit. `recording_step` None
    keeps no shapes at all. Rows also go to `stream` as they come, so that they outlive a process that an FMU kills.
    """

    def __init__(
        self,
        sources: Mapping[str, Source],
        recording_step: float | None,
        snapshots: Sequence[float] = (),
        signals: Sequence[Signal] = SIGNALS,
        stream: TextIO | None = None,
    ) -> None:
        self._sources, self._stream = sources, stream
        self._signals = [s for s in signals if s.unit in sources and s.port in sources[s.unit].ports]
        units = dict.fromkeys(s.unit for s in self._signals)
        ports = {unit: tuple(s.port for s in self._signals if s.unit == unit) for unit in units}
        self._requests = [(sources[unit], names) for unit, names in ports.items() if names]
        self._recording_step = recording_step if "pipe" in sources else None
        self._snapshots = sorted(snapshots)
        self._next_shape = -np.inf
        self._extra: tuple[tuple[str, str], ...] = ()
        self._rows: list[list[float]] = []
        self._times: list[float] = []
        self._shapes: list[tuple[np.ndarray, ...]] = []
        self._s = np.empty(0)

    def sample(self, time: float, extra: Mapping[tuple[str, str], float]) -> None:
        """Record the units as they stand at `time`; `extra` maps (name, unit) to further values, always the same."""
        if not self._rows:
            self._extra = tuple(extra)
            if self._stream is not None:
                self._stream.write(self.table().header + "\n")
        row = [time]
        for source, names in self._requests:
            row.extend(source.get(names).tolist())
        row.extend(float(extra[key]) for key in self._extra)
        self._rows.append(row)
        if self._stream is not None:
            self._stream.write(csv_line(row) + "\n")
            self._stream.flush()
        if self._recording_step is not None and time >= self._next_shape - TIME_ROUNDING:
            self.record_shape(time)

    def record_shape(self, time: float) -> None:
        """Record the pipe's shape now, unless this instant is recorded already or no shapes are kept."""
        if self._recording_step is None or (self._times and self._times[-1] == time):
            return
        pipe = self._sources["pipe"]
        if not self._times:
            self._s = pipe.get("s")
        self._times.append(time)
        self._shapes.append(
            (
                pipe.get("node_position").reshape(-1, 3),
                pipe.get("node_tension"),
                pipe.get("node_wall_tension"),
                pipe.get("node_moment").reshape(-1, 3),
                pipe.get("node_shear").reshape(-1, 2),
            )
        )
        regular = (np.floor((time + TIME_ROUNDING) / self._recording_step) + 1.0) * self._recording_step
        self._next_shape = min([t for t in self._snapshots if t > time + TIME_ROUNDING] + [regular])

    def table(self) -> Table:
        """The signals recorded so far."""
        columns = [("time", "s"), *(c for s in self._signals for c in s.columns), *self._extra]
        names, units = zip(*columns, strict=True)
        return Table(tuple(names), tuple(units), np.array(self._rows, dtype=float).reshape(-1, len(columns)))

    def shapes(self) -> Shapes | None:
        """The shapes recorded so far, None where none are kept."""
        if not self._shapes:
            return None
        return Shapes(self._s, np.array(self._times), *(np.stack(arrays) for arrays in zip(*self._shapes, strict=True)))
