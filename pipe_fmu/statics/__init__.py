"""Equilibrium of the pipe at rest, and its stability. Eq. (94)."""
