# SPDX-License-Identifier: MIT
"""How fast the project is, beside what people would use instead: ``make bench``.

Every benchmark measures ours and its peers in turn in one run and prints ratios. ``bench/peers`` holds the peers, one
file each, whose head says what it is and what it leaves out. ``--write`` puts the tables into
docs/checks/performance.md.
"""
