# SPDX-License-Identifier: MIT
"""The report's experiments on the shared control core: every table and figure, beside what was published."""
