"""What an FMU says of a step that it has not made: that it is still at it, how far it came, or that all is to end.

FMI 2.0, section 4.2.1: after fmi2Pending fmi2GetStatus tells when a step is done, after fmi2Discard fmi2Terminated and
fmi2LastSuccessfulTime tell why it is not.
"""

import time
from ctypes import byref, c_double, c_int
from typing import Any

from interface import SimulationEnded, StepDiscarded, StepFailed

DO_STEP, LAST_SUCCESSFUL_TIME, TERMINATED = 0, 2, 3  # fmi2StatusKind
OK, WARNING, DISCARD, ERROR, FATAL, PENDING = range(6)  # fmi2Status, and fmi3Status but for the last
STATUSES = ("fmi2OK", "fmi2Warning", "fmi2Discard", "fmi2Error", "fmi2Fatal", "fmi2Pending")
POLLS = 1e-4, 0.05  # s between two questions whether a step is done: at first, and at most


def finished(dll: Any, component: Any, status: int) -> int:
    """The status of a step once it is done: fmi2Pending is waited for. StepFailed where the FMU does not tell."""
    if status != PENDING:
        return status
    pause, most = POLLS
    found = c_int(PENDING)
    try:
        while found.value == PENDING:
            time.sleep(pause)
            pause = min(2.0 * pause, most)
            if _asked(dll, "fmi2GetStatus", component, DO_STEP, found) is None:
                raise StepFailed("it is still at the step (fmi2Pending), and does not tell by fmi2GetStatus when it is "
                                 "done; export it without canRunAsynchronuously")  # fmt: skip
    except BaseException:
        cancel = getattr(dll, "fmi2CancelStep", None)
        if cancel is not None:
            cancel(component)
        raise
    return found.value


def failure(
    dll: Any, component: Any, status: int, step: tuple[float, float], told: str, terminates: bool = True
) -> StepFailed:
    """What to raise for the `status` of a step (t, dt) s that was not made, `told` the reason that the FMU logged.

    `terminates` False: that the FMU says fmi2Terminated means nothing, as it does so of every step it did not make.
    """
    t, dt = step
    reason = f" ({told.rstrip('.')})" if told else ""
    if status != DISCARD:
        name = STATUSES[status] if 0 <= status < len(STATUSES) else f"status {status}, which FMI does not know,"
        return StepFailed(told or f"it returned {name} from fmi2DoStep and logged no reason")
    reached = _asked(dll, "fmi2GetRealStatus", component, LAST_SUCCESSFUL_TIME, c_double())
    within = reached is not None and t - 1e-9 * dt <= reached <= t + (1.0 + 1e-9) * dt
    if terminates and _asked(dll, "fmi2GetBooleanStatus", component, TERMINATED, c_int()):
        return SimulationEnded(f"asks to end the simulation at {reached if within else t:.9g} s{reason}")
    if reached is not None and within and reached - t > 1e-9 * dt:
        return StepDiscarded(
            f"it came to {reached:.9g} s only, not to {t + dt:.9g} s{reason}; take a step of {reached - t:.9g} s"
        )
    return StepDiscarded(told or f"it returned {STATUSES[DISCARD]} from fmi2DoStep at {t:.9g} s and logged no reason")


def _asked(dll: Any, name: str, component: Any, kind: int, answer: Any) -> Any:
    """What an FMU answers to a question about its step; None where it does not."""
    function = getattr(dll, name, None)
    status = ERROR if function is None else function(component, kind, byref(answer))
    return answer.value if status <= WARNING else None
