"""Starts the unit of an unpacked FMU, so that numba compiles and keeps its kernels: ``warm.py RESOURCES STEP`` (s)."""

import gc
import runpy
import select
import sys


def main(resources: str, step: float) -> None:
    """Through initialisation, one step, and a look at every output. Raises what goes wrong."""
    gc.disable()  # the compiler makes much, and little of it is ever free
    runtime = runpy.run_path(f"{resources}/runtime.py")
    if hasattr(select, "poll"):  # not on Windows
        runtime["end_with_reader"](sys.stdout.fileno())
    slave = runtime["load"](resources).__self__.slave_class(instance_name="warm", resources=resources, visible=False)
    slave.setup_experiment(0.0)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    slave.do_step(0.0, step)
    if compile_all := getattr(slave.unit, "compile", None):
        compile_all()
    slave.get_real([i for i, variable in enumerate(slave.variables()) if variable.causality == "output" and variable.kind == "Real"])


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]))
