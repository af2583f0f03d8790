# SPDX-License-Identifier: MIT
"""What people would use instead, written for the comparison: one file each. None of it is used by the project."""
