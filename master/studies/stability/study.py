"""The command `stability`: runs the cases asked for, writes their tables and the map, and says which limits are kept."""

from __future__ import annotations

import csv
import multiprocessing
from collections.abc import Sequence
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any, TextIO

from tqdm import tqdm

import pipe_fmu
from master.fmi.build import Recipe
from master.fmi.cache import cache_folder
from master.studies.stability import bodies, limits, published
from master.studies.stability.coupled import BODY, built

NAMES = (*published.CASES, "limits", "bodies")
WORKERS = 2


def study(names: Sequence[str], folder: Path, stream: TextIO) -> tuple[str, bool]:
    """Run the cases (all if none is named) and write their tables into `folder`; what to print, and whether all limits are kept."""
    wanted = [name for name in NAMES if name in names] or list(NAMES)
    folder.mkdir(parents=True, exist_ok=True)
    cache, lines, kept = cache_folder("fmus"), [], []
    results = [result for name in wanted if name in published.CASES for result in published.CASES[name](cache)]
    if results:
        _write(folder / "published.csv", [{**asdict(r), "holds": r.holds} for r in results])
        lines += ["Published cases", _published_table(results), ""]
        kept += [r.holds for r in results]
    if "limits" in wanted:
        found, area = limits.limits(cache), limits.stability_map()
        _write(folder / "limits.csv", [asdict(limit) for limit in found])
        _write(folder / "stability_map.csv", limits.map_rows(area))
        limits.draw(folder / "stability_map.png", area)
        lines += ["Limits of H sqrt(k/m), undamped"]
        lines += [f"  {x.scheme:18} {x.found:32} theory: {x.theory:15} {_verdict(x.holds)}" for x in found] + [""]
        kept += [limit.holds for limit in found]
    if "bodies" in wanted:
        outcomes = run_bodies(bodies.cases(), cache, stream, folder / "bodies.csv")
        lines += ["The pipe and a rigid body, 60 s", _bodies_table(outcomes)]
        kept += [o.holds for o in outcomes if o.scheme == "energy-consistent"]
    return "\n".join(lines).rstrip(), all(kept)


def run_bodies(cases: Sequence[bodies.Case], cache: Path, stream: TextIO, path: Path) -> list[bodies.Outcome]:
    """The outcomes of `cases`, on two processes; each is written to `path` as it is known."""
    outcomes = []
    with path.open("w", newline="", encoding="utf-8") as file, multiprocessing.get_context("spawn").Pool(WORKERS) as pool:
        still = pool.apply(rest, (cache,))
        jobs = [(case, still) for case in cases]
        done = tqdm(pool.imap(_run, jobs), total=len(jobs), file=stream, disable=not stream.isatty(), leave=False, unit="run")
        writer = csv.DictWriter(file, [*(field.name for field in fields(bodies.Outcome)), "holds"])
        writer.writeheader()
        for outcome in done:
            writer.writerow({**asdict(outcome), "holds": outcome.holds})
            file.flush()
            outcomes.append(outcome)
    return outcomes


def rest(cache: Path) -> bodies.Rest:
    """The pipe of the cases at rest, its FMU and the body's built if need be."""
    pipe = Recipe(Path(pipe_fmu.__file__).parent, "slave.PipeUnit", bodies.PIPE)
    return bodies.at_rest(built(pipe, cache), built(BODY, cache))


def _run(job: tuple[bodies.Case, bodies.Rest]) -> bodies.Outcome:
    return bodies.run(*job)


def _write(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _verdict(holds: bool) -> str:
    return "kept" if holds else "NOT KEPT"


def _published_table(results: Sequence[published.Result]) -> str:
    head = f"  {'case':12} {'step s':>7} {'quantity':28} {'error':>9} {'to beat':>9}  {'which is':38} {'drift':>8} {'closure':>8}"
    rows = [
        f"  {r.case:12} {r.step_s:7g} {r.quantity:28} {r.error:9.2e} {r.best:9.2e}  {r.source:38} {r.drift:8.1e} {r.closure:8.1e} "
        f"{_verdict(r.holds)}"
        for r in results
    ]
    return "\n".join([head, *rows])


def _bodies_table(outcomes: Sequence[bodies.Outcome]) -> str:
    others = {(o.scheme, o.state, o.mass_kg, o.step_s): o for o in outcomes}

    def ended(scheme: str, o: bodies.Outcome) -> str:
        other = others.get((scheme, o.state, o.mass_kg, o.step_s))
        return "-" if other is None else f"{other.residual:.0e}" if other.finished else f"ends {other.end_s:.1f} s"

    labels = dict.fromkeys(o.scheme for o in outcomes)
    through = {label: sum(o.finished for o in outcomes if o.scheme == label) for label in labels}

    head = (
        f"  {'state':9} {'mass kg':>8} {'step s':>6} {'residual':>9} {'gap m':>8} {'solves':>6} {'most':>4} {'cut':>4} "
        f"{'pull kN':>13} {'no rollback':>12} {'serial':>12} {'parallel':>12}"
    )
    rows = [
        f"  {o.state:9} {o.mass_kg:8.0e} {o.step_s:6g} {o.residual:9.1e} {o.gap_m:8.0e} {o.solves:6.1f} {o.most_solves:4d} {o.rejected:4d} "
        f"{o.least_pull:5.0f} to {o.largest_pull:5.0f} "
        f"{ended('without rollback', o):>12} {ended('serial', o):>12} {ended('parallel', o):>12} "
        f"{_verdict(o.holds)} {o.message}"
        for o in outcomes
        if o.scheme == "energy-consistent"
    ]
    count = len(outcomes) // len(labels)
    end = f"  run to the end, of {count}: " + ", ".join(f"{label} {number}" for label, number in through.items())
    return "\n".join([head, *rows, end])
