"""How every solver, participant and coupled step says that it could not go on."""


class StepFailed(ArithmeticError):
    """A step could not be made; the message is one sentence that says why.

    A solver core raises it, a participant passes it on, and an exchange adds whose step it was. The state may be
    restored and the step tried again. It is an ArithmeticError, which a fixed point takes for a map without a value.
    """


class StepDiscarded(StepFailed):
    """An FMU refused a step as it was asked for; the same step with the same inputs is not worth a second try."""


class SimulationEnded(StepFailed):
    """A participant asks to end the simulation; no step of it follows."""
