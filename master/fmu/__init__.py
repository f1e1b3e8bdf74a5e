"""One FMU in this process: its calls and its ports."""
