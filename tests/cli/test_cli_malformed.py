"""Malformed scenes, values and folders: each is one line that a terminal can show, with exit code 2, and leaves nothing behind.

They are refused before anything is computed. Those of `test_scene_loading` are met here as the command line meets them.
"""

import os

import pytest
from bad_scenes import BAD_CHANGES, MINIMAL

from master.__main__ import main
from master.with_units import statics

ALONE = MINIMAL.replace("x = 800.0", "x = 800.0\nz = -800.0")  # a whole scene
DIGITS = 5000
LONG = "n" * 300

CONTENTS = {  # of a scene file: what is wrong, and what the line must name
    "empty": (b"", "start: must be given"),
    "no TOML": (b"duration: 300", "not TOML"),
    "text not ended": (b'title = "', "not TOML"),
    "binary": (bytes(range(256)), "must be UTF-8 text"),
    "UTF-16": (MINIMAL.encode("utf-16"), "must be UTF-8 text"),
    "Latin-1": ('title = "Rør"'.encode("latin-1"), "must be UTF-8 text"),
    "byte order mark": (MINIMAL.encode("utf-8-sig"), "not TOML"),
    "null character": (b"a\0 = 1", "not TOML"),
    "a key twice": (b"[start]\nx = 1\nx = 2", "not TOML"),
    "a table twice": (b"[start]\nx = 1\n[start]\ny = 2", "not TOML"),
    "lists within lists": (b"a = " + b"[" * DIGITS + b"]" * DIGITS, "not TOML: maximum recursion depth"),
    "tables within tables": (b"a = " + b"{a=" * DIGITS + b"1" + b"}" * DIGITS, "not TOML: maximum recursion depth"),
    "dots within dots": (b"a." * DIGITS + b"a = 1", "must not nest more than 20"),
    "lists within lists, fewer": (b"a = " + b"[" * 100 + b"]" * 100, "must not nest more than 20"),
    "headers of many dots": (b"[" + b"pipe." * DIGITS + b"a]", "must not nest more than 20"),
    "digits": (b"a = " + b"9" * DIGITS, "not TOML: Exceeds the limit"),
    "hexadecimal digits": (b"[pipe]\nlength = 0x" + b"f" * DIGITS, "pipe.length has 20000 bits: must be finite"),
    "escape sequence in a key": (ALONE.encode() + b'"\\u001b[2J\\u0007" = 1', r"\x1b[2J\x07"),
    "escape sequence in a value": (ALONE.encode() + b'mesh = "\\u001b]0;owned\\u0007"', r"\x1b]0;owned\x07"),
    "lines in a key": (ALONE.encode() + b'"a\\nb\\rc" = 1', r"a\nb\rc"),
    "text turned round": (ALONE.encode() + b'"\\u202eabc" = 1', r"\u202eabc"),
    "pipe is a list": (ALONE.replace("[pipe]", "[[pipe]]").encode(), "pipe = "),
    "pipe is text": (b'pipe = "long"\n' + ALONE.replace("[pipe]\nlength = 1200.0", "").encode(), "pipe = 'long': must be a table"),
    "date for a number": (ALONE.replace("1200.0", "1979-05-27").encode(), "pipe.length = "),
    "number for a text": (b"title = 5\n" + ALONE.encode(), "title = 5: must be a text"),
    "no environment": (ALONE.replace("[environment]", "").encode(), "environment: must be given"),
    "units are no table": (b"units = 3", "units = 3: must be a table"),
    "one unit": (b"[units.a]\nfmu='a'", "simulation: must be given"),
    "unit of text": (b"[units]\na = 'x'\n[simulation]\nduration=1\n[bond]\n", "units.a = 'x': must be a table"),
}
VALUES = {  # of a key in the paper's scene
    "pipe.length=1e308": "pipe.length = 1e+308: must be 0, or in amount from 1e-30 to 1e+30",
    "pipe.length=-1e308": "pipe.length = -1e+308: must be",
    "pipe.length=1e-308": "pipe.length = 1e-308: must be",
    "pipe.length=nan": "pipe.length = nan: must be finite",
    "pipe.length=-inf": "pipe.length = -inf: must be finite",
    "pipe.length=0": "pipe.length = 0",
    "pipe.length=[1200]": "pipe.length = [1200]: must be a number",
    "pipe.length={}": "pipe.length = {}: must be a number",
    "pipe.nodes=0": "pipe.nodes = 0",
    "pipe.nodes=2.5": "pipe.nodes = 2.5: must be an integer",
    f"pipe.nodes={10**18}": f"pipe.nodes = {10**18}",
    "pipe.tolerance=-1": "pipe.tolerance = -1",
    "pipe.section.outer_diameter=0": "pipe.section.outer_diameter = 0",
    "pipe.section.wall_thickness=9": "pipe.section.wall_thickness = 9",
    "pipe.seabed.friction=-1": "pipe.seabed.friction = -1",
    'pipe.top="welded"': "pipe.top = 'welded': must be one of",
    "vessel.mass=-1": "vessel.mass = -1",
    "vessel.hang_off=[1, 2]": "vessel.hang_off = [1, 2]: must have 3 values",
    "vessel.controler.x=1": "did you mean controller?",
    "environment.depth=0": "environment.depth = 0",
    "environment.current.velocity=5": "environment.current.velocity = 5: must be a list",
    "start=5": "start = 5: must be a table",
    "a b=1": "--set a b=1: the value must be",
    "=1": "--set =1: must be key=value",
}
FOLDERS = {  # for results: how they come to be, and what the line must name
    "dangling link": (lambda at: at.symlink_to(at.parent / "absent"), "is a link to nothing"),
    "below a dangling link": (lambda at: at.parent.joinpath("x").symlink_to("absent") or at.parent / "x" / "out", "x is a link to nothing"),
    "link to itself": (lambda at: at.symlink_to(at), "Too many levels of symbolic links|is a link to nothing"),
    "long name": (lambda at: at.parent / LONG, "cannot be written (File name too long)"),
    "below a long name": (lambda at: at.parent / LONG / "out", "cannot be written (File name too long)"),
    "file": (lambda at: at.touch(), "is a file, not a folder"),
    "below a file": (lambda at: at.touch() or at / "out", "is a file, not a folder"),
    "system's": (lambda _: "/proc/self/out", "cannot be written"),
}
SCENES = {  # their names, or what is made at their place
    "long name": (lambda at: LONG, "unknown built-in scene"),
    "long file name": (lambda at: f"{LONG}.toml", "cannot be read (File name too long)"),
    "null character": (lambda at: "a\0.toml", "cannot be read"),
    "folder": (lambda at: at.mkdir(), "cannot be read (Is a directory)"),
    "dangling link": (lambda at: at.symlink_to("absent"), "no such file"),
    "link to itself": (lambda at: at.symlink_to(at), "cannot be read"),
    "below a file": (lambda at: at.touch() or at / "a.toml", "cannot be read (Not a directory)"),
}

FILES = {  # of a unit of a scene of two FMUs: TOML text, and what the line must name
    "null character": (r'"a\u0000.fmu"', r"units.a.fmu = 'a\x00.fmu': no such file"),
    "long name": (f'"{LONG}.fmu"', "no such file"),
    "nothing": ('""', "units.a.fmu = '': no such file"),
    "device": ('"/dev/null"', "units.a.fmu = '/dev/null': no such file"),
    "escape sequence": (r'"\u001b[2J"', r"units.a.fmu = '\x1b[2J': no such file"),
    "no archive": ('"mine.toml"', "mine.toml: not a readable FMU"),
    "number": ("5", "units.a.fmu = 5: must be a text"),
}
TWO = """
[simulation]
duration = 1
macro_step = 0.1
[units]
a = {fmu = FILE}
b = {fmu = "b.fmu"}
[bond]
impedance = "a"
mobility = "b"
pairs = [{effort = "force", flow = "velocity", floor = 1}]
"""


@pytest.fixture(autouse=True)
def nothing_computed(monkeypatch):
    monkeypatch.setattr(statics, "_resolved", lambda *_: pytest.fail("a mesh was sought"))


def refused(arguments, named, capsys):
    """One line that names what is wrong, and nothing that a terminal would obey."""
    assert main(list(map(str, arguments))) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("pipelay: ")
    assert printed.err.endswith("\n")
    assert printed.err[:-1].isprintable()
    assert any(name in printed.err for name in named.split("|"))


@pytest.mark.parametrize("kind", CONTENTS)
def test_a_file_of_another_kind(kind, tmp_path, capsys):
    content, named = CONTENTS[kind]
    (tmp_path / "mine.toml").write_bytes(content)
    refused(["statics", tmp_path / "mine.toml"] if b"units" not in content else ["run", tmp_path / "mine.toml"], named, capsys)
    assert os.listdir(tmp_path) == ["mine.toml"]


@pytest.mark.parametrize("kind", FILES)
def test_a_unit_of_another_kind(kind, tmp_path, capsys):
    text, named = FILES[kind]
    (tmp_path / "mine.toml").write_text(TWO.replace("FILE", text))
    refused(["run", tmp_path / "mine.toml", "-o", tmp_path / "out"], named, capsys)
    assert os.listdir(tmp_path) == ["mine.toml"]


@pytest.mark.parametrize("change", VALUES)
def test_a_value_that_cannot_be(change, capsys):
    refused(["statics", "paper", "--set", change], VALUES[change], capsys)


@pytest.mark.parametrize("kind", BAD_CHANGES)
def test_a_change_that_the_scene_refuses(kind, tmp_path, capsys):
    change, named, _ = BAD_CHANGES[kind]
    refused(["run", "--set", change, "-o", tmp_path / "out"], named, capsys)
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("command", ["run", "export", "hard-cases"])
@pytest.mark.parametrize("kind", FOLDERS)
def test_a_folder_that_cannot_be_written(kind, command, tmp_path, capsys):
    make, named = FOLDERS[kind]
    place = make(tmp_path / "out") or tmp_path / "out"
    before = os.listdir(tmp_path)
    refused([command, "-o", place], named, capsys)
    assert os.listdir(tmp_path) == before


@pytest.mark.parametrize("kind", SCENES)
def test_a_scene_that_cannot_be_read(kind, tmp_path, capsys):
    make, named = SCENES[kind]
    refused(["run", make(tmp_path / "a.toml") or tmp_path / "a.toml", "-o", tmp_path / "out"], named, capsys)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("word", ["\x1b[31mred", "a\nb", "\u202e"])
def test_a_call_that_the_parser_refuses_shows_no_control_characters(word, capsys):
    with pytest.raises(SystemExit) as caught:
        main(["scenes", word])
    assert caught.value.code == 2
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.isprintable()
    assert last == f"pipelay: error: unrecognized arguments: {word.encode('unicode_escape').decode()}"


def test_there_are_sixty_and_more():
    assert len(CONTENTS) + len(VALUES) + len(BAD_CHANGES) + len(FOLDERS) + len(SCENES) + len(FILES) >= 90
