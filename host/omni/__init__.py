# SPDX-License-Identifier: MIT
"""Front ends above the library :mod:`omniwheel`: the command ``omni``, the studio's server, the hub.

They may use everything, and nothing imports them.
"""
