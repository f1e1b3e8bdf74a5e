"""FMUs in machine code: one C face for all units, the unit's kernels, and its data as tables."""
