# SPDX-License-Identifier: MIT
"""What is certain of an image without running it: who calls whom, how deep its stack gets, how long the tick takes."""
