"""Start values of the components: the parameter sets of all levels, as the systems pass them on."""

from dataclasses import replace
from typing import Any

from master.fmu_coupling.ssp.fmus import number
from master.fmu_coupling.ssp.signals import Path, Port, Signals, Way
from master.fmu_coupling.ssp.structure import Parameter
from master.fmu_coupling.units import Measured


def start_values(signals: Signals) -> tuple[dict[Port, Any], list[str]]:
    """Start values by (component, variable), and the names of parameters that nothing takes.

    Sets of a higher level count before those of a lower one, later ones of a level before earlier ones.
    """
    found: dict[Port, Any] = {}
    left: list[str] = []
    for path, node in sorted(signals.nodes.items(), key=lambda item: -len(item[0])):
        for parameter in node.parameters:
            if not _Assignment(signals, parameter, found).to(path, parameter.name):
                left.append(".".join((*path, parameter.name)))
    return found, left


class _Assignment:
    """A parameter on its way to the variables that take it."""

    def __init__(self, signals: Signals, parameter: Parameter, found: dict[Port, Any]) -> None:
        how = parameter.transformation
        if how is not None and how.kind == "EnumerationMappingTransformation":  # by names, which a value is given by
            parameter = replace(
                parameter, value=dict(how.entries).get(parameter.value, parameter.value), transformation=None
            )
        self.signals, self.parameter, self.found = signals, parameter, found

    def to(self, path: Path, name: str) -> bool:
        """Assign it to what has a name in an element; whether there is anything."""
        signals, node = self.signals, self.signals.nodes[path]
        taken = False
        if not node.is_system:
            if signals.fmus[path].variable(name) is None:
                return False
            self._arrive((path, name), self._begun((path, name)))
            return True
        if name in node.connectors:
            self._pass_on((path, name), self._begun((path, name)))
            taken = True
        for child in node.elements:
            if name.startswith(f"{child}."):
                taken |= self.to((*path, child), name[len(child) + 1 :])
        return taken

    def _begun(self, port: Port) -> tuple[Way, Measured | None]:
        p = self.parameter
        return self.signals.passed(Way(), p.unit, port, p.suppressed, p.transformation, (None, port))

    def _pass_on(self, port: Port, begun: tuple[Way, Measured | None]) -> None:
        """Follow the connections inwards from a connector of a system."""
        for target, link in self.signals.onward.get(port, ()):
            behind = self.signals.passed(*begun, target, link.suppressed, link.transformation, (None, target))
            if target[0] in self.signals.fmus:
                self._arrive(target, behind)
            elif len(target[0]) > len(port[0]):
                self._pass_on(target, behind)

    def _arrive(self, port: Port, behind: tuple[Way, Measured | None]) -> None:
        p, files = self.parameter, self.signals.files
        what = f"parameter '{p.name}' for {self.signals.name(port)}"
        if p.type == "String":
            self.found[port] = p.value
            return
        if p.type not in ("Real", "Integer", "Boolean", "Enumeration"):
            raise files.refused(f"{what} is of the type {p.type}, which is not supported; take it out.")
        try:
            value = number(p.value, p.type, self.signals.fmus[port[0]].items(port[1]))
            self.found[port] = value if behind[0] == Way() else behind[0].arriving(value)
        except ValueError as error:
            raise files.refused(f"{what} does not suit: {error}.") from None
        except KeyError:
            raise files.refused(f"{what} is {p.value}, which its mapping does not have; add it.") from None
