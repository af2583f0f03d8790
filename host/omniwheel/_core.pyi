# SPDX-License-Identifier: MIT
# The compiled control core and simulated world; the C headers in shared/core/include are its documentation.
from typing import Any

ffi: Any
lib: Any
