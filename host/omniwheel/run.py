# SPDX-License-Identifier: MIT
"""A recorded run as one object, wherever it comes from: :class:`Run`, and :func:`load`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from omniwheel import files, mcap_file
from omniwheel.errors import LogError, MissingPackageError, OutputPathError
from omniwheel.limits import LOG_KINDS
from omniwheel.logs.log import WheelLog, load_log
from omniwheel.logs.run_folder import DRIVE_TLOG, SUMMARY_FILE, load_run
from omniwheel.npz_file import NotAnArchiveError, read_npz
from omniwheel.table_file import TableFormat, read_table
from omniwheel.telemetry_record import Array, TelemetryRecord, parameters_beside, record_of
from omniwheel.tlog_reader import ENDINGS as TELEMETRY_ENDINGS
from omniwheel.tlog_reader import TlogReader, iterate_messages

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

WHEELS = 4
_POSE = ("x_m", "y_m", "theta_rad")
_REFERENCE = ("x_reference_m", "y_reference_m", "theta_reference_rad")
_PER_WHEEL = ("wheel{}_rad_s", "wheel{}_reference_rad_s", "wheel{}_duty")
COLUMNS = ("time_s", *_POSE, *_REFERENCE, *(name.format(n + 1) for name in _PER_WHEEL for n in range(WHEELS)))
"""Columns of a run's table, in their order."""
_CSV = TableFormat(LogError, "a table as Run.save writes it; for another one give a mapping", COLUMNS)
ENDINGS = (".csv", ".npz", ".tlog", mcap_file.ENDING, ".png", ".svg", ".pdf")
_NO_RECORDS = "it was not recorded over a link: save it as .csv or .npz"


class Run:
    """What a robot did: ``robot.run`` is everything since the connection, :func:`load` reads a file.

    Times are the robot's clock [s]. Arrays have a row per message: ``pose`` and ``reference`` x [m], y [m], theta [rad,
    not wrapped] at ``time_s``, ``wheel_rad_s``, ``wheel_reference_rad_s`` and ``duty`` -1..1 per wheel at
    ``wheel_time_s``. ``truth`` (k, 3) are the true world poses of a simulated robot at ``truth_time_s``, on its
    clock too; None of a real one.
    """

    truth_time_s: Array | None = None
    truth: Array | None = None

    def __init__(
        self,
        record: TelemetryRecord | None = None,
        *,
        name: str = "",
        records: bytes = b"",
        parameters: Mapping[str, float] | None = None,
        robot_file: bytes = b"",
    ) -> None:
        self.name = name
        self.parameters = dict(parameters or {})
        """The robot's parameters, as far as they are known."""
        self.robot_file = robot_file
        """The text of the robot file; empty if it is not known."""
        self.records = records
        """The telemetry log, byte for byte; empty for a run that does not come from one."""
        self._record = record

    @classmethod
    def from_records(
        cls, records: bytes, name: str = "", *, parameters: Mapping[str, float] | None = None, robot_file: bytes = b""
    ) -> Run:
        """Return the run in the bytes of a telemetry log. They are decoded when they are needed."""
        return cls(name=name, records=records, parameters=parameters, robot_file=robot_file)

    @cached_property
    def record(self) -> TelemetryRecord:
        """All of it, with events and numbers. Raises LogError if the log holds neither poses nor wheels."""
        record = self._record
        if record is None:
            reader = TlogReader(Path(self.name or "the recording"), records=self.records)
            record = record_of(reader, self.parameters)
        if not len(record.time_s) and not len(record.wheel_time_s):
            raise LogError("the run holds no poses and no wheels", hint="it lasted too short, or the robot was silent")
        return record

    @property
    def time_s(self) -> Array:
        """Times of the poses (n,)."""
        return self.record.time_s

    @property
    def pose(self) -> Array:
        """Estimated world poses (n, 3)."""
        return self.record.pose

    @property
    def reference(self) -> Array:
        """Wanted world poses (n, 3)."""
        return self.record.reference

    @property
    def wheel_time_s(self) -> Array:
        """Times of the wheels' rows (m,)."""
        return self.record.wheel_time_s

    @property
    def wheel_rad_s(self) -> Array:
        """Wheel speeds (m, 4) [rad/s]."""
        return self.record.speed

    @property
    def wheel_reference_rad_s(self) -> Array:
        """Wanted wheel speeds (m, 4) [rad/s]."""
        return self.record.wanted

    @property
    def duty(self) -> Array:
        """Duties -1..1 (m, 4)."""
        return self.record.duty

    @property
    def events(self) -> tuple[tuple[float, str], ...]:
        """What happened, with its time [s]: changes of state and mode, the robot's texts."""
        return self.record.events

    @property
    def numbers(self) -> Mapping[str, float | None]:
        """How the drive was: duration, distance, RMS and largest errors, top speeds; None where it is not known."""
        return self.record.numbers()

    def plot(self, path: Path | str | None = None, title: str = "") -> Figure:
        """Draw path, errors, wheel speeds and duties; into a file (.png, .svg, .pdf), or on the screen.

        Returns the figure. Raises OutputFileError.
        """
        import matplotlib.pyplot as plt
        from matplotlib import rc_context

        from omniwheel.plot_style import STYLE
        from omniwheel.telemetry_picture import SIZE_IN, draw_into

        record = self.record
        with rc_context(STYLE):
            figure = plt.figure(figsize=SIZE_IN, layout="constrained")
            draw_into(figure, record, title or self.name)
            if path is not None:
                files.save_picture(figure, path)
        if path is not None:
            plt.close(figure)
        elif plt.get_backend().lower() != "agg":  # that one has no screen
            plt.show()
        return figure

    def to_numpy(self) -> NDArray[Any]:
        """Return a structured array with the fields :data:`COLUMNS`: ``run.to_numpy()["x_m"]``.

        A row per pose, with the latest wheel speeds; NaN before the first. Of a log without poses a row per wheels'
        row.
        """
        record = self.record
        times = record.time_s if len(record.time_s) else record.wheel_time_s
        table = np.full(len(times), np.nan, dtype=[(name, np.float64) for name in COLUMNS])
        table["time_s"] = times
        if len(record.time_s):
            for names, rows in ((_POSE, record.pose), (_REFERENCE, record.reference)):
                for axis, name in enumerate(names):
                    table[name] = rows[:, axis]
        latest = np.searchsorted(record.wheel_time_s, times, side="right") - 1
        known = latest >= 0
        for name, rows in zip(_PER_WHEEL, (record.speed, record.wanted, record.duty), strict=True):
            for wheel in range(rows.shape[1] if len(rows) else 0):
                table[name.format(wheel + 1)][known] = rows[latest[known], wheel]
        return table

    def to_pandas(self) -> DataFrame:
        """Return the table of :meth:`to_numpy` as a DataFrame. Raises MissingPackageError without pandas."""
        try:
            from pandas import DataFrame
        except ImportError as error:
            hint = "python -m pip install pandas; run.to_numpy() has the same table"
            raise MissingPackageError("pandas is not installed", hint=hint) from error
        return DataFrame(self.to_numpy())

    def save(self, path: Path | str) -> None:
        """Write a file, of the kind that its ending says: .csv and .npz are the table, .tlog is the telemetry log.

        .mcap is the telemetry log for Foxglove, with parameters and robot file (:mod:`omniwheel.mcap_file`). .png, .svg
        and .pdf are the picture. :func:`load` reads all but pictures. Raises OutputFileError, LogError,
        MissingPackageError.
        """
        path = Path(path)
        ending = path.suffix.lower()
        if ending == ".csv":
            rows = "\n".join(",".join(map(repr, row)) for row in self.to_numpy().tolist())
            files.write_text(path, f"{','.join(COLUMNS)}\n{rows}\n")
        elif ending == ".npz":
            with files.replaced(path) as file:
                np.savez_compressed(file, run=self.to_numpy())
        elif ending in TELEMETRY_ENDINGS and not self.records:
            raise LogError(f"{path}: the run has no telemetry log", hint=_NO_RECORDS)
        elif ending == ".tlog":
            files.write_bytes(path, self.records)
        elif ending == mcap_file.ENDING:
            with files.replaced(path) as file:
                messages = TlogReader(path, records=self.records)
                mcap_file.write_mcap(file, messages, self.parameters, self.robot_file)
        elif ending in ENDINGS:
            self.plot(path)
        else:
            raise OutputPathError(
                f"{path}: a run cannot be saved as {ending or 'a file without ending'!r}", hint=_KINDS
            )

    def __repr__(self) -> str:
        return f"<Run {self.name or 'recorded'}: {len(self.time_s)} poses, {len(self.wheel_time_s)} rows of wheels>"


_KINDS = f"endings are {', '.join(ENDINGS)}"


def load(path: Path | str, *, mapping: Path | str | None = None) -> Run:
    """Read a log of any kind: a telemetry log, a run's folder, what :meth:`Run.save` wrote, an imported log.

    ``mapping`` says which column of a CSV file, or topic of a ROS bag, is what (docs/guides/logs.md). Raises LogError,
    SchemaError, DatasetError.
    """
    path = Path(path)
    name = path.stem
    if not (path.is_file() or path.is_dir()):
        raise LogError(f"there is no log {path}", hint=f"a log is {LOG_KINDS}")
    if mapping is not None:
        from omniwheel.logs.importer import import_log
        from omniwheel.logs.mapping import read_mapping

        return Run(_record_of_wheels(import_log(path, read_mapping(Path(mapping)), None)[0]), name=name)
    if path.is_dir():
        return _loaded_folder(path)
    if path.suffix == ".csv":
        return Run(_record_of_columns(read_table(path, _CSV).columns), name=name)
    if path.suffix == ".npz":
        return Run(_loaded_archive(path), name=name)
    try:
        if path.suffix == mcap_file.ENDING:
            log = mcap_file.read_mcap(path)
        else:
            log = mcap_file.McapLog(path.read_bytes(), parameters_beside(path), b"")
    except OSError as error:
        raise LogError(f"{path}: {error.strerror}") from error
    record = record_of(iterate_messages(TlogReader(path, records=log.records)), log.parameters)
    return Run(record, name=name, records=log.records, parameters=log.parameters, robot_file=log.robot_file)


def _loaded_folder(folder: Path) -> Run:
    if (folder / SUMMARY_FILE).is_file():
        try:
            _, samples = load_run(folder)
            run = Run(_record_of_samples(samples), name=folder.name)
            run.truth_time_s, run.truth = run.time_s, np.asarray(samples["truth"], dtype=np.float64)
            return run
        except (OSError, ValueError, KeyError, IndexError) as error:
            raise LogError(f"{folder} is not a run: {error}") from error
    if not (folder / DRIVE_TLOG).is_file():
        raise LogError(f"{folder} is no folder of a run", hint=f"a log is {LOG_KINDS}")
    run = load(folder / DRIVE_TLOG)
    run.name = folder.name
    return run


def _loaded_archive(path: Path) -> TelemetryRecord:
    try:
        table = read_npz(path).get("run")
    except (OSError, NotAnArchiveError) as error:
        raise LogError(f"{path} cannot be read: {error}") from error
    if table is None:
        return _record_of_wheels(load_log(path))
    if table.dtype.names != COLUMNS:
        raise LogError(f"{path} is no saved run: its columns are {table.dtype.names}")
    return _record_of_columns({name: table[name] for name in COLUMNS})


def _record_of_columns(columns: Mapping[str, Array]) -> TelemetryRecord:
    def rows(names: tuple[str, ...]) -> Array:
        return np.column_stack([columns[name] for name in names])

    pose, reference = rows(_POSE), rows(_REFERENCE)
    speed, wanted, duty = (rows(tuple(name.format(n + 1) for n in range(WHEELS))) for name in _PER_WHEEL)
    placed = np.isfinite(pose).all(axis=1)
    turned = np.isfinite(speed[:, 0])
    time_s = columns["time_s"]
    return TelemetryRecord(
        time_s[placed],
        pose[placed],
        reference[placed],
        time_s[turned],
        speed[turned],
        wanted[turned],
        duty[turned],
        events=(),
        stops=(),
    )


def _record_of_samples(samples: NDArray[Any]) -> TelemetryRecord:
    """Return the record of a simulated run: the robot's estimate, true wheel speeds."""
    time_s = np.asarray(samples["time_s"], dtype=np.float64)
    pose, reference = np.array(samples["estimate"]), np.array(samples["reference"])
    for poses in (pose, reference):
        poses[:, 2] = np.unwrap(poses[:, 2])
    speed, wanted, duty = (np.array(samples[name]) for name in ("wheel_rad_s", "wheel_reference", "duty"))
    return TelemetryRecord(time_s, pose, reference, time_s, speed, wanted, duty, events=(), stops=())


def _record_of_wheels(log: WheelLog) -> TelemetryRecord:
    """Return the record of an imported log: its truth as poses, if it is on the robot's clock; nothing was wanted."""

    def four(rows: Array) -> Array:
        return np.pad(rows, ((0, 0), (0, WHEELS - log.wheels)))

    truth = log.truth if log.truth is not None and log.truth.same_clock else None
    time_s = np.empty(0) if truth is None else truth.time_s
    pose = np.empty((0, 3)) if truth is None else np.column_stack((truth.xy, truth.theta))
    speed = four(log.wheel_rad_s)
    wanted = np.full_like(speed, np.nan)
    return TelemetryRecord(
        time_s, pose, np.full_like(pose, np.nan), log.time_s, speed, wanted, four(log.duty), events=(), stops=()
    )
