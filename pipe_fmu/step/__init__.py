"""One discretely passive time step. Eqs. (25)-(27), (71)-(73)."""
