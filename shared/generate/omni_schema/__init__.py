# SPDX-License-Identifier: MIT
"""Reads ``params.toml`` and robot files: the one description of every tunable, for the generator and the host.

Pure Python, no build needed. All problems with a file are raised as :class:`SchemaError`, whose message names the
file, the key, the value and what is allowed.
"""

from omni_schema.encoder_plan import EncoderPlan, plan_encoders
from omni_schema.errors import SchemaError
from omni_schema.flow import FlowChip, FlowWiring
from omni_schema.gyro import GyroWiring
from omni_schema.gyro_chips import GyroChip
from omni_schema.parameters import (
    MAX_WHEELS,
    Parameter,
    ParameterTable,
    as_float32,
    load_parameters,
    parse_parameters,
)
from omni_schema.robots import Robot, load_robot, parse_robot
from omni_schema.wiring import BoardWiring
from omni_schema.wiring_label import wiring_id

__all__ = [
    "MAX_WHEELS",
    "BoardWiring",
    "EncoderPlan",
    "FlowChip",
    "FlowWiring",
    "GyroChip",
    "GyroWiring",
    "Parameter",
    "ParameterTable",
    "Robot",
    "SchemaError",
    "as_float32",
    "load_parameters",
    "load_robot",
    "parse_parameters",
    "parse_robot",
    "plan_encoders",
    "wiring_id",
]
