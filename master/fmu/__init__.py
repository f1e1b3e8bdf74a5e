"""One FMU in this process: its file, its calls, its ports, its log."""
