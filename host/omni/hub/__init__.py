# SPDX-License-Identifier: MIT
"""The hub: one program owns a robot's port and serves any number of others.

docs/guides/hub.md describes it. ``core.Hub`` decides everything: bytes in, bytes out, the clock an argument. ``server``
has the port and the sockets around it. The client's side is :mod:`omniwheel.hub`.
"""
