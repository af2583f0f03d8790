# SPDX-License-Identifier: MIT
"""The hub: one program owns a robot's port and serves any number of others.

docs/guides/hub.md says what it does. ``core.Hub`` decides everything: bytes in, bytes out, the clock an argument.
``server`` has the port and the sockets around it. ``shared_link`` is the other programs' side.
"""
