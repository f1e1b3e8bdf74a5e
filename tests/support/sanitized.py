"""Exports the paper scene's FMUs with a C face compiled with more flags, for this platform: ``python sanitized.py folder flags``."""

import sys
from pathlib import Path

from master.fmi.native import machine
from master.scene.reading import load
from master.with_units import prepare

if __name__ == "__main__":
    machine.FLAGS = (*machine.FLAGS, *sys.argv[2:])
    prepare.PLATFORMS = (machine.own_platform(),)
    prepare.prepare(load("paper").mapping, Path(sys.argv[1]))
