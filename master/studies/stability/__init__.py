"""Cases that show what the coupling does: published co-simulation cases, stability limits, the pipe against bodies of any mass."""
