# SPDX-License-Identifier: MIT
"""From measured runs to a robot file: the report's least squares (82)-(88) and the identification that works."""
