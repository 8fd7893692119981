"""The file of `kitecosim couple`, TOML or SSP: which FMUs, how connected, how solved together. Checked whole."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from interface import misnamed
from master.coupling.convergence import ConvergenceMonitor
from master.coupling.exchange import Connection, Exchange
from master.coupling.schemes import scheme
from master.fmu_coupling.entries import Table, nearest, toml_content
from master.fmu_coupling.links import converted, one_sided
from master.fmu_coupling.mapping import Described, Naming
from master.fmu_coupling.settings import Settings, settings_in
from master.fmu_coupling.ssp import Package, opened_package

WALL_TIMES = ("total", "set_up", "master")  # beside the names of the participants


@dataclass(frozen=True)
class Member:
    """A participant as the file describes it; `start` holds values of its blocks in their own unit."""

    fmu: Path
    memoryless: bool = False
    substeps: int = 1
    start: Mapping[str, Any] = field(default_factory=dict)
    names: Mapping[str, Naming] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Document:
    """A coupling of FMUs, complete and checked against their model descriptions; nothing has been run.

    `record` lists (participant, block) for the results. `described` is what each FMU says of itself.
    """

    file: str
    settings: Settings
    participants: Mapping[str, Member]
    connections: tuple[Connection, ...]
    record: tuple[tuple[str, str], ...]
    described: Mapping[str, Described]
    package: Package | None = None  # that the FMUs were unpacked from, which lives as long as the document
    remarks: tuple[str, ...] = ()

    @classmethod
    def read(cls, path: str | Path, settings: Mapping[str, Mapping[str, Any]] | None = None) -> "Document":
        """The document in a file, TOML or SSP, with keys of [time] and [coupling] in `settings` in place of its own.

        ValueError in one sentence that names file, key and remedy if something is wrong.
        """
        path = Path(path)
        if path.suffix.lower() == ".ssp":
            return cls._packed(path, settings or {})
        content = _settled(toml_content(path, "a coupling of FMUs"), settings or {})
        return cls.of(content, path.parent, str(path))

    @classmethod
    def _packed(cls, path: Path, settings: Mapping[str, Mapping[str, Any]]) -> "Document":
        package = opened_package(path, WALL_TIMES)
        content = _settled(package.content, settings)
        if content["time"].get("mode") == "steady":
            content["time"] = {key: value for key, value in content["time"].items() if key == "mode"} | dict(
                settings.get("time", {})
            )
        for key in ("step", "stop") if content["time"].get("mode") != "steady" else ():
            if key not in content["time"]:
                raise ValueError(f"{path}: says no {key} of the time; give --{key}.")
        try:
            document = cls.of(content, package.files.folder, str(path))
        except ValueError as error:
            raise package.refused(str(error).removeprefix(f"{path}: ")) from None
        return replace(document, package=package, remarks=(*package.remarks, *document.remarks))

    @classmethod
    def of(cls, content: Mapping[str, Any], folder: str | Path = ".", file: str = "coupling") -> "Document":
        """The document with a content as a TOML file gives it; paths of FMUs are relative to `folder`."""
        whole = Table(file, "", content)
        whole.require_only("time", "coupling", "participants", "connections", "results")
        settings = settings_in(whole)
        members, described = {}, {}
        listed = whole.table("participants")
        for name in listed.content:
            members[name], described[name] = _member(listed, name, Path(folder))
            same = [n for n, m in members.items() if n != name and m.fmu.resolve() == members[name].fmu.resolve()]
            if same and described[name].only_once:
                raise listed.table(name).refused(
                    "fmu",
                    f"is that of {same[0]} too, but its canBeInstantiatedOnlyOncePerProcess is true; use it for one.",
                )
        if len(members) < 2:
            raise whole.wrong(f"[participants] holds {len(members)} participants; give at least two.")
        connections = _connections(whole, described)
        record = _record(whole, connections, described)
        remarks = tuple(one_sided(connections, described))
        document = cls(file, settings, members, connections, record, described, remarks=remarks)
        try:
            exchange = document.exchange(described)
            sent_back = exchange.fields(settings.order)
            if settings.mode == "transient" and settings.scheme != "explicit" and sent_back:
                exchange.require_rollback()
            scheme(settings.scheme, exchange, settings.order, **settings.parameters)
            fields = list(exchange.fields(settings.order))
            if fields or settings.mode == "transient":
                exact = [c.field for c in connections if exchange.discrete(c)]
                ConvergenceMonitor(fields, settings.atol, settings.rtol, settings.residual_rtol, exact)
        except ValueError as error:
            raise ValueError(f"{file}: {error}") from None
        if settings.mode == "steady" and not fields:
            raise whole.wrong("nothing is sent back to an earlier participant, so there is no fixed point; add the "
                              "connection that closes the loop, or use mode = \"transient\".")  # fmt: skip
        return document

    def exchange(self, participants: Mapping[str, Any]) -> Exchange:
        """The exchange of participants under the names of the file."""
        s = self.settings
        return Exchange(
            participants,
            self.connections,
            dt=s.step,
            time=s.start,
            substeps={name: m.substeps for name, m in self.participants.items()},
            interpolation=s.interpolation,
            rollback=s.mode == "transient",
            memoryless=[name for name, m in self.participants.items() if m.memoryless],
            stop=self.stop_told,
        )

    @property
    def stop_told(self) -> float | None:
        """The stop time that participants are told, s: where their last step ends, computed as its beginning and its
        size are, so that none is asked to step beyond it. None in steady runs, which know none.
        """
        s = self.settings
        if s.mode != "transient":
            return None
        begin = s.start + (s.count - 1) * s.step
        ends = [
            begin + s.step * (m.substeps - 1) / m.substeps + s.step / m.substeps for m in self.participants.values()
        ]
        return max(*ends, s.start + s.count * s.step)

    def source(self, name: str) -> str:
        """Where the FMU of a participant is: its file, or that of the package and its place in it."""
        fmu = self.participants[name].fmu
        return str(fmu) if self.package is None else f"{self.file}/{fmu.relative_to(self.package.files.folder)}"

    def unconnected(self) -> list[str]:
        """Inputs without a source, which keep their start values; those made of connected variables are left out."""
        taken: dict[str, set[str]] = {}
        for name, member in self.participants.items():
            started = [b for b in member.start if b in self.described[name].blocks]
            taken[name] = {v for block in started for v in self.described[name].scalars(block)}
        for c in self.connections:
            taken[c.target].update(self.described[c.target].scalars(c.input))
        left: dict[str, None] = {}
        for name, described in self.described.items():
            for block, limits in described.limits.items():
                variables = described.scalars(block)
                if limits.causality == "input" and not taken[name].issuperset(variables):
                    whole = taken[name].isdisjoint(variables)
                    missing = [block] if whole else [v for v in variables if v not in taken[name]]
                    left |= dict.fromkeys(f"{name}.{one}" for one in missing)
        return list(left)


def _settled(content: Mapping[str, Any], settings: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """A content with some keys of its tables replaced."""
    changed = {
        name: {**content.get(name, {}), **keys}
        for name, keys in settings.items()
        if keys and isinstance(content.get(name, {}), Mapping)
    }
    return {**content, **changed}


def _member(listed: Table, name: str, folder: Path) -> tuple[Member, Described]:
    table = listed.table(name)
    table.require_only("fmu", "memoryless", "substeps", "start", "blocks")
    if not name or "." in name or '"' in name:
        raise table.wrong("has a name with a dot or nothing in it; choose one of letters, digits and _.")
    for called in (name, *table.table("blocks").content):
        if why := misnamed(called):
            raise table.wrong(f"has the name {called!r}, which {why}; choose another.")
    if name in WALL_TIMES:
        raise table.wrong("has a name that the wall times of the results use; choose another.")
    path, blocks, start = folder / table.text("fmu"), table.table("blocks"), table.table("start")
    if not path.is_file():
        raise table.refused("fmu", f"names {path}, which is no file; paths are relative to the folder of this file.")
    names = {block: _naming(blocks, block) for block in blocks.content}
    try:
        described = Described(path, names)
    except ValueError as error:
        where = blocks if str(error).startswith("block ") else table
        raise where.wrong(f"does not suit: {error}") from None
    for block, value in start.content.items():
        if isinstance(value, Mapping):
            raise start.refused(block, "is a table; write names that contain a dot in quotes.")
        try:
            if isinstance(value, str) and not described.items(block):
                described.require_text(block)
            else:
                described.raw(block, value)
        except ValueError as error:
            raise start.refused(block, f"does not suit: {error}") from None
    member = Member(path, table.boolean("memoryless", False), table.whole("substeps", 1), start.content, names)
    return member, described


def _naming(blocks: Table, name: str) -> Naming:
    value = blocks.content[name]
    if isinstance(value, str):
        return Naming(blocks.text(name))
    if isinstance(value, list):
        return Naming(tuple(_some(blocks, name)))
    if not isinstance(value, Mapping):
        raise blocks.refused(name, f"must be a variable, a pattern with #, a list or a table, not {value!r}.")
    table = blocks.table(name)
    table.require_only("variables", "factor", "shape")
    given = table.content.get("variables")
    variables = tuple(_some(table, "variables")) if isinstance(given, list) else table.text("variables")
    shape = table.content.get("shape")
    if shape is not None and not (
        isinstance(shape, list) and all(isinstance(n, int) and not isinstance(n, bool) and n > 0 for n in shape)
    ):
        raise table.refused("shape", f"must be a list of whole numbers above zero, not {shape!r}.")
    factor = table.factor() if "factor" in table.content else None
    return Naming(variables, factor, None if shape is None else tuple(shape))


def _some(table: Table, key: str) -> list[str]:
    names = table.texts(key)
    if not names:
        raise table.refused(key, "is empty; list at least one variable.")
    return names


def _end(table: Table, key: str, text: str, described: Mapping[str, Described], role: str = "") -> tuple[str, str]:
    """Participant and block of "participant.block", which there must be; `role` is the causality it must have."""
    name, dot, block = text.partition(".")
    if not dot or not block:
        raise table.refused(key, f"is '{text}'; write participant.block.")
    if name not in described:
        raise table.refused(key, f"names no participant '{name}'; {nearest(name, described, 'there are')}")
    its = described[name]
    if not its.knows(block):
        raise table.refused(key, f"is '{text}', but {its.unknown(block)}")
    causality = its.limits[block].causality
    if role and causality != role:
        like = [b for b, limits in its.limits.items() if limits.causality == role]
        raise table.refused(key, f"is '{text}', whose causality is {causality}; it takes an {role}: "
                                 f"{', '.join(like[:12]) or 'the FMU has none'}.")  # fmt: skip
    return name, block


def _connections(whole: Table, described: Mapping[str, Described]) -> tuple[Connection, ...]:
    found: list[Connection] = []
    taken: dict[tuple[str, str], str] = {}
    for table in whole.tables("connections"):
        table.require_only("from", "to", "factor", "offset", "map")
        source = _end(table, "from", table.text("from"), described, "output")
        target = _end(table, "to", table.text("to"), described, "input")
        c = Connection(*source, *target, table.factor(), table.number("offset", 0.0), _map(table))
        given = not table.content.keys().isdisjoint(("factor", "offset", "map"))
        sent, wanted = described[c.source].blocks[c.output], described[c.target].blocks[c.input]
        if sent != wanted:
            raise table.wrong(f"{c.field} has shape {list(sent)}, but {c.target}.{c.input} {list(wanted)}; "
                              "make blocks of one shape, see [participants.NAME.blocks].")  # fmt: skip
        try:
            c = converted(c, described[c.source], described[c.target], given)
        except ValueError as error:
            raise table.wrong(str(error)) from None
        for variable in described[c.target].scalars(c.input):
            if (c.target, variable) in taken:
                raise table.wrong(f"to: {variable} of {c.target} has a source already, {taken[c.target, variable]}; "
                                  "take one of the two away.")  # fmt: skip
            taken[c.target, variable] = str(c)
        found.append(c)
    if not found:
        raise whole.wrong("there are no connections; add [[connections]] with from and to.")
    for name in described:
        if all(name not in (c.source, c.target) for c in found):
            raise whole.wrong(f"[participants.{name}] is in no connection; connect it, or leave it out.")
    return tuple(found)


def _map(table: Table) -> tuple[tuple[float, float], ...]:
    """The pairs (sent, arriving) of a connection, none where it has no map."""
    pairs = table.content.get("map", [])
    if not isinstance(pairs, list) or not all(
        isinstance(pair, list) and len(pair) == 2 and all(isinstance(v, int | float) and math.isfinite(v) for v in pair)
        for pair in pairs
    ):
        raise table.refused("map", f"must be pairs of numbers, [sent, arriving], not {pairs!r}.")
    if pairs and ("factor" in table.content or "offset" in table.content):
        raise table.refused("map", "does not go with factor and offset; leave these out.")
    return tuple((float(sent), float(arriving)) for sent, arriving in pairs)


def _record(
    whole: Table, connections: tuple[Connection, ...], described: Mapping[str, Described]
) -> tuple[tuple[str, str], ...]:
    table = whole.table("results")
    table.require_only("record")
    if "record" not in table.content:
        return tuple(dict.fromkeys((c.source, c.output) for c in connections))
    ends = [_end(table, "record", text, described) for text in table.texts("record")]
    return tuple(dict.fromkeys(ends))
