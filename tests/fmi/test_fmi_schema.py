"""Parameters: mapping, dataclass tree and flat FMI list are the same thing; every refusal is one line with key, value, rule."""

import math
from dataclasses import dataclass, field
from typing import Literal

import pytest

from master.fmi import schema


@dataclass(frozen=True)
class Bed:
    friction: float = field(default=0.3, metadata={"unit": "1", "min": 0.0, "doc": "Coulomb"})

    def __post_init__(self) -> None:
        if not self.friction >= 0.0:
            raise ValueError(f"friction = {self.friction}: must be >= 0")


@dataclass(frozen=True)
class Row:
    length: float = field(metadata={"unit": "m", "above": 0.0})
    name: str = "steel"


@dataclass(frozen=True)
class Line:
    length: float = field(metadata={"unit": "m", "above": 0.0, "doc": "unstretched"})
    nodes: int = field(default=48, metadata={"unit": "1", "min": 2, "max": 500})
    foot: Literal["clamped", "pinned"] = "clamped"
    quiet: bool = False
    top: tuple[float, float, float] = field(default=(0.0, 0.0, -800.0), metadata={"unit": "m"})
    period: float | None = None
    bed: Bed | None = None
    depths: tuple[float, ...] = ()
    rows: tuple[Row, ...] = ()


FULL = {
    "length": 1200,
    "nodes": 24,
    "foot": "pinned",
    "quiet": True,
    "top": [1, 2.5, 1e-17],
    "period": 0.1,
    "bed": {"friction": 1 / 3},
    "depths": [0.0, 800.0],
    "rows": [{"length": 3.0, "name": 'a "quoted" one'}, {"length": 4.0}],
}


def test_mapping_and_json_keep_every_bit():
    tree = schema.build(Line, FULL)
    assert tree.length == 1200.0
    assert isinstance(tree.length, float)
    assert tree.bed == Bed(1 / 3)
    assert schema.build(Line, schema.to_mapping(tree)) == tree
    assert schema.from_json(Line, schema.to_json(tree)) == tree


def test_flat_names_units_and_ranges():
    flat = schema.flatten(schema.build(Line, FULL))
    assert flat["top[2]"] == schema.Parameter("Real", 2.5, "m")
    assert flat["nodes"] == schema.Parameter("Integer", 24, "", 2, 500)
    assert flat["length"] == schema.Parameter("Real", 1200.0, "m", 0.0, None, "unstretched", above=True)
    assert flat["bed.friction"].value == 1 / 3
    assert flat["quiet"].kind == "Boolean"
    assert flat["foot"] == schema.Parameter("Enumeration", "pinned", items=("clamped", "pinned"))
    assert flat["depths"].value == "[0.0,800.0]"
    assert "bed.friction" not in schema.flatten(Line(10.0))


def test_override_of_every_flat_value_with_itself_changes_nothing():
    tree = schema.build(Line, FULL)
    assert schema.override(tree, {name: it.value for name, it in schema.flatten(tree).items()}) == tree


def test_override_reaches_nested_and_vector_values():
    tree = schema.override(schema.build(Line, FULL), {"bed.friction": 0.5, "top[3]": -7.0, "depths": "[1.0]"})
    assert (tree.bed, tree.top, tree.depths) == (Bed(0.5), (1.0, 2.5, -7.0), (1.0,))


REFUSED = {
    "pipe.lenght = 3: unknown key (did you mean length?); allowed: length, nodes, foot": {"lenght": 3},
    "pipe.length: must be given": {},
    "pipe.length = 'long': must be a number": {"length": "long"},
    "pipe.length = True: must be a number": {"length": True},
    "pipe.length = nan: must be finite": {"length": math.nan},
    "pipe.length = inf: must be finite": {"length": math.inf},
    "pipe.nodes = 2.5: must be an integer": {"length": 1, "nodes": 2.5},
    "pipe.foot = 'loose': must be one of 'clamped', 'pinned'": {"length": 1, "foot": "loose"},
    "pipe.quiet = 1: must be true or false": {"length": 1, "quiet": 1},
    "pipe.top = 3: must be a list": {"length": 1, "top": 3},
    "pipe.top = [1, 2]: must have 3 values": {"length": 1, "top": [1, 2]},
    "pipe.top[2] = nan: must be finite": {"length": 1, "top": [1, math.nan, 2]},
    "pipe.bed = 3: must be a table": {"length": 1, "bed": 3},
    "pipe.bed.friction = -0.1: must be >= 0": {"length": 1, "bed": {"friction": -0.1}},
    "pipe.rows[2].length: must be given": {"length": 1, "rows": [{"length": 1}, {}]},
}


@pytest.mark.parametrize("message", REFUSED)
def test_refusal_names_key_value_and_rule(message):
    with pytest.raises(ValueError, match="pipe") as caught:
        schema.build(Line, REFUSED[message], "pipe")
    assert str(caught.value).startswith(message)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"bed.grip": 1.0}, "bed.grip = 1.0: unknown parameter; allowed: length"),
        ({"top[4]": 1.0}, "top[4] = 1.0: unknown parameter"),
        ({"depths": "[1,"}, "depths = '[1,': must be JSON"),
        ({"bed.friction": -1.0}, "bed.friction = -1.0: must be >= 0"),
    ],
)
def test_override_refuses_as_build_does(changes, message):
    with pytest.raises(ValueError, match="=") as caught:
        schema.override(schema.build(Line, FULL), changes)
    assert str(caught.value).startswith(message)
