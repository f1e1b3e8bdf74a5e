"""The two kinds of failure that reach the user, each as one line."""


class UsageError(ValueError):
    """A mistake in the call or the scene, naming key, value and rule; exit code 2."""


class RunError(RuntimeError):
    """A computation that failed: no equilibrium, a step that does not converge, an FMU that refuses; exit code 1."""
