"""Master: scenes, FMU export, energy-consistent co-simulation, reports."""
