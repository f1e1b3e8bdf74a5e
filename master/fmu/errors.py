"""How an FMU refuses."""

from __future__ import annotations

from ..errors import RunError


class FmuError(RunError):
    """What an FMU refused; the text is one line with the FMU's name and its own words."""


class StepRejected(FmuError):  # noqa: N818
    """The FMU discarded a step (fmi2Discard): try again from a saved state with a shorter one."""


class StepFailed(StepRejected):
    """A step after which the FMU stands in error (fmi2Error) or answers with NaN: one more try from a saved state makes sense."""


class FmuFailed(FmuError):  # noqa: N818
    """The FMU cannot go on (fmi2Fatal, or an error outside a step), or was asked for something it does not have."""


STEP_FAILURES = {2: StepRejected, 3: StepFailed}  # fmi2Discard, fmi2Error
