# SPDX-License-Identifier: MIT
"""From a robot file to a Teensy that runs its firmware: build, check the image, upload, ask what runs."""
