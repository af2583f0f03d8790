# SPDX-License-Identifier: MIT
"""Bounds and defaults that the API and the help pages of ``omni`` share.

They stand here because importing this costs nothing: the Tab key needs them, too.
"""

from __future__ import annotations

DEFAULT_TIMEOUT_S = 5.0
"""How long to wait for a robot's answers."""
RADIO_BAUD = 9600
"""Of the XBee radios as they are delivered."""
RADIO_LOSS_LIMIT = 0.05
"""Share of a radio's pings that may get lost."""
RADIO_ROUND_TRIP_LIMIT_S = 0.5
"""That 95 % of the answers of a radio must keep."""
MOTORS_DUTY = 0.2
"""Of the check of each motor on a stand."""
OUTPUT_ENABLE_DUTY = 0.15
"""Of the check of the output-enable pin."""
OUTPUT_ENABLE_LARGEST_DUTY = 0.3
"""The firmware refuses the test of the output-enable pin above."""
MOCAP_MESSAGES = ("compact", "vicon")
"""Kinds of pose fixes that the bridge can send."""
MOCAP_RATE_HZ = 20.0
"""Most fixes per second."""
MOCAP_BUDGET_BYTES_S = 480.0
"""What all bytes of the bridge together may take: half of a 9600-baud radio."""
MOCAP_MAX_AGE_S = 0.2
"""The oldest pose sent."""
TAG_FAMILIES = {"apriltag_36h11": 587, "apriltag_25h9": 35, "aruco_4x4": 50, "aruco_5x5": 100, "aruco_6x6": 250}
"""Kinds of tags that a webcam may look for, the usual one first, and how many tags each has."""
HOST_CONTROL_FULL_PWM = 255
"""Largest PWM in a line for the original robot."""
HOST_CONTROL_MOTORS = 4
"""How many motors such a line has."""
HOST_CONTROL_DELAY_S = 0.03
"""From sending a line of PWM until the original robot's wheels follow."""
LOG_KINDS = (
    "LOG.npz (omni logs import), LOG.csv or a ROS bag with --mapping, a run's folder, LOG.tlog (omni record) or "
    "LOG.mcap"
)
"""What can be read as a log."""
HUB_LISTEN = ("tcp:127.0.0.1:5790", "udpout:127.0.0.1:14550")
"""Where ``omni link`` is found unless it is told otherwise: any number of TCP clients, and QGroundControl."""
ALIGN_WITHIN_S = 5.0
"""Clock offsets between a log and its truth up to this are tried."""
EXCITATION_S = 40.0
"""Of each part of a drive that a robot is identified by."""
