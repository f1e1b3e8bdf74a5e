"""A mass on a spring, and a spring with a mass behind it: the halves of linear oscillators, exact under held means."""
