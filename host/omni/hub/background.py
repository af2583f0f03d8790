# SPDX-License-Identifier: MIT
"""``python -m omni.hub.background URL``: the hub that a second program starts for a port of a first one.

It reads the signing key, if there is one, from its standard input. It ends after a while without clients.
"""

from __future__ import annotations

import sys
import time

from omni.hub.log_writer import LogWriter
from omni.hub.server import HAND_OVER_WITHIN_S, OWN_ADDRESS, HubServer
from omniwheel.errors import OmniError
from omniwheel.signing import Signer

ALONE_S = 5.0
"""It ends when there has been no client for this time."""


def main(arguments: list[str]) -> int:
    """Serve until no client is left; return the exit code."""
    key = bytes.fromhex(sys.stdin.read())
    log = LogWriter()
    try:
        with HubServer(arguments[0], [OWN_ADDRESS], signer=Signer(key) if key else None) as server:
            server.ask_owner(HAND_OVER_WITHIN_S)
            return _serve(server, log)
    except OmniError as error:
        log.write(str(error))
        return error.exit_code
    finally:
        log.close()


def _serve(server: HubServer, log: LogWriter) -> int:
    started_s = alone_s = time.monotonic()
    while time.monotonic() - alone_s < ALONE_S:
        server.serve()
        if server.hub.clients:
            alone_s = time.monotonic()
        elif not server.was_open and time.monotonic() - started_s >= HAND_OVER_WITHIN_S:
            log.write("another program keeps it locked")
            return 1
        while server.hub.events:
            log.write(server.hub.events.popleft())
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
