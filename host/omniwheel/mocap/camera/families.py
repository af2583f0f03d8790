# SPDX-License-Identifier: MIT
"""Kinds of tags by name, and the calibration board."""

from __future__ import annotations

FAMILIES = {
    "apriltag_36h11": "DICT_APRILTAG_36h11",
    "apriltag_25h9": "DICT_APRILTAG_25h9",
    "aruco_4x4": "DICT_4X4_50",
    "aruco_5x5": "DICT_5X5_100",
    "aruco_6x6": "DICT_6X6_250",
}
"""What a camera file calls a family, and what OpenCV calls it. AprilTag 16h5 is left out: it sees tags in noise."""
CELLS = {"apriltag_36h11": 8, "apriltag_25h9": 7, "aruco_4x4": 6, "aruco_5x5": 7, "aruco_6x6": 8}
"""Cells along the side of a tag, its black border included."""
BOARD_FAMILY = "DICT_5X5_1000"
"""Of the markers on the calibration board: OpenCV's name."""
BOARD_FIRST_ID = 500
"""The board's markers have this number and those after it: no tag of a camera file can be taken for them."""
BOARD_SQUARES = (8, 6)
"""Squares of the calibration board: along its width, along its height."""
BOARD_SQUARE_MM = 32.0
"""Their side in print. Its exact value does not matter: a board of another size is the same board at a distance."""
BOARD_MARKER_SHARE = 0.75
"""Side of the board's markers over that of its squares."""
