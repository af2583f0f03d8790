# SPDX-License-Identifier: MIT
"""Chooses a robot's gains from what it was measured to be, and says why: motors, filter, wheels, position."""
