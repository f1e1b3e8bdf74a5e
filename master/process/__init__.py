"""Processes of the program and what they leave: children, signals, crashes, locks, folders, screens."""
