# SPDX-License-Identifier: MIT
"""Logs of any robot: reading with a declared column mapping, spike rejection, clock and frame alignment."""
