"""The paper's scene from the command line to the files, through the FMUs, against what it must show."""

import json
import math

import numpy as np
import pytest

from master.__main__ import main
from master.scene import reading
from master.with_units.monolithic import march
from pipe_fmu import Pipe


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = tmp_path_factory.mktemp("paper")
    assert main(["run", "-o", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def summary(results):
    return json.loads((results / "summary.json").read_text())


def column(results, name):
    header, *_ = (results / "signals.csv").read_text().splitlines()
    titles = [title.partition(" [")[0] for title in header.split(",")]
    return np.loadtxt(results / "signals.csv", delimiter=",", skiprows=1, usecols=titles.index(name))


def test_the_bond_makes_no_energy_and_the_ledger_closes(summary):
    assert summary["exchanged_energy_J"] > 1e6
    assert summary["interface_residual_J"] <= 1e-8 * summary["exchanged_energy_J"]
    assert summary["ledger_closure_J"] <= 1e-8 * summary["exchanged_energy_J"]


def test_both_units_hold_the_same_pose_at_all_times(summary):
    assert summary["pose_gap_m"] <= 1e-9
    assert summary["pose_gap_rad"] <= 1e-10


def test_the_controller_brings_the_vessel_to_its_set_point(summary):
    x, y, _ = summary["final_vessel_position_m"]
    assert math.hypot(x - 780.0, y) <= 1.0
    assert summary["final_vessel_speed_m_s"] <= 0.05


def test_the_vessel_rests_in_equilibrium_until_the_current_comes(results):
    early = column(results, "time") < 10.0 - 1e-6
    for name in ("surge_velocity", "sway_velocity", "heave_velocity", "roll_rate", "pitch_rate", "yaw_rate"):
        assert np.abs(column(results, name)[early]).max() < 1e-7


def test_every_column_of_the_signals_has_a_unit_and_every_value_is_finite(results):
    header = (results / "signals.csv").read_text().partition("\n")[0]
    assert all(title.endswith("]") and " [" in title for title in header.split(","))
    assert np.isfinite(np.loadtxt(results / "signals.csv", delimiter=",", skiprows=1)).all()


def test_the_files_promised_are_there(results):
    names = {path.name for path in results.iterdir()}
    assert {"signals.csv", "shapes.npz", "summary.json", "energy.png"} <= names
    assert sorted(name[:4] for name in names if name.startswith("fig")) == [f"fig{n}" for n in range(3, 10)]


@pytest.fixture(scope="module")
def together():
    """The last moment of pipe and vessel solved as one, and the corrections of every step of the pipe."""
    corrections, step = [], Pipe.step

    def counted(*arguments, **options):
        result = step(*arguments, **options)
        corrections.append(result.iterations)
        return result

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Pipe, "step", counted)
        *_, last = march(reading.load("paper"))[2]
    return last, corrections


def test_newton_takes_at_most_four_corrections_from_the_extrapolated_last_step(together):
    assert len(together[1]) >= 3000
    assert max(together[1]) <= 4


def test_the_fmus_agree_with_both_models_solved_as_one(results, together):
    last, _ = together
    with np.load(results / "shapes.npz") as shapes:
        assert shapes["t"][-1] == pytest.approx(last.time, abs=1e-9)
        np.testing.assert_allclose(shapes["position"][-1], last.pipe.position, rtol=0.0, atol=1e-6)
