"""The tables [time] and [coupling] of a coupling file: how participants are solved together."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, get_args

from master.coupling.convergence import Tolerance
from master.coupling.exchange import ORDERS, Interpolation, Order
from master.coupling.march import MOST_STEPS, PREDICTORS
from master.coupling.schemes import SCHEMES, scheme
from master.fmu_coupling.entries import Table

MODES = ("transient", "steady")
TRANSIENT_ONLY = {"time": ("stop",), "coupling": ("predictor", "strict", "interpolation")}


@dataclass(frozen=True)
class Settings:
    """How the participants are solved together: see `march` and `fixed_point`. Times in s."""

    mode: str = "transient"
    start: float = 0.0
    stop: float = 1.0
    step: float = 1.0
    scheme: str = "iqn-ils"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    order: Order = "serial"
    predictor: str = "linear"
    interpolation: Interpolation = "linear"
    rtol: Tolerance = 1e-6
    atol: Tolerance = 0.0
    residual_rtol: Tolerance = 0.0
    max_iterations: int = 100
    recoveries: int = 3
    strict: bool = True

    @property
    def count(self) -> int:
        """Communication steps from start to stop."""
        return round((self.stop - self.start) / self.step)


def settings_in(whole: Table) -> Settings:
    """The settings in the tables [time] and [coupling] of a file."""
    time, coupling = whole.table("time"), whole.table("coupling")
    time.require_only("mode", "start", "stop", "step")
    coupling.require_only(
        *("scheme", "parameters", "order", "predictor", "interpolation", "rtol", "atol", "residual_rtol"),
        *("max_iterations", "recoveries", "strict"),
    )
    mode = time.text("mode", "transient", MODES)
    if mode == "steady":
        for table in (time, coupling):
            for key in TRANSIENT_ONLY[table.name[1:-1]]:
                if key in table.content:
                    raise table.refused(
                        key, 'does not go with mode = "steady", which does not advance in time; leave it out.'
                    )
    start = time.number("start", 0.0)
    step = time.number("step", 1.0 if mode == "steady" else None, positive=True)
    stop = start if mode == "steady" else time.number("stop")
    if not (stop - start) / step < MOST_STEPS:
        raise time.wrong(f"asks for more than {MOST_STEPS:g} steps; make step larger than {step:g}.")
    count = round((stop - start) / step)
    if mode == "transient" and (count < 1 or abs(start + count * step - stop) > 1e-6 * step):
        raise time.wrong(
            f"from start = {start:g} to stop = {stop:g} is no whole number of steps of {step:g}; change one."
        )
    if coupling.content.get("scheme") in [name for name, kind in SCHEMES.items() if kind.exact]:
        raise coupling.refused("scheme", "takes directional derivatives, which FMUs do not give here; leave it out.")
    name = coupling.text("scheme", "iqn-ils", [name for name, kind in SCHEMES.items() if not kind.exact])
    parameters = coupling.table("parameters")
    try:
        scheme(name, **parameters.content)
    except (ValueError, TypeError) as error:
        raise parameters.wrong(f"does not suit: {error}") from None
    return Settings(
        mode=mode,
        start=start,
        stop=stop,
        step=step,
        scheme=name,
        parameters=parameters.content,
        order="parallel" if coupling.text("order", "serial", ORDERS) == "parallel" else "serial",
        predictor=coupling.text("predictor", "linear", PREDICTORS),
        interpolation="constant"
        if coupling.text("interpolation", "linear", get_args(Interpolation)) == "constant"
        else "linear",
        rtol=_tolerance(coupling, "rtol", 1e-6),
        atol=_tolerance(coupling, "atol", 0.0),
        residual_rtol=_tolerance(coupling, "residual_rtol", 0.0),
        max_iterations=coupling.whole("max_iterations", 100),
        recoveries=coupling.whole("recoveries", 3, least=0),
        strict=coupling.boolean("strict", True),
    )


def _tolerance(coupling: Table, key: str, default: float) -> Tolerance:
    """A number, or a table with a number for every field."""
    value = coupling.content.get(key, default)
    if isinstance(value, Mapping):
        table = coupling.table(key)
        return {field: table.number(field) for field in value}
    return coupling.number(key, default)
