"""Prepares many scenes in one process: mappings as a JSON list from standard input; prints, for each, its FMUs, run by Python if that is
asked for."""

import json
import sys

from master.with_units.prepare import prepare

if __name__ == "__main__":
    scenes = json.load(sys.stdin)
    json.dump([prepare(scene, None, "--python" in sys.argv)["fmus"] for scene in scenes], sys.stdout)
