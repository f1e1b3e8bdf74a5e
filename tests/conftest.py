"""Tests of what is there on Linux only are left out elsewhere: FMUs run by Python, a C host, shells, /proc, signals, other masters."""

import sys

ON_LINUX = (
    "bench", "cli_commands", "cli_fmus", "cli_malformed", "cli_surroundings", "coupling_foreseen", "coupling_ledger",
    "coupling_plain_units", "coupling_scene", "coupling_schemes", "fmi_cache", "fmi_calls", "fmi_fmu", "fmi_foreign_states", "fmi_hosts",
    "fmi_loader", "fmi_state", "fmi_without_jit", "native_face", "native_fmu", "native_units", "pipe_substeps", "stability_cases",
    "windows",
)  # fmt: skip
collect_ignore_glob = [] if sys.platform == "linux" else [f"*/test_{name}.py" for name in ON_LINUX]
