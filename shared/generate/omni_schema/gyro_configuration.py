# SPDX-License-Identifier: MIT
"""The configuration file of a gyro's chip: Bosch's 8192 bytes without which a BMI270 does not measure.

They are not part of this project. The robot file names a file of the user's that has them.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from omni_schema.errors import SchemaError

CONFIG_FILE_KEY = "gyro.config_file"
SHA_KEY = "gyro.config_sha256"
SIZE = 8192
BOSCH_SHA256 = "2d75e68e343a13ff99be98261dfbd99d9e8c6f267da9e3c5aeb883276ad178db"
"""Of the array bmi270_config_file in bmi270.c of Bosch's BMI270 SensorAPI, from v2.34.0 to v2.86.1."""
WHERE = "bmi270.c of Bosch's BMI270 SensorAPI has it, and so has the Python package bmi270 (config_file.py)"

_ARRAY = re.compile(r"\bbmi270_config_file\b[^={]*=\s*[\[{](.*?)[\]}]", re.DOTALL)
_BYTE = re.compile(r"\b0[xX][0-9a-fA-F]{1,2}\b")


def read_configuration(source: str, config_file: str, sha256: str = "") -> bytes:
    """Return the bytes that a robot file's ``config_file`` holds. A path counts from the folder of ``source``.

    The file holds the bytes themselves, or text with an array ``bmi270_config_file`` of them (C or Python).
    ``sha256``: of bytes other than those of Bosch that are known. Raises SchemaError.
    """
    path = Path(source).parent / config_file
    try:
        content = path.read_bytes()
    except OSError as error:
        problem = f"is {config_file!r}, which cannot be read ({error.strerror})"
        raise SchemaError(source, CONFIG_FILE_KEY, problem, hint=WHERE) from error
    found = content if len(content) == SIZE else _in_text(content)
    if len(found) != SIZE:
        problem = f"is {config_file!r}, with {len(found)} bytes of a configuration; {SIZE} are needed"
        raise SchemaError(source, CONFIG_FILE_KEY, problem, hint=WHERE)
    digest = hashlib.sha256(found).hexdigest()
    if digest != (sha256.lower() or BOSCH_SHA256):
        problem = (
            f"is {config_file!r}, whose bytes are not those of Bosch that are known. "
            f'If they are the right ones, say so: config_sha256 = "{digest}"'
        )
        raise SchemaError(source, CONFIG_FILE_KEY, problem, hint=WHERE)
    return found


def _in_text(content: bytes) -> bytes:
    array = _ARRAY.search(content.decode("utf-8", errors="replace"))
    return bytes(int(byte, 16) for byte in _BYTE.findall(array[1])) if array else b""


__all__ = ["BOSCH_SHA256", "CONFIG_FILE_KEY", "SHA_KEY", "SIZE", "WHERE", "read_configuration"]
