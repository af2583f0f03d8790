# SPDX-License-Identifier: MIT
"""Poses from motion capture: Vicon, recorded and simulated streams, and the bridge that sends them to a robot."""

from omniwheel.mocap.bridge import Bridge, BridgeCounts, BridgeSettings
from omniwheel.mocap.source import MocapPose, MocapSource, newest
from omniwheel.mocap.streams import open_source

__all__ = ["Bridge", "BridgeCounts", "BridgeSettings", "MocapPose", "MocapSource", "newest", "open_source"]
