# SPDX-License-Identifier: MIT
"""What the build made may be older than the source beside it: how that shows, and what to do.

Imports nothing: it is asked when importing has failed.
"""

from __future__ import annotations

_OURS = ("omniwheel", "hil_sim", "omni_schema", "omni_reproduce")
_C_MODULE = "cffi library 'omniwheel._core'"
MESSAGE = "the built files do not match this source"
HINT = "run make setup (or pip install . again)"


def stale_build(error: BaseException) -> str | None:
    """Return a sentence if this error comes from an old or missing build, None if it is another's.

    Names that our own packages or the compiled module do not have are such errors. A missing package is none.
    """
    if isinstance(error, ImportError) and (error.name or "").split(".")[0] in _OURS:
        return f"{MESSAGE}: {error.msg}"
    if isinstance(error, AttributeError) and _C_MODULE in str(error):
        return f"{MESSAGE}: {error}"
    return None
