# SPDX-License-Identifier: MIT
"""Host tools for Omniwheel robots: connect, tune, simulate, record and plot."""

from importlib.metadata import version

__version__ = version("omniwheel")

__all__ = ["__version__"]
