"""The command `bench`: its tables, its errors against steps of known order, its exit codes."""

import csv

import numpy as np
import pytest

from master.__main__ import main
from master.benchmarks import line, scaling
from master.benchmarks.line import LineCase, Setting
from master.hard_cases import swing

QUICK = LineCase(swing(2.0, 12.0), 12.0, tuple(Setting(16, h) for h in (0.4, 0.2, 0.1)), Setting(16, 0.025), 1)


def table(path):
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_heave_has_the_time_rules_second_order_and_writes_its_table(tmp_path, monkeypatch, capsys):
    """Same mesh, steps halved: the position error falls by 4, less what the reference's own step of 0.025 s leaves (6 % of it at 0.1 s)."""
    monkeypatch.setitem(line.CASES, "heave", QUICK)
    assert main(["bench", "heave", "-o", str(tmp_path)]) == 0
    rows = table(tmp_path / "heave.csv")
    assert list(rows[0]) == ["contestant", "elements", "step_s", "mesh", "cpu_s", "position_rms_m", "top_force_rms_N", "bending_rms_N_m"]
    errors = np.array([float(row["position_rms_m"]) for row in rows])
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(2.0, abs=0.3)
    assert (tmp_path / "heave.png").stat().st_size > 0
    assert "uncertainty of the reference" in capsys.readouterr().out


@pytest.mark.parametrize(("limit", "code"), [(1e9, 0), (1e-9, 1)])
def test_nodes_exits_with_1_where_a_limit_is_not_kept(tmp_path, monkeypatch, limit, code):
    monkeypatch.setattr(scaling, "COUNTS", (50, 100))
    for name in ("LARGEST_EXPONENT", "LARGEST_MB", "LARGEST_RATIO"):
        monkeypatch.setattr(scaling, name, limit)
    assert main(["bench", "nodes", "-o", str(tmp_path)]) == code
    assert [int(row["nodes"]) for row in table(tmp_path / "nodes.csv")] == [50, 100]


def test_an_unknown_case_is_a_mistake_in_the_call(tmp_path, capsys):
    assert main(["bench", "fast", "-o", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err == "pipelay: case = 'fast': must be one of 'heave', 'snap', 'nodes'\n"
    assert not (tmp_path / "out").exists()
