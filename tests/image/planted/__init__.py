# SPDX-License-Identifier: MIT
"""Bugs that a developer could make in the flashed program, each a patch. The checks of an image must find them."""
