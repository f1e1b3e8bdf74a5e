"""Rotations and linear algebra; no pipe."""
