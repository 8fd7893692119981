"""What a connection has to do for what arrives to mean what was sent: types that fit, units that are converted."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from master.coupling.exchange import Connection
from master.coupling.participants.blocks import Limits
from master.fmu_coupling.entries import one_valued
from master.fmu_coupling.mapping import Described
from master.fmu_coupling.units import Measured, conversion

KINDS = {"real": "Real", "integer": "Integer", "boolean": "Boolean", "enumeration": "Enumeration"}
# Whole numbers lose nothing on the way to a wider type.
WIDER = {"boolean": ("boolean", "integer", "real"), "integer": ("integer", "real"), "real": ("real",),
         "enumeration": ("enumeration", "integer", "real")}  # fmt: skip
SHOWN = 4  # connections that a remark names


def converted(c: Connection, source: Described, target: Described, given: bool) -> Connection:
    """A connection with the factor and offset that the declared units of its ends ask for, unless those are `given`.

    ValueError in one sentence where types or units do not go together.
    """
    ends = f"{c.source}.{c.output}", f"{c.target}.{c.input}"
    _require_types(c, ends, source.limits[c.output], target.limits[c.input])
    sent, wanted = source.measured(c.output), target.measured(c.input)
    if given or not sent or not wanted:
        return c
    count = max(len(sent), len(wanted))
    pairs = [(sent[k % len(sent)], wanted[k % len(wanted)]) for k in range(count)]
    found = [_converted(ends, *pair) for pair in pairs]
    if len(set(found)) == 1:
        factor, offset = found[0]
        return replace(c, factor=factor, offset=offset)
    shape = source.blocks[c.output]
    factors, offsets = (np.reshape(values, shape) for values in zip(*found, strict=True))
    return replace(c, factor=factors, offset=offsets)


def _converted(ends: tuple[str, str], sent: Measured | None, wanted: Measured | None) -> tuple[float, float]:
    try:
        return conversion(sent, wanted)
    except ValueError as error:
        a, b = (one.name if one is not None else "" for one in (sent, wanted))
        raise ValueError(
            f"{ends[0]} is in {a}, {ends[1]} in {b}, {error}; give factor (and offset), or connect what is alike."
        ) from None


def _require_types(c: Connection, ends: tuple[str, str], sent: Limits, wanted: Limits) -> None:
    """ValueError in one sentence where an input cannot take every value of an output."""
    if c.table:
        _require_table(c, ends, sent)
        value = wanted.foreign(np.array([arriving for _, arriving in c.table])) if wanted.kind != "real" else None
        if value is not None:
            raise ValueError(f"map has {value:g} for {ends[1]}, which takes {wanted.takes()}.")
        return
    if wanted.kind not in WIDER[sent.kind]:
        takes = f"; {ends[1]} takes {wanted.takes()}" if wanted.kind == "enumeration" else ""
        article = {"Integer": "an", "Enumeration": "an"}.get(KINDS[wanted.kind], "a")
        raise ValueError(
            f"{ends[0]} is {KINDS[sent.kind]}, but {ends[1]} {KINDS[wanted.kind]}{takes}; connect {article} "
            f"{KINDS[wanted.kind]} output."
        )
    if sent.kind == wanted.kind == "enumeration" and wanted.items:
        lacking = [name for name, value in sent.items.items() if value not in wanted.items.values()]
        if lacking:
            raise ValueError(
                f"{ends[0]} may be {', '.join(lacking)}, but {ends[1]} takes {wanted.takes()}; connect enumerations of "
                "the same items."
            )
    plain = c.factor == 1.0 and c.offset == 0.0
    if not plain and wanted.kind in ("boolean", "enumeration"):
        raise ValueError(f"{ends[1]} is {KINDS[wanted.kind]}, which takes neither factor nor offset; leave them out.")
    if wanted.kind == "integer" and not (float(c.factor).is_integer() and float(c.offset).is_integer()):
        raise ValueError(f"{ends[1]} is Integer and takes whole numbers; make factor and offset whole.")


def _require_table(c: Connection, ends: tuple[str, str], sent: Limits) -> None:
    """ValueError in one sentence where an output does not send what the map of its connection has."""
    if sent.kind == "real":
        raise ValueError(f"{ends[0]} is Real, and a map is of discrete values; use factor and offset.")
    try:
        table = one_valued(c.table)
    except ValueError as error:
        raise ValueError(f"map does not suit: {error}.") from None
    value = sent.foreign(np.array(list(table))) if sent.kind != "integer" else None
    if value is not None:
        raise ValueError(f"map has {value:g} for {ends[0]}, which sends {sent.takes()}.")


def one_sided(connections: Sequence[Connection], described: Mapping[str, Described]) -> list[str]:
    """A remark about connections with a declared unit at one end only, if there are such."""
    found = []
    for c in connections:
        sent, wanted = described[c.source].measured(c.output), described[c.target].measured(c.input)
        if sent and wanted and any(sent) != any(wanted) and np.all(c.factor == 1.0) and np.all(c.offset == 0.0):
            names = list(dict.fromkeys(unit.name for unit in (*sent, *wanted) if unit is not None))
            if names not in (["1"], ["-"], [""]):
                found.append(f"{c} ({', '.join(names)})")
    if not found:
        return []
    more = f" and {len(found) - SHOWN} more" if len(found) > SHOWN else ""
    return [f"one end declares a unit, the other none, and values are passed on as they are: "
            f"{', '.join(found[:SHOWN])}{more}."]  # fmt: skip
