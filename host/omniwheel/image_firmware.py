# SPDX-License-Identifier: MIT
"""Old place of ``hil_sim.image_firmware``, for one more release."""

from omniwheel.moved import moved

__getattr__ = moved(__name__, {"ImageFirmware": "hil_sim.image_firmware"})
