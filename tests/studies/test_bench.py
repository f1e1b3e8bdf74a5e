"""The command `bench`: its tables, its errors against steps of known order, the contestants at rest on the same line, its exit codes."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from master.__main__ import main
from master.errors import RunError
from master.studies.benchmarks import (
    costs,
    coupled,
    forces,
    line,
    own_step,
    paper_method,
    peer_exudyn,
    peer_moordyn,
    scaling,
    start,
    statics,
    study,
)
from master.studies.benchmarks.histories import LineCase, Setting
from master.studies.hard_cases import swing
from pipe_fmu import Pipe

STEPS = tuple(Setting(line.OWN, 16, h, "adapted", 1) for h in (0.4, 0.2, 0.1))
FINE = Setting(line.OWN, 16, 0.025, "adapted")
QUICK = LineCase(swing(2.0, 12.0), 12.0, STEPS, FINE, STEPS[-1])
STILL = LineCase(swing(0.0, 12.0), 1.6, STEPS, FINE, FINE)
COARSE = replace(line.PIPE, nodes=49, mesh="uniform")


def table(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_heave_has_the_time_rules_second_order_and_writes_its_table(tmp_path, monkeypatch, capsys):
    """Same mesh, steps halved: the position error falls by 4, less what the reference's own step of 0.025 s leaves (6 % of it at 0.1 s)."""
    monkeypatch.setitem(line.CASES, "heave", QUICK)
    monkeypatch.setitem(line.RACES, "heave", ())
    assert main(["bench", "heave", "-o", str(tmp_path)]) == 0
    rows = table(tmp_path / "heave.csv")
    assert {"contestant", "elements", "step_s", "cpu_s", *line.KEYS} <= set(rows[0])
    errors = np.array([float(row["position_rms_m"]) for row in rows])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.3)
    assert (tmp_path / "heave.png").stat().st_size > 0
    assert "uncertainty of the reference" in capsys.readouterr().out


def test_a_race_compares_with_the_cheapest_of_ours_that_is_as_good_and_a_lost_one_exits_with_1(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(line.CASES, "heave", QUICK)
    monkeypatch.setitem(line.RACES, "heave", (line.Race(STEPS[-1], 1e9, 1e3),))
    assert main(["bench", "heave", "-o", str(tmp_path)]) == 1
    assert "NOT KEPT" in capsys.readouterr().out
    rows = [
        {"contestant": one, "elements": n, "step_s": 0.1, "position_rms_m": error, "cpu_share": cpu}
        for one, n, error, cpu in (("step", 16, 2e-3, 1.0), ("step", 32, 1e-3, 2.0), ("step", 64, 1e-4, 4.0), (line.EXUDYN, 48, 1e-3, 8.0))
    ]
    did, did_not = (line.Race(Setting(line.EXUDYN, n, 0.1), 3.0, 1e-3) for n in (48, 96))
    monkeypatch.setitem(line.RACES, "heave", (did, did_not))
    assert [(found, least) for _, found, least in line.verdicts("heave", rows)] == [(4.0, 3.0)]


def test_a_step_longer_than_the_time_between_instants_is_interpolated():
    """A curve through the ends of steps of 0.8 s against steps of 0.4 s: no worse than twice the time rule's own fourfold error.

    For the bending moment than the curve's sixteenfold, its fourth order, which is larger than the time rule's.
    """
    case = replace(QUICK, duration=24.0)
    exact = line._run(case, FINE)[1]
    short, long = (line._run(case, Setting(line.OWN, 16, h, "adapted"))[1].distance(exact) for h in (0.4, 0.8))
    assert np.all(np.array(long) < np.array([8.0, 8.0, 16.0]) * np.array(short))


def rest():
    """Positions at the quarters and top force of the line at rest, on a fine mesh of ours, which tests of statics hold against others."""
    pipe = Pipe(replace(line.PIPE, nodes=193))
    found, _ = pipe.start(0.0)
    return own_step.quarters(pipe, found.position, found.quaternion).ravel(), found.top[:3]


@pytest.mark.parametrize(("contestant", "setting", "metres", "share"), [
    (paper_method, Setting("paper", 48, 1e-3), 0.06, 2e-3),
    (peer_exudyn, Setting(line.EXUDYN, 48, 0.1), 5e-3, 1e-4),
    (peer_moordyn, Setting(line.MOORDYN, 48, 0.00625), 0.06, 2e-2),
])
def test_every_contestant_hangs_as_the_same_line(contestant, setting, metres, share):
    """Held still: weight, current, drag, stiffness and clamp agree, to the error of 25 m elements (linear, cubic, lumped)."""
    needs = {peer_exudyn: "exudyn", peer_moordyn: "moordyn"}.get(contestant)
    if needs:
        pytest.importorskip(needs)
    _, found = contestant.run(COARSE, STILL, setting)
    place, force = rest()
    assert found.position[-1].ravel() == pytest.approx(place, abs=metres)
    assert np.linalg.norm(found.top_force[-1] - force) <= share * np.linalg.norm(force)


def test_the_papers_internal_forces_are_the_gradient_of_its_discrete_energy():
    """Central differences of 1/2 (n.strain + m.curvature) h summed over the elements, eq. (73); no load acts."""
    random, h, n = np.random.default_rng(1), 2.0, 4
    stiffness = np.array([5.0, 3.0, 2.0, 4.0, 1.5])
    position = np.column_stack([h * np.arange(n), np.zeros(n), np.zeros(n)]) + 0.1 * random.normal(size=(n, 3))
    angles, still = 0.3 * random.normal(size=(n, 3)), np.zeros((n, 3))

    def energy(x, theta):
        total = 0.0
        for e in range(n - 1):
            rotation, rates = paper_method.rotation_and_rates(0.5 * (theta[e] + theta[e + 1]))
            strain = rotation.T @ (x[e + 1] - x[e]) / h - [1.0, 0.0, 0.0]
            kappa = rates @ (theta[e + 1] - theta[e]) / h
            total += 0.5 * h * (stiffness[[0, 1, 1]] @ strain**2 + stiffness[2:] @ kappa**2)
        return total

    force, moment, _ = paper_method.forces(position, angles, still, h, stiffness, 0.0, 0.0, 0.0, np.array([1.0, 0.0]))
    for k in range(n):
        for i in range(3):
            d = np.zeros((n, 3))
            d[k, i] = 1e-6
            assert force[k, i] == pytest.approx(-(energy(position + d, angles) - energy(position - d, angles)) / 2e-6, abs=1e-7)
            assert moment[k, i] == pytest.approx(-(energy(position, angles + d) - energy(position, angles - d)) / 2e-6, abs=1e-7)


def test_the_papers_method_cannot_hold_a_vertical_pipe():
    upright = replace(COARSE, foot="pinned", top_position=(0.0, 0.0, -800.0), length=800.5)
    with np.errstate(all="ignore"), pytest.raises((RunError, ZeroDivisionError, np.linalg.LinAlgError)):
        paper_method.run(upright, STILL, Setting("paper", 48, 1e-3))


def test_statics_against_collocation_falls_with_the_fourth_power_of_the_elements():
    """Tension at the top on equal meshes, against `solve_bvp` on equations of its own."""
    parameters = statics.paper()
    exact = statics.run(parameters, statics.Setting(statics.COLLOCATION, tolerance=1e-8))[2]
    errors = [np.abs(statics.run(parameters, statics.Setting(statics.UNIFORM, n))[2] / exact - 1.0)[0] for n in (48, 96)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.7)
    fine = statics.run(parameters, statics.Setting(statics.ADAPTED, 192))[2]
    assert fine[0] == pytest.approx(exact[0], rel=1e-6)
    assert fine[1:] == pytest.approx(exact[1:], abs=1e-6 * exact[1])  # the top hangs as it likes, and bends next to nothing


def test_the_papers_scene_through_the_fmus_has_the_errors_of_both_solved_as_one(tmp_path, monkeypatch, capsys):
    """With matched steps they are the same scheme; the explicit exchange, first order in the step, is not."""
    settings = [coupled.Setting(one, 12, 0.5) for one in (coupled.CONSISTENT, coupled.MONOLITHIC, "serial")]
    monkeypatch.setattr(coupled, "DURATION", 16.0)
    monkeypatch.setattr(coupled, "OWN", settings[0])
    monkeypatch.setattr(coupled, "SETTINGS", settings)
    monkeypatch.setattr(coupled, "REFERENCE", coupled.Setting(coupled.MONOLITHIC, 12, 0.1))
    monkeypatch.setattr(coupled, "CHECK", coupled.Setting(coupled.MONOLITHIC, 12, 0.2))
    monkeypatch.setattr(coupled, "LARGEST_RATIO", 0.0)
    assert main(["bench", "paper", "-o", str(tmp_path)]) == 1
    assert "CPU time, FMUs and master over both solved as one" in capsys.readouterr().out
    fmus, one, serial = (np.array([float(row[key]) for key in coupled.KEYS]) for row in table(tmp_path / "paper.csv"))
    assert fmus == pytest.approx(one, rel=1e-3)
    assert serial[2] > 2.0 * fmus[2]


def test_costs_names_every_optional_piece_and_each_can_be_stepped(monkeypatch):
    monkeypatch.setattr(costs, "STEPS", 3)
    found = {name: costs.measure(parameters)[1] for name, parameters in costs.variants().items()}
    assert {"current", "seabed", "seabed and friction", "added mass", "internal damping", "numerical damping"} <= set(found)
    assert all(corrections >= 1.0 for corrections in found.values())


def test_importing_the_packages_compiles_nothing():
    assert start.compiled_by_import() == 0


@pytest.mark.parametrize(("limit", "code"), [(1e9, 0), (1e-9, 1)])
def test_nodes_exits_with_1_where_a_limit_is_not_kept(tmp_path, monkeypatch, limit, code):
    monkeypatch.setattr(scaling, "COUNTS", (50, 100))
    for name in ("LARGEST_EXPONENT", "LARGEST_MB", "LARGEST_RATIO"):
        monkeypatch.setattr(scaling, name, limit)
    assert main(["bench", "nodes", "-o", str(tmp_path)]) == code
    assert [int(row["nodes"]) for row in table(tmp_path / "nodes.csv")] == [50, 100]


def test_what_is_not_installed_is_left_out_and_said(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(line.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setitem(line.CASES, "heave", replace(QUICK, settings=(STEPS[0], Setting(line.MOORDYN, 48, 0.00625))))
    assert main(["bench", "heave", "-o", str(tmp_path)]) == 0
    assert [row["contestant"] for row in table(tmp_path / "heave.csv")] == ["step"]
    assert "not installed, so left out: exudyn, moordyn" in capsys.readouterr().out


def test_an_unknown_case_is_a_mistake_in_the_call(tmp_path, capsys):
    assert main(["bench", "fast", "-o", str(tmp_path / "out")]) == 2
    allowed = ", ".join(map(repr, study.NAMES))
    assert capsys.readouterr().err == f"pipelay: case = 'fast': must be one of {allowed}\n"
    assert not (tmp_path / "out").exists()


def test_bending_moments_in_motion_gain_with_the_elements(monkeypatch, tmp_path, capsys):
    """From 24 to 48 equal elements more than the factor 4 of a recovery without inertia."""
    monkeypatch.setattr(forces, "COUNTS", (24, 48))
    monkeypatch.setattr(forces, "REFERENCE", 192)
    monkeypatch.setattr(forces, "_DURATION", 16.0)
    assert main(["bench", "forces", "-o", str(tmp_path)]) == 0
    rows = [row for row in table(tmp_path / "forces.csv") if row["mesh"] == "uniform"]
    for coarse, fine in zip(rows[::2], rows[1::2], strict=True):
        assert float(coarse["nodal_moment"]) > 4.0 * float(fine["nodal_moment"])
