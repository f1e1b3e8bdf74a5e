"""Figures and recorded files from a catenary swinging in a current, with a made-up but plausible energy history."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from master.results.figures import bending, configurations, draw_all
from master.results.recorder import Shapes, Table

LENGTH, DEPTH, WEIGHT = 1200.0, 800.0, 759.1


def swinging_catenary(nodes: int = 48, instants: int = 301) -> Shapes:
    s, time = np.linspace(0.0, LENGTH, nodes), np.linspace(0.0, 300.0, instants)
    parameter = 500.0 + 20.0 * np.sin(time / 60.0)[:, None]
    x = parameter * np.arcsinh(s / parameter)
    z = parameter - np.sqrt(parameter**2 + s**2)
    y = 9.0 * (1.0 - np.exp(-np.maximum(time - 10.0, 0.0) / 12.0))[:, None] * (s / LENGTH) ** 2
    y *= np.exp(-np.maximum(time - 30.0, 0.0) / 60.0)[:, None]
    horizontal = WEIGHT * parameter
    tension = np.hypot(horizontal, WEIGHT * s)
    bending = 1.03e8 * parameter / (parameter**2 + s**2) + 2e5 * np.exp(-s / 20.0) * (parameter / 500.0 - 1.0)
    moment = np.stack([0.0 * bending, bending, 3e4 * np.sin(s / 200.0) * y / 9.0], axis=-1)
    shear = np.gradient(moment[..., 1:], s, axis=1)
    return Shapes(s, time, np.stack([x, y, z], axis=-1), tension, tension, moment, shear)


def energy_history() -> Table:
    time = np.linspace(0.0, 300.0, 3001)
    late = np.maximum(time - 10.0, 0.0)
    columns = {
        ("pipe_length", "m"): LENGTH + 0.12 + 0.002 * np.sin(time / 30.0),
        ("pipe.kinetic_energy", "J"): 2e5 * np.exp(-late / 40.0) * (late > 0.0),
        ("pipe.elastic_energy", "J"): 5e4 + 2e3 * np.sin(time / 30.0),
        ("pipe.gravity_energy", "J"): -3e8 - 1e6 * (1.0 - np.exp(-late / 90.0)),
        ("vessel.kinetic_energy", "J"): 9e5 * np.exp(-late / 70.0) * (1.0 - np.exp(-late / 20.0)),
        ("vessel.restoring_energy", "J"): 2e4 * (1.0 - np.exp(-late / 20.0)),
        ("pipe.current_work", "J"): 2e5 * late / 300.0,
        ("vessel.control_work", "J"): -3e6 * (1.0 - np.exp(-np.maximum(time - 30.0, 0.0) / 60.0)),
        ("vessel.current_work", "J"): 5e5 * late / 300.0,
        ("pipe.drag_dissipation", "J"): 3e5 * late / 300.0,
        ("vessel.damping_dissipation", "J"): 8e5 * late / 300.0,
        ("interface_residual", "J"): 1e-3 * late / 300.0,
        ("closure", "J"): 4e-4 * np.sin(time / 9.0),
        ("exchanged", "J"): 8e6 * late / 300.0,
        ("allowed", "J"): 3e-4 + 8e-2 * late / 300.0,
    }
    names, units = zip(*columns, strict=True)
    values = np.column_stack([time, *columns.values()])
    return Table(("time", *names), ("s", *units), values)


@pytest.fixture(scope="module")
def shapes() -> Shapes:
    return swinging_catenary()


def test_every_figure_of_the_paper_is_a_picture(tmp_path, shapes):
    files = draw_all(tmp_path, energy_history(), shapes, [30.0])
    assert [f.name[:4] for f in files] == [*(f"fig{n}" for n in range(3, 10)), "ener"]
    assert all(f.read_bytes().startswith(b"\x89PNG") for f in files)


@pytest.mark.parametrize("stretch", [1.0, 8.0])
def test_figure_3_shows_the_whole_pipe_in_one_scale_however_flat_it_lies(tmp_path, shapes, monkeypatch, stretch):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path: (figure.draw_without_rendering(), drawn.append(figure)))
    long = replace(shapes, position=shapes.position * [stretch, 1.0, 1.0])
    configurations(tmp_path / "fig3.png", long, [30.0])
    side, behind = drawn[0].axes
    for axes in (side, behind):
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        for line in axes.lines:
            x, y = line.get_data()
            assert left <= min(x) <= max(x) <= right
            assert low <= min(y) <= max(y) <= high
    assert side.get_aspect() == 1.0


def test_without_shapes_only_the_energy_figure_is_drawn(tmp_path):
    assert [f.name for f in draw_all(tmp_path, energy_history(), None, [])] == ["energy.png"]


def test_a_run_of_one_instant_can_be_drawn(tmp_path, shapes):
    table = energy_history()
    still = Shapes(shapes.s, *(getattr(shapes, n)[:1] for n in ("time", "position", "tension", "wall_tension", "moment", "shear")))
    assert len(draw_all(tmp_path, Table(table.names, table.units, table.values[:1]), still, [30.0])) == 8


def test_signals_read_back_to_the_same_bits(tmp_path):
    table = energy_history()
    table.write(tmp_path / "signals.csv")
    header = (tmp_path / "signals.csv").read_text().partition("\n")[0]
    assert header.startswith("time [s],pipe_length [m],pipe.kinetic_energy [J]")
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "signals.csv", delimiter=",", skiprows=1), table.values)


def test_shapes_archive_holds_arrays_over_instants_and_nodes(tmp_path, shapes):
    shapes.write(tmp_path / "shapes.npz")
    with np.load(tmp_path / "shapes.npz") as archive:
        assert {name: archive[name].shape for name in archive.files} == {
            "s": (48,),
            "t": (301,),
            "position": (301, 48, 3),
            "tension": (301, 48),
            "wall_tension": (301, 48),
            "moment": (301, 48, 3),
            "shear": (301, 48, 2),
        }


def test_figure_8_follows_the_bending_moment_between_the_nodes():
    """On 12 nodes a parabola's largest value, half way between two of them, is met; at the nodes the curve has their values."""
    s, time = np.linspace(0.0, 1100.0, 12), np.zeros(2)
    m2 = 1e5 - (s - 550.0) ** 2 / 4.0
    moment = np.tile(np.stack([0.0 * s, m2, 0.0 * s], axis=-1), (2, 1, 1))
    shear = np.tile(np.stack([0.0 * s, -(s - 550.0) / 2.0], axis=-1), (2, 1, 1))
    at, found = bending(Shapes(s, time, np.zeros((2, 12, 3)), np.zeros((2, 12)), np.zeros((2, 12)), moment, shear))
    np.testing.assert_allclose(found[0, ::8], m2, rtol=1e-12)
    assert found.max() == pytest.approx(1e5, rel=1e-4)
    assert at[found[0].argmax()] == 550.0
