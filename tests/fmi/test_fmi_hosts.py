"""Hosts that are not ours run the exported files, each in a process and with a package folder of its own.

What a host without iteration must compute is known: the parallel exchange, done here by FMI calls of our own (`hosts.exchange`), in the
host's own steps. Nothing but round-off may lie between the two. How far that exchange is from the monolithic solution is another
matter, and of first order in the step.
"""

import shutil
import sys

import numpy as np
import pytest
from hosts import NotHereError, error, exchange, install, reference, residual, run, sampled
from run_host import own

from master.__main__ import main
from master.fmi.system import PORTS, osp_structure

END = 6.0  # s
STEPS = (0.05, 0.01)  # s
CHANGES = ["environment.current.start=0", "environment.current.ramp=2", "vessel.controller.start=1", f"simulation.duration={END}",
           "simulation.snapshots=[]"]  # fmt: skip
HELD = [change for change in CHANGES if "controller" not in change] + ["vessel.controller.start=1000"]
ROUND_OFF = 1e-6  # m; hosts add up their time in ways of their own, libcosim in nanoseconds


def export(folder, scene, changes):
    assert main(["export", "-o", str(folder), "--scene", scene, *(f"--set={change}" for change in changes)]) == 0
    return folder


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    return export(tmp_path_factory.mktemp("exported"), "paper", CHANGES)


@pytest.fixture(scope="module")
def exact():
    return reference("paper", CHANGES, 0.01, END)


@pytest.fixture(scope="module")
def exchanged(exported):
    """What a parallel exchange of fixed steps gives, by step."""
    return {step: exchange(exported, steps_of(step)) for step in STEPS}


def steps_of(step, end=END):
    return step * np.arange(1, round(end / step) + 1)


@pytest.fixture
def hosted(tmp_path, tmp_path_factory):
    """A host's rows on a copy of exported files."""

    def rows_of(host, exported, step):
        files = shutil.copytree(exported, tmp_path / "files")
        try:
            rows, wall = run(host, files, install(host, tmp_path_factory.getbasetemp() / host), step, END)
        except NotHereError as reason:
            pytest.skip(str(reason))
        sys.stdout.write(f"{host:9} H {step} s: {len(rows)} steps, wall {wall:.1f} s\n")
        return rows

    return rows_of


def test_the_parallel_exchange_goes_to_the_monolithic_solution_with_the_first_order_of_the_step(exchanged, exact):
    """Position and bond energy: a fifth of the step, a fifth of the error; and what is left after extrapolation to no step is less."""
    coarse, fine = (exchanged[step] for step in STEPS)
    ratio = STEPS[0] / STEPS[1]
    for measure in (lambda rows: error(rows, exact), residual):
        assert measure(coarse) / measure(fine) == pytest.approx(ratio, rel=0.2)
    limit = (ratio * sampled(fine, len(exact)) - sampled(coarse, len(exact))) / (ratio - 1.0)
    assert np.abs(limit - exact).max() < 0.1 * error(fine, exact)


@pytest.mark.parametrize(("scene", "end"), [("paper", 45.0), ("free-decay", 20.0)])
def test_the_parallel_exchange_is_stable_and_useful_on_the_scenes_as_they_are(scene, end, tmp_path):
    """At 0.05 s: within a hundredth of the pipe's diameter of our own master, and a bond that makes a few percent at most."""
    files = export(tmp_path, scene, [f"simulation.duration={end}", *(["simulation.snapshots=[]"] if scene == "paper" else [])])
    rows, exact = exchange(files, steps_of(0.05, end)), np.array(list(own(files, 0.05, end)), dtype=float)
    assert np.abs(rows[:, 1:4] - exact[:, 1:4]).max() < 0.01 * 0.4064
    assert residual(rows) < 0.03


def test_our_master_needs_no_extrapolation(hosted, exported, exact):
    """Second order, so a hundredth of the exchange's error at most, and a bond that makes no energy."""
    rows = hosted("own", exported, STEPS[0])
    assert error(rows, exact) < 1e-5
    assert residual(rows) < 1e-9


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("host", ["fmpy_ssp", "libcosim", "ecos", "cofmupy"])
def test_a_host_of_fixed_steps_does_the_parallel_exchange(host, step, hosted, exported, exchanged):
    np.testing.assert_allclose(hosted(host, exported, step)[:, 1:], exchanged[step][:, 1:], rtol=ROUND_OFF, atol=ROUND_OFF)


@pytest.mark.parametrize("host", ["ecco_file", "ecco"])
def test_ecco_does_the_parallel_exchange_in_steps_of_its_choice(host, hosted, tmp_path_factory):
    """Its steps are those allowed, and it is no worse than with the longest of them throughout.

    The vessel's controller sleeps: it takes its samples at the first step that begins after they are due, so that steps which miss its
    period cost more than any exchange.
    """
    files = export(tmp_path_factory.mktemp("held"), "paper", HELD)
    rows, exact = hosted(host, files, STEPS[0]), reference("paper", HELD, 0.01, END)
    np.testing.assert_allclose(rows[:, 1:], exchange(files, rows[:, 0])[:, 1:], rtol=ROUND_OFF, atol=ROUND_OFF)
    steps, longest = np.diff(rows[:, 0]), 0.1  # the scene's macro_step
    assert steps.min() > 0.005 - 1e-8
    assert steps.max() < longest + 1e-8
    assert error(rows, exact) < error(exchange(files, steps_of(longest)), exact) + ROUND_OFF


@pytest.mark.parametrize(("macro_step", "shortest"), [(0.1, 0.005), (0.5, 0.025)])
def test_the_steps_of_ecco_end_at_the_macro_step(macro_step, shortest):
    found = osp_structure({}, macro_step, bond=0).find("EccoConfiguration")
    assert [float(found.findtext(f"{name}StepSize")) for name in ("", "Minimum", "Maximum")] == [macro_step, shortest, macro_step]


def test_libcosim_connects_the_mechanical_ports_as_such(hosted, exported, exchanged, tmp_path):
    """The port groups of both model descriptions, connected whole, are the connections of the structure one by one."""
    files = shutil.copytree(exported, tmp_path / "whole")
    structure = files / "OspSystemStructure.xml"
    before, _, rest = structure.read_text().partition("<Connections>")
    groups = "".join(
        "<VariableGroupConnection>"
        + "".join(f'<VariableGroup simulator="{unit}" name="{port[1]}"/>' for unit in ("vessel", "pipe"))
        + "</VariableGroupConnection>"
        for port in PORTS["pipe"]
    )
    structure.write_text(f"{before}<Connections>{groups}</Connections>{rest.partition('</Connections>')[2]}")
    rows = hosted("libcosim", files, STEPS[0])
    np.testing.assert_allclose(rows[:, 1:], exchanged[STEPS[0]][:, 1:], rtol=ROUND_OFF, atol=ROUND_OFF)
