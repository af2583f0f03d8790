# SPDX-License-Identifier: MIT
"""The steps of autotune on a connected robot: drive, measure, design, try in turns, keep or go back."""

from __future__ import annotations

import math
from collections import ChainMap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from omniwheel.autotune.choice import Choice, choose
from omniwheel.autotune.comparison import Compared, Comparison
from omniwheel.autotune.design import CHANGED, Design, design_from, gentle_values, measure
from omniwheel.autotune.gains import Requirements
from omniwheel.autotune.motor_values import PARAMETERS as MOTOR_PARAMETERS
from omniwheel.autotune.motor_values import Measured
from omniwheel.autotune.prefer import Prefer
from omniwheel.autotune.room import MOST_LEGS, SETTINGS, Drive, drive, leg_time, points, reach_of
from omniwheel.autotune.sweep import NOT_SWEPT, Swept, sweep
from omniwheel.capability.drive_model import DriveModel, model_from_parameters
from omniwheel.capability.speeds import TURNING, directions, limit_speed, motor_speed, top_acceleration
from omniwheel.datasheet.new_robot import ACCELERATION_SHARE
from omniwheel.errors import AutotuneError, IdentificationError
from omniwheel.frames import Pose
from omniwheel.identification.model import Layout
from omniwheel.identification.output_error import Fit
from omniwheel.presets import read_preset
from omniwheel.robot import Robot
from omniwheel.robots import parameter_table
from omniwheel.telemetry import Tracking
from omniwheel.trial import Trial
from omniwheel.tuning import Trace
from omniwheel.tuning_verdict import Verdict
from omniwheel.wheel_loop import ANGLE_FILTER
from omniwheel.wheel_loop import PARAMETERS as LOOP_PARAMETERS

GENTLE, BRISK, QUICK = 0.25, 0.42, 0.7
"""Shares of the robot's speed and acceleration limits, one after the other; BRISK only if GENTLE shows too little."""
MARGIN_M = 0.03
"""What a wheel is wide and a tracking error long: added to the robot's size."""
MOST_DRIVES = 6
"""Of those that measure: while they do not show enough, another one through other points is added."""
REFUSED_SHARE = 0.01
"""Of the pose fixes: if the robot refuses more of them, its wheels and its fixes contradict each other."""
FILTER = "fixed_noise"
"""Levels of the pose filter while it drives. Ones that follow the fixes would hide a contradiction with the wheels."""
_READ = tuple(dict.fromkeys((*MOTOR_PARAMETERS, *LOOP_PARAMETERS, *CHANGED, "INERTIA", "ISMC_K_XY", "ISMC_K_TH")))
_LIMITS = ("LIM_V", "LIM_W", "LIM_A", "LIM_DUTY", "WHEEL_DIST", "BAT_V_NOM")
ISMC = 1
REACH_S, TURN_RAD = 0.6, 1.2
"""A slow robot's points are within so many seconds at its top speed, so that its legs end; headings within this."""
DIRECTIONS = 24
"""Directions in which the robot's slowest one is looked for."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Settings:
    """What a user chooses: side of the square [m], legs of each drive, rounds of the comparison, seed, margins.

    ``prefer``: what decides between values that drive better and values that have the margins.
    """

    room_m: float = 1.0
    legs: int = 10
    rounds: int = 4
    seed: int = 1
    prefer: Prefer = Prefer.TRACKING
    required: Requirements = field(default_factory=Requirements)

    def __post_init__(self) -> None:
        """Refuse what the robot cannot take."""
        if not 4 <= self.legs <= MOST_LEGS:
            raise AutotuneError(f"{self.legs} legs; must be 4 to {MOST_LEGS}")


@dataclass(frozen=True)
class Outcome:
    """``old`` and ``new`` parameters, the design, what the comparison showed, and what was chosen and why.

    ``in_steps``: the old or new values hardly damp the robot, so that the comparison came to its pace in steps.
    ``swept``: the margins that a sweep with the new values showed.
    """

    old: dict[str, float]
    design: Design
    compared: Compared
    choice: Choice
    in_steps: bool = False
    swept: Swept = NOT_SWEPT

    @property
    def verdicts(self) -> list[Verdict]:
        """What the figures say at the quickest pace that was driven."""
        return self.compared.verdicts

    @property
    def traces(self) -> dict[str, list[Trace]]:
        """The paths that the verdicts rest on."""
        return self.compared.traces

    @property
    def kept(self) -> bool:
        """Whether the robot has the new parameters."""
        return self.choice.kept

    @property
    def new(self) -> dict[str, float]:
        """The parameters that were tried."""
        return self.design.values


def autotune(robot: Robot, settings: Settings, keep: bool, tell: Callable[[str], None]) -> Outcome:
    """Tune a robot that stands in the middle of its room. It moves; at the end it is disarmed, where it began.

    Unless the comparison ends well and ``keep``, and whatever else happens, it has its old parameters again: if the
    link is lost, too (:class:`omniwheel.trial.Trial`). Raises AutotuneError, IdentificationError or ExperimentError.
    """
    with Trial(robot) as trial:
        return _on_trial(robot, trial, settings, keep, tell)


def _on_trial(robot: Robot, trial: Trial, settings: Settings, keep: bool, tell: Callable[[str], None]) -> Outcome:
    old = {name: robot.parameters[name] for name in dict.fromkeys((*_READ, *_LIMITS, "CTL_MODE", "KF_MODE"))}
    if round(old["CTL_MODE"]) != ISMC:
        raise AutotuneError("autotune needs CTL_MODE = ismc", hint="omni params set CTL_MODE=ismc")
    if round(old["KF_MODE"]) != ANGLE_FILTER:
        raise AutotuneError("autotune needs KF_MODE = angle", hint="omni params set KF_MODE=angle")
    if old["ISMC_K_XY"] <= 0.0 or old["ISMC_K_TH"] <= 0.0:
        raise AutotuneError(
            "autotune needs ISMC_K_XY and ISMC_K_TH above 0", hint="omni params reset restores the defaults"
        )
    filter_levels = read_preset(FILTER, parameter_table()).parameters
    before = {name: robot.parameters[name] for name in (*SETTINGS, *filter_levels)}
    kept = False
    try:
        trial.set_many(filter_levels)
        outcome = _tune(robot, trial, settings, old, tell)
        if not keep and outcome.kept:
            outcome = replace(outcome, choice=Choice(False, f"as requested, although {outcome.choice.why}"))
        kept = outcome.kept
    finally:
        back = {name: old[name] for name in CHANGED}
        trial.set_many({**before, **({} if kept else back)})
    return outcome


def _tune(
    robot: Robot, trial: Trial, settings: Settings, old: Mapping[str, float], tell: Callable[[str], None]
) -> Outcome:
    here = robot.wait_for(Tracking, 5.0).pose
    fast, turn = _top_speeds(robot.drive_model(), old)
    reach = min(reach_of(settings.room_m, old["WHEEL_DIST"] + MARGIN_M), REACH_S * fast)
    places = points(here, reach, min(TURN_RAD, REACH_S * turn), settings.legs, settings.seed)
    present = {name: old[name] for name in CHANGED}
    trial.set_many({**present, **gentle_values(old)})
    fit, measured, old = _measured(robot, settings, old, places, tell)
    design = design_from(fit, measured, old, settings.required)
    sets = (present, {**present, **design.values})
    trial.set_many(sets[1])
    swept = sweep(robot, settings.room_m, tell)
    hardly = [name for name, does in _hardly_damp(design, swept, settings.required).items() if does]
    if hardly:
        tell(f"compared in steps: on the measured robot, the {' and '.join(hardly)} values give too little damping")
    comparison = Comparison(robot, sets, trial.set_many, lambda way, share: _leg(robot, way, old, share), tell)
    compared = comparison.run(places, QUICK, settings.rounds, in_steps=bool(hardly))
    choice = choose(replace(compared.shown, swept=swept.margins), design, settings.required, settings.prefer)
    trial.set_many(sets[1 if choice.kept else 0])
    return Outcome(present, design, compared, choice, bool(hardly), swept)


def _hardly_damp(design: Design, swept: Swept, required: Requirements) -> dict[str, bool]:
    """Return which values have less than half of the margins: the old ones by the model, the new ones by the sweep."""
    new = swept.margins is not None and not required.half().kept_by(swept.margins)
    return {"old": design.old_hardly_damp(required), "new": new}


def _measured(
    robot: Robot,
    settings: Settings,
    old: Mapping[str, float],
    places: list[Pose],
    tell: Callable[[str], None],
) -> tuple[Fit, Measured, dict[str, float]]:
    """Drive gently, then quickly, turn on the spot, and drive on while that does not show enough of the motors.

    Between points the robot moves as fast as its way is long, and turns as it may. So on the way it turns slowly, and
    says little of what a wheel moves then.

    Also returns the parameters with the acceleration limit that later drives keep to.
    """
    turn_rad = max(abs(place.theta - places[0].theta) for place in places)
    reach_m = max(max(abs(place.x - places[0].x), abs(place.y - places[0].y)) for place in places)
    drives: list[Drive] = []
    limits = dict(old)
    for share in (GENTLE, BRISK):
        drives.append(_drive(robot, places, old, share, tell))
        found = _limits_so_far(robot, drives, old, tell)
        if found is not None:
            limits = found
            break
    drives.append(_drive(robot, places, limits, QUICK, tell))
    turning = points(places[0], 0.0, turn_rad, settings.legs, settings.seed)
    drives.append(_drive(robot, turning, limits, QUICK, tell))
    while True:
        try:
            fit, measured = measure(drives, old, _layout(robot, old))
            return fit, measured, within_reach(robot.parameters, limits, fit, measured, tell)
        except (AutotuneError, IdentificationError) as error:
            if len(drives) == MOST_DRIVES:
                raise
            tell(f"{error}: repeating the drive")
        others = points(places[0], reach_m, turn_rad, settings.legs, settings.seed + len(drives))
        drives.append(_drive(robot, others, limits, QUICK, tell))


def _limits_so_far(
    robot: Robot, drives: Sequence[Drive], old: Mapping[str, float], tell: Callable[[str], None]
) -> dict[str, float] | None:
    """Return the robot's limits, or less where the drives show weaker motors; None if they do not show enough."""
    try:
        fit, measured = measure(drives, old, _layout(robot, old))
    except (AutotuneError, IdentificationError) as error:
        tell(f"best so far: {error}")
        return None
    return within_reach(robot.parameters, old, fit, measured, tell)


def within_reach(
    known: Mapping[str, float],
    old: Mapping[str, float],
    fit: Fit,
    measured: Measured,
    tell: Callable[[str], None],
) -> dict[str, float]:
    """Return the parameters with an acceleration limit that the motors reach as they were measured.

    It is computed as ``omni robots new`` does, at half of the quick speed, from all parameters that are ``known`` and
    the measured ones. But the gentle drive was no trouble, so the quick one may accelerate as much.
    """
    values, radius = measured.values, old["WHEEL_RADIUS"]
    mass = old["WHEELS"] * (measured.translating - values["MOT_J"]) / (2.0 * radius**2)
    friction_N_m = fit.estimate["coulomb_V"] * values["MOT_K"] / old["MOT_R"]
    model = model_from_parameters(
        ChainMap({**values, "MASS": mass}, dict(known)), {"coulomb_friction_N_m": friction_N_m}
    )
    speed = 0.5 * QUICK * _top_speeds(model, old)[0]
    reached = ACCELERATION_SHARE * min(top_acceleration(model, way, speed).value for way in directions(DIRECTIONS))
    limit = min(old["LIM_A"], max(reached, GENTLE / QUICK * old["LIM_A"]))
    believed, taken = f"{old['LIM_A']:.3g}", f"{limit:.3g}"
    if taken != believed:  # else the message would contradict itself
        tell(f"the motors do not reach {believed} m/s^2; the next drives take {taken} for LIM_A")
    return {**old, "LIM_A": limit}


def _top_speeds(model: DriveModel, old: Mapping[str, float]) -> tuple[float, float]:
    """Return the speed [m/s] that it reaches in every direction, and its turn rate [rad/s]."""

    def reached(limit: float, *ways: Array) -> float:
        return min([limit, *(min(limit_speed(model, way), motor_speed(model, way)) for way in ways)])

    return reached(old["LIM_V"], *directions(DIRECTIONS)), reached(old["LIM_W"], TURNING)


def _leg(robot: Robot, places: Sequence[Pose], old: Mapping[str, float], share: float) -> float:
    fast, turn = _top_speeds(robot.drive_model(), old)
    acceleration = (share * old["LIM_A"], share * old["LIM_A"] / old["WHEEL_DIST"])
    return leg_time(places, (share * fast, share * turn), acceleration)


def _drive(
    robot: Robot, places: list[Pose], old: Mapping[str, float], share: float, tell: Callable[[str], None]
) -> Drive:
    leg_s = _leg(robot, places, old, share)
    tell(f"{len(places) - 1} legs of {leg_s:.1f} s, at up to {share:.0%} of the limits")
    found = drive(robot, places, leg_s)
    if found.fixes_refused > REFUSED_SHARE * found.fixes:
        raise AutotuneError(
            f"the robot rejected {found.fixes_refused} of {found.fixes} pose fixes: they contradict its wheels",
            hint="measure wheel radius and wheel distance again for the robot file, see docs/guides/robot-file.md, "
            "or check the pose sensor's scale and frame",
        )
    return found


def _layout(robot: Robot, old: Mapping[str, float]) -> Layout:
    angles = [math.radians(robot.parameters[f"W{wheel + 1}_ANGLE"]) for wheel in range(int(old["WHEELS"]))]
    return Layout(old["WHEEL_RADIUS"], old["WHEEL_DIST"], np.array(angles))
