# SPDX-License-Identifier: MIT
"""The hub's sockets, served by the test itself, in front of the real firmware."""

from __future__ import annotations

import select
import socket
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from typing import Any

import pytest
from pymavlink import mavutil

from omni.hub import clients
from omni.hub.server import SLOWEST_REOPEN_S, HubServer
from omniwheel import FirmwareProcess
from omniwheel.dialect import mavlink
from omniwheel.errors import LinkOpenError
from omniwheel.hub.shared_link import open_shared
from omniwheel.link import LinkAddress
from tests.hub.bench import ARM, Bench, beat, command, setpoint

ROUNDS = 3000


@pytest.fixture
def robot() -> Iterator[str]:
    with FirmwareProcess("three_wheel") as process:
        yield process.urls[0]


def serve_until(server: HubServer, condition: Callable[[], Any]) -> Any:
    """Serve until the condition holds, and return what it returned."""
    for _ in range(ROUNDS):
        server.serve(0.02)
        if found := condition():
            return found
    raise AssertionError(f"not within {ROUNDS} rounds; the hub said {list(server.hub.events)}")


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


def heartbeat(link: Any) -> Any:
    return link.recv_match(type="HEARTBEAT", blocking=False)


def test_a_station_that_waits_at_a_udp_port_is_found_by_the_hub_and_answered(robot: str) -> None:
    """As QGroundControl does at port 14550."""
    port = free_udp_port()
    station = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", dialect="common")
    with HubServer(robot, ["tcp:127.0.0.1:0", f"udpout:127.0.0.1:{port}"]) as server:
        serve_until(server, lambda: heartbeat(station))
        station.mav.param_request_read_send(1, 1, b"WS_P", -1)
        serve_until(server, lambda: station.recv_match(type="PARAM_VALUE", blocking=False))
    station.close()


def test_a_udp_peer_that_speaks_first_is_served_until_it_is_silent() -> None:
    bench = Bench()
    now_s = [0.0]
    server = clients.UdpClients(bench.hub, LinkAddress("udpin", "127.0.0.1", free_udp_port()), lambda: now_s[0])
    station = mavutil.mavlink_connection(server.url.replace("udpin", "udpout"), dialect="common")
    station.mav.send(beat())
    server.read(set(server.sockets()))
    bench.robot_is(armed=False)
    server.write()
    assert station.recv_match(type="HEARTBEAT", blocking=True).get_srcSystem() == 1
    now_s[0] = clients.UDP_SILENCE_S
    server.read(set())
    assert len(bench.hub.clients) == 1
    now_s[0] += 0.1
    server.read(set())
    assert bench.hub.clients == {}
    server.close()
    station.close()


def test_strangers_do_not_get_in_where_the_hub_speaks_first() -> None:
    bench = Bench()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as station, socket.socket(type=socket.SOCK_DGRAM) as stranger:
        station.bind(("127.0.0.1", 0))
        server = clients.UdpClients(bench.hub, LinkAddress("udpout", *station.getsockname()), lambda: 0.0)
        bench.robot_is(armed=False)
        server.write()
        data, hub = station.recvfrom(4096)
        message = command(ARM, 1.0)
        message.pack(mavutil.mavlink.MAVLink(None, 255, 190))
        for sender in (stranger, station):
            sender.sendto(bytes(message.get_msgbuf()), hub)
            select.select(server.sockets(), [], [])
            server.read(set(server.sockets()))
            bench.run()
            assert len(bench.commands(ARM)) == (1 if sender is station else 0)
        assert data
        server.close()


def test_a_client_that_does_not_read_is_sent_away_and_the_others_go_on(
    robot: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clients, "UNREAD_BYTES", 1000)
    with HubServer(robot, ["tcp:127.0.0.1:0"]) as server:
        host, port = server.urls[0].removeprefix("tcp:").split(":")
        lazy = socket.create_connection((host, int(port)))
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
        serve_until(server, lambda: server.hub.clients)
        busy = mavutil.mavlink_connection(server.urls[0], dialect="common")
        noise = bytes(1_000_000)

        def flooded() -> bool:
            for client in server.hub.clients.values():
                if client.number == 1:
                    client.out += noise
            return any("does not read its messages" in line for line in server.hub.events)

        serve_until(server, flooded)
        serve_until(server, lambda: heartbeat(busy))
        assert len(server.hub.clients) == 1
        busy.close()
        lazy.close()


def test_idle_connections_neither_end_the_hub_nor_lock_out_a_stop(robot: str) -> None:
    with HubServer(robot, ["tcp:127.0.0.1:0"]) as server, ExitStack() as stack:
        driver = mavutil.mavlink_connection(server.urls[0], dialect="common")
        stack.callback(driver.close)
        driver.mav.send(setpoint())
        serve_until(server, lambda: server.hub.command.holder)
        host, port = server.urls[0].removeprefix("tcp:").split(":")
        for _ in range(300):
            stack.enter_context(socket.create_connection((host, int(port))))
            server.serve(0.0)
        assert len(server.hub.clients) == clients.MOST_CLIENTS
        assert server.hub.command.holder is not None, "the client in command is not disconnected"
        calm = mavutil.mavlink_connection(server.urls[0], dialect="common")
        stack.callback(calm.close)
        calm.mav.send(command(mavlink.MAV_CMD_OMNI_ESTOP, 1.0))
        serve_until(server, lambda: calm.recv_match(type="COMMAND_ACK", blocking=False))


def test_a_flood_of_udp_peers_does_not_fill_the_hub() -> None:
    bench = Bench()
    server = clients.UdpClients(bench.hub, LinkAddress("udpin", "127.0.0.1", free_udp_port()), lambda: 0.0)
    message = beat()
    message.pack(mavutil.mavlink.MAVLink(None, 255, 190))
    place = server.url.removeprefix("udpin:").split(":")
    for _ in range(clients.MOST_CLIENTS + 50):
        with socket.socket(type=socket.SOCK_DGRAM) as peer:
            peer.sendto(bytes(message.get_msgbuf()), (place[0], int(place[1])))
        server.read(set(server.sockets()))
    assert len(bench.hub.clients) == clients.MOST_CLIENTS
    server.close()


def test_a_robot_that_another_program_has_is_said_once_and_waited_for() -> None:
    with socket.create_server(("127.0.0.1", 0)) as robot:
        robot.setblocking(False)
        with HubServer(f"tcp:127.0.0.1:{robot.getsockname()[1]}", ["tcp:127.0.0.1:0"]) as server:
            tries = 0
            while tries < 8:
                server._next_open_s = 0.0
                server.serve(0.01)
                with suppress(BlockingIOError):
                    robot.accept()[0].close()
                    tries += 1
            assert server._reopen_s == SLOWEST_REOPEN_S
            assert len(server.hub.events) == 3, list(server.hub.events)  # open, gone, then waiting


def test_other_programs_find_the_hub_by_the_address_of_a_robot_in_the_network(robot: str, own_places: None) -> None:
    with HubServer(robot, ["tcp:127.0.0.1:0"]) as server:
        with pytest.raises(LinkOpenError, match="another hub"):
            HubServer(robot, ["tcp:127.0.0.1:0"])
        serve_until(server, lambda: server.hub.is_open)
        link = open_shared(robot)
        serve_until(server, lambda: server.hub.clients)
        assert "shared" in getattr(link, "notice", "")
        link.close()


def test_a_port_that_is_not_there_is_said_once_and_waited_for() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        nobody = f"tcp:127.0.0.1:{free.getsockname()[1]}"
        with HubServer(nobody, ["tcp:127.0.0.1:0"]) as server:
            for _ in range(10):
                server.serve(0.01)
                server._next_open_s = 0.0
            assert [line for line in server.hub.events if "waiting" in line] == [
                f"waiting: cannot open {nobody}: connection refused"
            ]
