# SPDX-License-Identifier: MIT
"""The robot's parameters as a mapping from name to value, over MAVLink's parameter protocol.

Values are in the unit that params.toml gives. Real ones are floats; the robot keeps a float32, so reading back may
differ in the eighth digit. Whole numbers are ints. Enums are members of an :class:`enum.IntEnum`
(:mod:`omniwheel.parameter_types`) and are set by member, name or number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, MutableMapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any

from omni_schema import Parameter, ParameterTable, SchemaError, as_float32
from omni_schema.errors import did_you_mean
from omniwheel import parameter_file
from omniwheel.connection import Connection
from omniwheel.dialect import Message, mavlink
from omniwheel.errors import (
    LinkLostError,
    LinkTimeoutError,
    OmniError,
    ParameterError,
    ParameterRangeError,
    ParameterRefusedError,
    UnknownParameterError,
)
from omniwheel.monitored import monitored
from omniwheel.other_hardware import WHEELS, require_same_hardware
from omniwheel.parameter_file import format_value
from omniwheel.parameter_types import ParameterEnum, enum_of, typed
from omniwheel.texts import TextLog

REPLY_TIMEOUT_S = 1.2
TRIES = 10
"""On a radio that loses a fifth of the packets, half of the exchanges fail: a frame may lie across two."""
SET_TRIES = 3
SINGLE_TRIES = 2
"""From then on a request is sent twice."""
QUIET_S = 0.7
WINDOW = 12
FEW = 4
MOST_SINGLE = 40
"""Reading one value takes a round trip; a list of all is one request."""
NOT_AN_INDEX = -1
SYSTEM = "SYS_ID"
"""The robot answers with its new number as soon as it has one."""
OTHERS_HEARD_S = 2.2
"""Another robot on the line has sent two heartbeats by then."""

Progress = Callable[[int, int], None]
ParameterValue = float | str | bool


def unknown_parameter(name: str, known: Mapping[str, object]) -> UnknownParameterError:
    """Return the error for a name that is not in ``known``, with the closest one that is."""
    message = f"there is no parameter {name}{did_you_mean(name, known)}"
    return UnknownParameterError(message, hint="`omni params list` shows all")


def checked_value(table: ParameterTable, name: str, value: ParameterValue) -> float:
    """Turn a number or the name of an enum's value into the float32 that is sent, or say why it is not allowed."""
    if name not in table:
        raise unknown_parameter(name, table)
    try:
        return table[name].parse("", name, value)
    except SchemaError as error:
        problem = error.problem
        if "allowed" not in problem:
            problem = f"{problem.partition(';')[0]}; allowed is {table[name].allowed}"
        raise ParameterRangeError(f"{name} {problem}", hint=table[name].doc) from error


def without_system(values: Mapping[str, float]) -> dict[str, float]:
    """Return the values of a parameter file that are loaded: all but the system id, which is of one robot only."""
    return {name: value for name, value in values.items() if name != SYSTEM}


class _Values:
    """Values by name, and the robot's list of names as far as it has come."""

    def __init__(self, table: ParameterTable) -> None:
        self._table = table
        self.by_name: dict[str, float] = {}
        self.names: dict[int, str] = {}
        self.count = 0

    @property
    def complete(self) -> bool:
        return 0 < self.count == len(self.names)

    def take(self, message: Message) -> None:
        name = _name_of(message)
        self.by_name[name] = typed(self._table.get(name), float(message.param_value))
        if message.param_index < message.param_count:
            self.count = message.param_count
            self.names[message.param_index] = name


class _Work:
    """How far the setting of several parameters has come; ``verb`` says what it is."""

    def __init__(self, verb: str = "set") -> None:
        self.confirmed: list[str] = []
        self.asked = ""
        """What was sent and has no answer yet."""
        self._verb = verb

    def interrupted(self, error: LinkLostError | LinkTimeoutError, names: Iterable[str]) -> OmniError:
        """Return a lost link's error that says what was set, and what the robot may have."""
        left = [name for name in names if name not in (*self.confirmed, self.asked)]
        parts = [
            f"{self._verb} before: {', '.join(self.confirmed) or 'none'}",
            f"not known: {self.asked}",
            *([f"not {self._verb}: {', '.join(left)}"] if left else []),
        ]
        hint = f"once the link is back, look with: omni params list {' '.join(names)}"
        return type(error)(f"{error} ({'; '.join(parts)})", hint=hint)


@monitored("_connection")
class Parameters(MutableMapping[str, float]):
    """The parameters of a connected robot.

    Reading uses a cache, which every PARAM_VALUE of the robot refreshes; names not seen yet are asked for. Setting
    checks the range here first, sends, and returns when the robot has confirmed the very value. Iterating downloads
    all first.
    """

    def __init__(self, connection: Connection, table: ParameterTable, texts: TextLog) -> None:
        self.table = table
        self._connection = connection
        self._texts = texts
        self._cache = _Values(self.table)
        self._incoming: _Values | None = None
        """What a download under way has brought. The cache stays whole meanwhile: other threads read it."""
        self.on_change: Callable[[Mapping[str, tuple[float, float]]], None] | None = None
        """Called with {name: (before, after)} when the robot has confirmed what was set here."""
        connection.add_listener(self._take)

    # ---- the mapping

    def __getitem__(self, name: str) -> float:
        if name not in self._cache.by_name:
            if name not in self.table and not self.complete:
                self.download()
            self._require_known(name)
            return self.read(name)
        return self._cache.by_name[name]

    def __setitem__(self, name: str, value: ParameterValue) -> None:
        self._hear_others([name])
        self._set(name, self.check(name, value))

    def __delitem__(self, name: str) -> None:
        raise TypeError(
            f"a robot's parameter cannot be deleted: {name}; reset_parameters() restores the robot file's values"
        )

    def __iter__(self) -> Iterator[str]:
        self._complete()
        names = self._cache.names
        return iter([names[index] for index in sorted(names)])

    def __len__(self) -> int:
        self._complete()
        return self._cache.count

    def __contains__(self, name: object) -> bool:
        return name in self._cache.by_name or name in self.table

    @property
    def known(self) -> Mapping[str, float]:
        """The values that have come so far, without asking for more."""
        return dict(self._cache.by_name)

    @property
    def complete(self) -> bool:
        """Whether every parameter of the robot is in the cache."""
        return self._cache.complete

    def info(self, name: str) -> Parameter | None:
        """Return what is known of a parameter: ``unit``, ``minimum``, ``maximum``, ``default``, ``values``, ``doc``.

        None if only the robot knows it. Raises UnknownParameterError for one that nobody knows.
        """
        self._require_known(name)
        return self.table.get(name)

    def enum(self, name: str) -> type[ParameterEnum]:
        """Return the enumeration of an enum parameter: ``list(robot.parameters.enum("CTL_MODE"))``.

        Raises UnknownParameterError; ValueError for a parameter of another kind.
        """
        if name not in self.table:
            raise unknown_parameter(name, self.table)
        return enum_of(self.table[name])

    @contextmanager
    def changed(self, **values: ParameterValue) -> Iterator[None]:
        """Set several parameters while the ``with`` block lasts, as :meth:`set_many`; then set the old values back.

        A parameter that is locked while the robot is armed is not set back if the robot is still armed at the end of
        the block: ParameterError then says which ones stay changed, and how to set them back. The others are set back.
        """
        before = self._read_all(values)
        try:
            self.set_many(values)
            yield
        finally:
            with self._connection.monitor:
                now = self._read_all(before)
                self._set_back({name: value for name, value in before.items() if now[name] != value})

    def forget(self) -> None:
        """Empty the cache, for instance after the robot restarted."""
        self._cache = _Values(self.table)

    # ---- reading

    def read(self, name: str) -> float:
        """Ask the robot for one value now. Raises LinkTimeoutError."""
        request = self._request(name.encode(), NOT_AN_INDEX)
        self._ask(request, name)
        return self._cache.by_name[name]

    def download(self, progress: Progress | None = None) -> dict[str, float]:
        """Fetch all parameters afresh; lost ones are asked for again.

        ``progress`` is called with (received, total). Raises LinkTimeoutError if the robot stops answering.
        """
        while self._incoming is not None:  # another thread is at it
            self._connection.wait(_is_parameter, QUIET_S)
        self._incoming = incoming = _Values(self.table)
        try:
            self._download_into(incoming, progress)
        finally:
            self._incoming = None
        self._cache = incoming
        return dict(incoming.by_name)

    def _download_into(self, incoming: _Values, progress: Progress | None) -> None:
        self._connection.send(mavlink.MAVLink_param_request_list_message(*self._target()))
        silent = 0
        while not incoming.complete:
            if self._listen(incoming, progress):
                silent = 0
                continue
            silent += 1
            if silent >= TRIES:
                raise _download_error(incoming)
            self._ask_for_missing(incoming, silent)

    def _listen(self, incoming: _Values, progress: Progress | None) -> bool:
        """Take PARAM_VALUEs until all are there or none comes for a while; return whether there were new ones."""
        before = len(incoming.names)
        quiet = QUIET_S if before else REPLY_TIMEOUT_S
        while not incoming.complete and self._connection.wait(_is_parameter, quiet) is not None:
            if progress is not None:
                progress(len(incoming.names), incoming.count)
        return len(incoming.names) > before

    def _ask_for_missing(self, incoming: _Values, times: int) -> None:
        """Ask for some of what is missing, each ``times`` over: a last one or two must not fail on a bad link."""
        if not incoming.count:
            for _ in range(_copies(times)):
                self._connection.send(mavlink.MAVLink_param_request_list_message(*self._target()))
            return
        missing = [index for index in range(incoming.count) if index not in incoming.names]
        if len(missing) <= FEW:
            times = max(times, 2)
        for index in missing[: max(WINDOW // times, 1)] * times:
            self._connection.send(self._request(b"", index))

    # ---- writing

    def check(self, name: str, value: ParameterValue) -> float:
        """Return ``value`` as it would be sent; raise UnknownParameterError or ParameterRangeError."""
        if name not in self.table:
            self._require_known(name)
            try:
                return as_float32(float(value))
            except (OverflowError, ValueError) as error:
                raise ParameterRangeError(f"{name}: a number that fits a float32 is needed") from error
        checked = checked_value(self.table, name, value)
        if name == SYSTEM and checked in self._connection.other_systems:
            raise ParameterRangeError(f"{name} {checked:g}: another robot on this line has it", hint="choose another")
        return checked

    def set_many(self, values: Mapping[str, ParameterValue]) -> None:
        """Set several parameters, all or none.

        All are checked before any is sent, and the robot's present values are read: another program may have changed
        them, or a restart. Some combinations are only valid together, so a refused value is tried again
        after the others. If one stays refused, those already set get their old values back and ParameterRefusedError is
        raised; the same on Ctrl-C. On a lost link nothing can be set back: LinkLostError or LinkTimeoutError then says
        which values the robot has confirmed, and which one it may have.
        """
        self._hear_others(values)
        wanted = {name: self.check(name, value) for name, value in values.items()}
        old = self._read_all(wanted)
        todo = {name: value for name, value in wanted.items() if value != old[name]}
        work = _Work()
        try:
            self._set_in_any_order(todo, work)
        except (ParameterError, KeyboardInterrupt):
            undone = [name for name in todo if name == work.asked or self._cache.by_name.get(name) != old[name]]
            self._set_back({name: old[name] for name in undone})
            raise

    def _read_all(self, names: Iterable[str]) -> dict[str, float]:
        """Ask the robot for some values now; for many, it is quicker to download all."""
        wanted = list(names)
        if len(wanted) > MOST_SINGLE:
            values = self.download()
            return {name: values[name] if name in values else self.read(name) for name in wanted}
        return {name: self.read(name) for name in wanted}

    def _hear_others(self, names: Iterable[str]) -> None:
        """Listen for other robots on the line before this one gets another system id: it must not be one of theirs."""
        if SYSTEM in names:
            self._connection.pump(OTHERS_HEARD_S)

    def _set_in_any_order(self, todo: dict[str, float], work: _Work) -> None:
        try:
            self._set_until_refused(todo, work)
        except (LinkLostError, LinkTimeoutError) as error:
            raise work.interrupted(error, todo) from error

    def _set_until_refused(self, todo: dict[str, float], work: _Work) -> None:
        while todo:
            refused: dict[str, float] = {}
            problem: ParameterRefusedError | None = None
            for name, value in todo.items():
                work.asked = name
                try:
                    self._set(name, value)
                    work.confirmed.append(name)
                except ParameterRefusedError as error:
                    refused[name] = value
                    problem = problem or error
                work.asked = ""
            if problem is not None and len(refused) == len(todo):
                raise problem
            todo = refused

    def _set_back(self, old: dict[str, float]) -> None:
        """Set old values back, as many as the robot takes. Raises ParameterError that names those that stay changed."""
        work = _Work("set back")
        try:
            self._set_in_any_order(dict(old), work)
        except ParameterRefusedError as error:
            left = {name: value for name, value in old.items() if name not in work.confirmed}
            stays = ", ".join(f"{name} = {self[name]}" for name in left)
            values = ", ".join(f"{name}={format_value(None, value)}" for name, value in left.items())
            raise ParameterError(
                f"not set back, so the robot keeps {stays}: {'; '.join(error.reasons) or error}",
                hint=f"first do what the robot asks for, then: robot.parameters.set_many(dict({values}))",
            ) from error

    def _set(self, name: str, value: float) -> None:
        before = value if self.on_change is None else self[name]
        self._set_on_robot(name, value)
        if before != value:
            self.report_changes({name: (before, value)})

    def report_changes(self, changes: Mapping[str, tuple[float, float]]) -> None:
        """Tell :attr:`on_change` of changes {name: (before, after)} that did not come about by setting one here."""
        if self.on_change is not None:
            self.on_change(changes)

    def _set_on_robot(self, name: str, value: float) -> None:
        with self._connection.following(int(value)) if name == SYSTEM else nullcontext():
            self._set_and_confirm(name, value)

    def _set_and_confirm(self, name: str, value: float) -> None:
        mark = self._texts.mark()
        message = mavlink.MAVLink_param_set_message(
            *self._target(), name.encode(), value, mavlink.MAV_PARAM_TYPE_REAL32
        )
        for _ in range(SET_TRIES):
            self._ask(message, name)
            if self._cache.by_name[name] == value:
                return
            reasons = self._texts.reasons_since(mark)
            if reasons or self._confirmed_late(name, value):
                break
        if self._cache.by_name[name] != value:
            raise ParameterRefusedError(name, value, self._cache.by_name[name], reasons)

    def _confirmed_late(self, name: str, value: float) -> bool:
        """Whether the value comes yet: without a reason, the other one may be the late answer to an earlier request."""
        answer = self._connection.wait(
            lambda m: _is_parameter(m) and _name_of(m) == name and m.param_value == value, REPLY_TIMEOUT_S
        )
        return answer is not None

    # ---- files

    def save(self, path: Path | str) -> None:
        """Write all parameters to a TOML file that :meth:`load` reads."""
        parameter_file.write(path, dict(self.items()), self.table)

    def load(self, path: Path | str, *, force: bool = False) -> dict[str, tuple[float, float]]:
        """Set every parameter of a file, all or none; return those that changed as {name: (before, after)}.

        Raises OtherRobotError if wheels, geometry or wiring differ, unless ``force`` is given; nothing was set then.
        The robot keeps its ``SYS_ID``: with that of another robot's file the two would be one on a shared line. To take
        it over set it: ``robot.parameters["SYS_ID"] = 2``.
        """
        wanted = without_system(parameter_file.read(path, self.table))
        changes = self.diff(wanted)
        if not force:
            require_same_hardware(changes, self[WHEELS], self.table)
        self.set_many({name: after for name, (_, after) in changes.items()})
        return changes

    def diff(self, other: Mapping[str, ParameterValue]) -> dict[str, tuple[float, float]]:
        """Return {name: (robot's value, other's value)} for the parameters of ``other`` that differ."""
        self._complete()
        wanted = {name: self.check(name, value) for name, value in other.items()}
        return {name: (self[name], value) for name, value in wanted.items() if self[name] != value}

    # ---- the wire

    def _take(self, message: Message) -> None:
        if not _is_parameter(message):
            return
        self._cache.take(message)
        if self._incoming is not None:
            self._incoming.take(message)

    def _ask(self, message: Any, name: str) -> None:
        for number in range(TRIES):
            message.target_system, message.target_component = self._target()
            for _ in range(_copies(number)):
                self._connection.send(message)
            answer = self._connection.wait(lambda m: _is_parameter(m) and _name_of(m) == name, REPLY_TIMEOUT_S)
            if answer is not None:
                return
        raise LinkTimeoutError(f"the robot does not answer about {name}", hint="does its firmware know this parameter?")

    def _request(self, name: bytes, index: int) -> Message:
        request: Message = mavlink.MAVLink_param_request_read_message(*self._target(), name, index)
        return request

    def _target(self) -> tuple[int, int]:
        return self._connection.target_system, self._connection.target_component

    def _complete(self) -> None:
        if not self.complete:
            self.download()

    def _require_known(self, name: str) -> None:
        if name not in self.table and name not in self._cache.by_name:
            raise unknown_parameter(name, {**self.table, **self._cache.by_name})


def _download_error(incoming: _Values) -> LinkTimeoutError:
    if not incoming.count:
        return LinkTimeoutError("the robot does not answer the request for its parameters")
    return LinkTimeoutError(
        f"the robot stopped answering after {len(incoming.names)} of {incoming.count} parameters",
        hint="a slow radio? lower the telemetry rates (SRn_STATE, SRn_WHEELS) of that link",
    )


def _copies(retries: int) -> int:
    return 1 if retries < SINGLE_TRIES else 2


def _is_parameter(message: Message) -> bool:
    return message.get_type() == "PARAM_VALUE"


def _name_of(message: Message) -> str:
    return str(message.param_id).rstrip("\0")
