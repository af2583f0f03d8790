# SPDX-License-Identifier: MIT
"""The studio's web server: files of the page, and a WebSocket per open page.

Text messages are JSON. The page sends ``{"do": NAME, "id": N, ...}`` and gets ``{"answer": N, ...}``, or
``{"answer": N, "error": ..., "hint": ...}``. The server sends news by itself, and samples as binary messages
(:func:`omni.studio.samples.packed`).
"""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections.abc import Callable, Coroutine, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect, WebSocketState

from omni.studio import experiments
from omni.studio.access import Access
from omni.studio.actions import ACTIONS, BadRequestError, keys_of, number_of, parse_request
from omni.studio.bringup_walk import wiring_picture
from omni.studio.connections import bounded
from omni.studio.error_text import hint_of
from omni.studio.outbox import Outbox
from omni.studio.parameter_view import values_as_json
from omni.studio.processors import IMAGE, PC, WORDS, processors
from omni.studio.runs import Runs
from omni.studio.samples import MOST_NUMBER
from omni.studio.simulated import Simulation
from omni.studio.studio import Page, Studio
from omniwheel import parameter_file
from omniwheel.default_system import LAST_SYSTEM
from omniwheel.errors import OmniError
from omniwheel.other_hardware import WHEELS, require_same_hardware
from omniwheel.parameters import without_system
from omniwheel.ports import serial_ports
from omniwheel.robots import robot_names

PAGE_DIR = Path(__file__).parent / "page"
_STOP_FIRST = "not done: cancelled by a stop"
_OWN_ERROR = 1011
"""WebSocket's number for an error of the server's own."""
_TOO_MANY = 1013
"""... and for a server that has too much to do."""
_LOG = logging.getLogger(__name__)
SAMPLES_S = 0.008
"""Time between two messages with samples: less than a frame of the screen lasts, so that each frame has new ones."""
NEWS_EVERY = 6
"""Messages with samples between two looks at everything else."""
LARGEST_MESSAGE = 256 * 1024
MOST_PAGES = 40
"""For one more, the page that was opened first and does not command is closed."""
MOST_WAITING = 32
"""Requests of one page that may wait for the robot at once."""
_TYPES = {".js": "text/javascript", ".css": "text/css", ".html": "text/html", ".svg": "image/svg+xml"}
_LONGEST_NAME = 255
"""Bytes that a file system takes; a longer name is an error there, not a file that is missing."""
_SECURITY = {
    "Content-Security-Policy": "default-src 'self'; style-src 'self' 'unsafe-inline'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-store",
}
# The plots set sizes as inline styles; nothing else needs it.


class StudioServer:
    """Serves one :class:`Studio`. ``scenarios`` says what a simulated robot can be started with."""

    def __init__(
        self, studio: Studio, access: Access, vendor_dir: Path, scenarios: Callable[[], Mapping[str, str]]
    ) -> None:
        self.studio = studio
        self.access = access
        self._vendor_dir = vendor_dir
        self._scenarios = scenarios
        self._changing = asyncio.Lock()
        self._samples_lock = asyncio.Lock()
        self._sockets: dict[Page, WebSocket] = {}
        self._closing: set[asyncio.Task[None]] = set()
        self.runs = Runs(studio, access, _SECURITY)
        self._local: dict[str, Callable[[Page, Mapping[str, Any]], Coroutine[Any, Any, Any]]] = {
            "stop": self._stop,
            "disarm": self._disarm,
            "here": self._here,
            "take_over": self._take_over,
            "show": self._show,
            "window": self._window,
            "spectrum": self._spectrum,
            "choices": self._choices,
            "connect": self._connect,
            "disconnect": self._disconnect,
            "simulate": self._simulate,
            "world": self._world,
            "flash": self._flash,
            "save_view": self._save_view,
            "bring_up": self._bring_up,
            "experiment": self._experiment,
            "load": self._load,
            **self.runs.actions,
        }

    def app(self) -> Starlette:
        """Return the application for an ASGI server."""
        return Starlette(
            routes=[
                Route("/", self._index),
                Route("/state.json", self._state),
                Route("/parameters.toml", self._parameters),
                Route("/experiment.png", self._picture),
                Route("/wiring.svg", self._wiring),
                Route("/page/{name}", self._file),
                Route("/vendor/{name}", self._vendor),
                *self.runs.routes(),
                WebSocketRoute("/socket", self._socket),
            ]
        )

    # ---- files

    def _refusal(self, request: Request) -> Response | None:
        problem = self.access.problem(request.headers, request.query_params.get("token", ""))
        return PlainTextResponse(problem + "\n", 403) if problem else None

    async def _index(self, request: Request) -> Response:
        return self._refusal(request) or _file_of(PAGE_DIR, "index.html")

    async def _file(self, request: Request) -> Response:
        return _file_of(PAGE_DIR, request.path_params["name"])

    async def _vendor(self, request: Request) -> Response:
        return _file_of(self._vendor_dir, request.path_params["name"])

    async def _state(self, request: Request) -> Response:
        return self._refusal(request) or JSONResponse(self.studio.state(), headers=_SECURITY)

    async def _picture(self, request: Request) -> Response:
        picture = self.studio.experiments.picture
        if picture is None or not picture.is_file():
            return self._refusal(request) or PlainTextResponse("no experiment was run yet\n", 404)
        return self._refusal(request) or FileResponse(picture, media_type="image/png", headers=_SECURITY)

    async def _wiring(self, request: Request) -> Response:
        refused = self._refusal(request)
        if refused is not None:
            return refused
        try:
            picture = await asyncio.to_thread(wiring_picture, request.query_params.get("robot", ""))
        except OmniError as error:
            return PlainTextResponse(f"{error}\n", 404)
        return Response(picture, media_type=_TYPES[".svg"], headers=_SECURITY)

    async def _parameters(self, request: Request) -> Response:
        refused = self._refusal(request)
        if refused is not None:
            return refused
        session = self.studio.session
        robot = None if session is None else session.robot
        if robot is None:
            return PlainTextResponse("no robot is connected\n", 409)
        headers = {**_SECURITY, "Content-Disposition": 'attachment; filename="parameters.toml"'}
        return PlainTextResponse(parameter_file.text_of(robot.parameters.known, robot.table), headers=headers)

    # ---- pages

    async def _socket(self, socket: WebSocket) -> None:
        if self.access.problem(socket.headers, socket.query_params.get("token", "")):
            await socket.close(4403)
            return
        await socket.accept()
        self._make_room()
        page = self.studio.open_page()
        self._sockets[page] = socket
        outbox = Outbox()
        tasks = [asyncio.create_task(self._send(socket, page, outbox))]
        waiting: set[asyncio.Task[None]] = set()
        try:
            while True:
                message = await socket.receive()
                if message["type"] == "websocket.disconnect":
                    break
                await self._receive(page, message.get("text"), outbox, waiting)
        except (WebSocketDisconnect, RuntimeError):  # starlette's word for a socket that is closed already
            pass
        finally:
            self._sockets.pop(page, None)
            self.studio.close_page(page)
            for task in (*tasks, *waiting):
                task.cancel()

    def _make_room(self) -> None:
        """Close the oldest watching page if there are as many pages as there may be."""
        watching = (page for page in self._sockets if page is not self.studio.commanding)
        if len(self._sockets) >= MOST_PAGES and (oldest := next(watching, None)) is not None:
            task = asyncio.create_task(self._close(self._sockets.pop(oldest)))  # it may take its time to answer
            self._closing.add(task)
            task.add_done_callback(self._closing.discard)

    async def _close(self, socket: WebSocket) -> None:
        with suppress(Exception):
            await socket.close(_TOO_MANY)

    async def _send(self, socket: WebSocket, page: Page, outbox: Outbox) -> None:
        """Tell a page everything until it has gone. A page that can be told nothing more is closed: it comes anew."""
        try:
            await self._send_all(socket, page, outbox)
        except Exception:
            if socket.application_state is WebSocketState.CONNECTED:
                _LOG.exception("sending an update to a page failed")
                with suppress(Exception):
                    await socket.close(_OWN_ERROR)

    async def _send_all(self, socket: WebSocket, page: Page, outbox: Outbox) -> None:
        turn = 0
        while True:
            while (answer := outbox.pop()) is not None:
                await _send_one(socket, answer)
            samples = self.studio.new_samples(page)
            if samples:
                await socket.send_bytes(samples)
            if turn % NEWS_EVERY == 0:
                news = self.studio.news(page)
                if news:
                    await socket.send_text(json.dumps(news))
            turn += 1
            await asyncio.sleep(SAMPLES_S)

    async def _receive(self, page: Page, text: str | None, outbox: Outbox, waiting: set[asyncio.Task[None]]) -> None:
        self.studio.heard(page)
        try:
            request = parse_request(text or "")
        except BadRequestError:
            request = None
        action = request.get("do") if isinstance(request, dict) else None
        if outbox.is_full and action not in ("stop", "disarm"):
            return  # no client to read the rejection
        if not isinstance(action, str):
            outbox.put(json.dumps({"error": "malformed request"}))
            return
        if action not in ("stop", "disarm") and len(waiting) >= MOST_WAITING:
            outbox.put(_answer(request, error="too many pending requests"))
            return
        if action in ("stop", "disarm"):
            await self._answered(page, action, request, outbox)
            return
        task = asyncio.create_task(self._answered(page, action, request, outbox, self.studio.stops))
        waiting.add(task)
        task.add_done_callback(waiting.discard)

    async def _answered(
        self,
        page: Page,
        action: str,
        request: Mapping[str, Any],
        outbox: Outbox,
        stops: int | None = None,
    ) -> None:
        """Do what a page asked for; ``stops`` is how many stops had been asked for before, None for a stop.

        An answer is left out when too many wait already.
        """
        try:
            if stops is not None and stops < self.studio.stops and action in (*ACTIONS, "experiment", "bring_up"):
                raise BadRequestError(_STOP_FIRST)
            local = self._local.get(action)
            if local is not None:
                result = await local(page, request)
            else:
                result = await asyncio.wrap_future(self.studio.ask(page, action, request))
        except OmniError as error:
            outbox.put(_answer(request, error=str(error), hint=hint_of(error)))
            return
        except Exception as error:
            _LOG.exception("%s failed", action)
            words = f"internal error in {action!r}: {type(error).__name__}: {error}"
            outbox.put(_answer(request, error=words, hint="the terminal of omni studio has the details"))
            return
        if isinstance(result, bytes):
            if result:
                outbox.put(result)
            result = None
        outbox.put(_answer(request, result=result))

    # ---- what the server does itself

    async def _stop(self, _page: Page, _request: Mapping[str, Any]) -> dict[str, bool]:
        return {"told": self.studio.stop()}

    async def _disarm(self, _page: Page, _request: Mapping[str, Any]) -> dict[str, bool]:
        return {"told": self.studio.disarm()}

    async def _here(self, page: Page, _request: Mapping[str, Any]) -> None:
        self.studio.heard(page)

    async def _take_over(self, page: Page, _request: Mapping[str, Any]) -> None:
        self.studio.take_over(page)

    async def _show(self, page: Page, request: Mapping[str, Any]) -> bytes:
        number = int(number_of(request, "number", 0.0))
        if not 0 <= number <= MOST_NUMBER:
            raise BadRequestError(f"number must be from 0 to {MOST_NUMBER}, not {number}")
        keys, span_s = keys_of(request), number_of(request, "span_s", 10.0)
        return await self._compute_samples(lambda: self.studio.show(page, keys, span_s, number))

    async def _window(self, page: Page, request: Mapping[str, Any]) -> bytes:
        width = min(max(int(number_of(request, "width", 1000.0)), 10), 4000)
        begin_s, end_s = number_of(request, "begin_s"), number_of(request, "end_s")
        return await self._compute_samples(lambda: self.studio.window(page, begin_s, end_s, width))

    async def _compute_samples(self, samples: Callable[[], bytes]) -> bytes:
        """Compute samples for a plot. Between two such computations, of whatever page, a stop is heard."""
        async with self._samples_lock:
            await asyncio.sleep(0)
            return samples()

    async def _spectrum(self, _page: Page, request: Mapping[str, Any]) -> list[dict[str, Any]]:
        keys = keys_of(request)
        begin_s, end_s = number_of(request, "begin_s"), number_of(request, "end_s")
        return await asyncio.to_thread(self.studio.spectra, keys, begin_s, end_s)

    async def _choices(self, _page: Page, _request: Mapping[str, Any]) -> dict[str, Any]:
        ports = await asyncio.to_thread(serial_ports)
        return {
            "ports": [{"url": port.device, "what": port.guess or _known(port.description)} for port in ports],
            "scenarios": await asyncio.to_thread(self._scenarios),
            "robots": robot_names(),
            "processors": await asyncio.to_thread(processors),
        }

    async def _connect(self, page: Page, request: Mapping[str, Any]) -> None:
        url = request.get("url")
        if not isinstance(url, str) or not url:
            raise BadRequestError("the robot's address is missing", hint="like /dev/ttyACM0 or tcp:127.0.0.1:5760")
        system_id = None if request.get("system") is None else int(number_of(request, "system"))
        if system_id is not None and not 1 <= system_id <= LAST_SYSTEM:
            raise BadRequestError(f"system id {system_id}; must be from 1 to {LAST_SYSTEM}")
        await self._change(page, lambda: self.studio.connect(url, system_id))

    async def _disconnect(self, page: Page, _request: Mapping[str, Any]) -> None:
        await self._change(page, self.studio.disconnect)

    async def _simulate(self, page: Page, request: Mapping[str, Any]) -> None:
        scenario, robot = request.get("scenario"), request.get("robot")
        if not isinstance(scenario, str) or scenario not in await asyncio.to_thread(self._scenarios):
            raise BadRequestError(f"unknown scenario {scenario!r}")
        if robot is not None and robot not in robot_names():
            raise BadRequestError(f"unknown robot {robot!r}")
        processor, image = request.get("processor", PC), request.get("image") or ""
        if not isinstance(processor, str) or processor not in WORDS:
            raise BadRequestError(f"unknown processor {processor!r}")
        if not isinstance(image, str) or (processor == IMAGE) != bool(image):
            raise BadRequestError("the image's path is missing", hint="build one: make firmware")
        wanted = Simulation(str(scenario), robot, int(number_of(request, "seed", 1.0)), processor, image)
        await self._change(page, lambda: self.studio.simulate(wanted))

    async def _world(self, page: Page, request: Mapping[str, Any]) -> None:
        self.studio.change_world(page, request)

    async def _save_view(self, page: Page, request: Mapping[str, Any]) -> None:
        await asyncio.to_thread(self.studio.save_view, page, request.get("view"))

    async def _bring_up(self, page: Page, request: Mapping[str, Any]) -> None:
        self.studio.walk(page, request)

    async def _flash(self, page: Page, request: Mapping[str, Any]) -> None:
        await self._change(page, lambda: self.studio.flash(page, request))

    async def _experiment(self, page: Page, request: Mapping[str, Any]) -> Any:
        stops = self.studio.stops
        await asyncio.to_thread(experiments.prepare)
        if stops < self.studio.stops:
            raise BadRequestError(_STOP_FIRST)
        future = self.studio.experiment(page, request)
        return None if future is None else await asyncio.wrap_future(future)

    async def _load(self, page: Page, request: Mapping[str, Any]) -> Any:
        session = self.studio.session
        robot = None if session is None else session.robot
        if robot is None:
            raise BadRequestError("no robot is connected")
        values = without_system(parameter_file.parse(str(request.get("text", "")), "the file", robot.table))
        known = robot.parameters.known
        changes = {name: (known[name], value) for name, value in values.items() if known.get(name, value) != value}
        require_same_hardware(changes, known[WHEELS], robot.table)
        return await asyncio.wrap_future(self.studio.ask(page, "set", {"values": values_as_json(values)}))

    async def _change(self, page: Page, change: Callable[[], None]) -> None:
        """Connect or disconnect; one at a time, and other pages are served meanwhile."""
        self.studio.require_command(page)
        async with self._changing:
            await asyncio.to_thread(change)


def _known(description: str) -> str:
    return "" if description == "n/a" else description


def _answer(request: Mapping[str, Any], **content: Any) -> str:
    number = request.get("id")
    known = isinstance(number, int | float) and math.isfinite(number)
    return json.dumps({"answer": number if known else None, **content})


async def _send_one(socket: WebSocket, message: str | bytes) -> None:
    if isinstance(message, bytes):
        await socket.send_bytes(message)
    else:
        await socket.send_text(message)


def _file_of(folder: Path, name: str) -> Response:
    path = folder / name
    is_page = path.parent == folder and path.suffix in _TYPES and len(name.encode()) <= _LONGEST_NAME
    if not is_page or not path.is_file():
        return PlainTextResponse("file not found\n", 404)
    return FileResponse(path, media_type=_TYPES[path.suffix], headers=_SECURITY)


def uvicorn_server(app: Starlette) -> uvicorn.Server:
    """Return the server; its sockets are given to ``run``."""
    return uvicorn.Server(
        uvicorn.Config(
            app,
            **bounded(),
            log_level="warning",
            ws_max_size=LARGEST_MESSAGE,
            ws_per_message_deflate=False,
        )
    )
