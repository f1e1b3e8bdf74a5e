"""Arithmetic on several nodes or elements at once, and the arrays it takes; no mechanics."""
