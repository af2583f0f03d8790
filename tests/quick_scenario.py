# SPDX-License-Identifier: MIT
"""A scenario that is over soon, for tests of what is around a run."""

QUICK = """
[scenario]
name = "quick"
description = "The demo's path for half a second"
extends = "demo"
duration_s = 0.5
[[event]]
at_s = 0.05
command = "trajectory_start"
[[event]]
at_s = 0.05
command = "arm"
"""
