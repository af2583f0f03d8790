# SPDX-License-Identifier: MIT
"""Where a hub listens, and how many bytes its robot's link may be given."""

from __future__ import annotations

import ipaddress
from dataclasses import dataclass

from omniwheel.byte_budget import BITS_PER_BYTE
from omniwheel.errors import LinkUrlError
from omniwheel.link import LinkAddress, parse_url
from omniwheel.ports import serial_ports

SHARE = 0.5
"""Of a radio's line, for what goes to the robot, as much as the robot takes for its telemetry."""
RADIO_BURST_BYTES = 100.0
WIDE_BYTES_S = 200_000.0
"""For USB and everything else that is no radio."""
WIDE_BURST_BYTES = 20_000.0
_PSEUDO_TERMINALS = "/dev/pts/"


@dataclass(frozen=True)
class Budget:
    """How many bytes per second a link may be given in the long run, and how many at once."""

    bytes_s: float
    burst_bytes: float


def radio_budget(bytes_s: float) -> Budget:
    """Return the budget of a slow link: little at once, so that a stop finds nothing in its way."""
    return Budget(bytes_s, max(RADIO_BURST_BYTES, bytes_s / 50.0))


def budget_of(url: str, real_path: str) -> Budget:
    """Return the budget of the link ``url``, whose port is ``real_path`` now.

    A serial port is a radio of its baud rate. Not so are a Teensy's USB port, and a pseudo-terminal without a rate.
    """
    address = parse_url(url)
    has_rate = "," in url
    if address.kind != "serial" or (not has_rate and real_path.startswith(_PSEUDO_TERMINALS)):
        return Budget(WIDE_BYTES_S, WIDE_BURST_BYTES)
    if any(port.device == real_path and port.guess == "teensy" for port in serial_ports()):
        return Budget(WIDE_BYTES_S, WIDE_BURST_BYTES)
    return radio_budget(SHARE * address.number / BITS_PER_BYTE)


def listen_address(text: str) -> LinkAddress:
    """Understand where to listen: tcp:, udp: (waits) or udpout: (speaks first). Raises LinkUrlError.

    A TCP port of 0 picks a free one.
    """
    free = text.startswith("tcp:") and text.endswith(":0")
    address = parse_url(text.removesuffix("0") + "1" if free else text)
    if address.kind == "serial":
        hint = "must be tcp:host:port, udp:host:port or udpout:host:port"
        raise LinkUrlError(f"cannot listen at {text!r}", hint=hint)
    return LinkAddress(address.kind, address.place, 0) if free else address


def is_local(address: LinkAddress) -> bool:
    """Return whether only this computer reaches the address."""
    if address.place == "localhost":
        return True
    try:
        return ipaddress.ip_address(address.place).is_loopback
    except ValueError:
        return False
