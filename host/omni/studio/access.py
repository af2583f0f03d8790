# SPDX-License-Identifier: MIT
"""Access control of the studio: only pages that it served itself."""

from __future__ import annotations

import hmac
import ipaddress
import secrets
from collections.abc import Mapping
from urllib.parse import urlsplit

LOCAL_NAMES = frozenset({"localhost", "127.0.0.1", "::1"})


class Access:
    """Checks the headers of a request.

    Another site's page in the same browser can send requests to this computer. But it cannot hide its ``Origin``. A
    foreign name that resolves to this host shows in ``Host``. Beyond this computer a token is needed as well.
    """

    def __init__(self, host: str) -> None:
        self.local = host in LOCAL_NAMES
        self.token = "" if self.local else secrets.token_urlsafe(18)
        self._names = LOCAL_NAMES if self.local else LOCAL_NAMES | {host}
        self._any_address = host in ("0.0.0.0", "::")

    def problem(self, headers: Mapping[str, str], token: str) -> str:
        """Say why a request is refused, "" if it is not. ``token`` is what the request's address holds."""
        if not self._is_ours(headers.get("host", "")):
            return "the request's Host header is not an address of the studio"
        origin = headers.get("origin")
        if origin is not None and urlsplit(origin).netloc != headers.get("host", ""):
            return "requests from other web sites are rejected"
        if self.token and not hmac.compare_digest(token.encode(), self.token.encode()):
            return "the token is missing or wrong: use the address printed by omni studio"
        return ""

    def _is_ours(self, host: str) -> bool:
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        return name in self._names or (self._any_address and _is_address(name))


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
