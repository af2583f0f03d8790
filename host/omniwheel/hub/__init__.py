# SPDX-License-Identifier: MIT
"""A port that several programs share: ``shared_link`` finds its hub (the program ``omni.hub``), or starts one."""
