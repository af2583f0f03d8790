# SPDX-License-Identifier: MIT
"""Checks of a firmware image on the emulated chip, before it ever meets a robot.

What each check drives is the very program that is flashed: its start, its drivers, its links, its memory. What the chip
does is a model (:mod:`emulated_teensy`); :func:`emulated_teensy.machine.not_modelled` lists what the model leaves
out.
"""
