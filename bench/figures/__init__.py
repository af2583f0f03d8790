# SPDX-License-Identifier: MIT
"""Commands that print the figures and tables of the docs; tests hold the pages to them."""
