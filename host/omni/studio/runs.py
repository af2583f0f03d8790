# SPDX-License-Identifier: MIT
"""What a page may ask of runs and logs. Worker processes read the files, not the robot's or the server's thread."""

from __future__ import annotations

import asyncio
import tempfile
from collections import OrderedDict
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import Future
from pathlib import Path
from typing import IO, Any, TypeVar

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from omni.studio import reading
from omni.studio.access import Access
from omni.studio.actions import BadRequestError, keys_of, number_of, parse_request
from omni.studio.error_text import hint_of
from omni.studio.studio import Page, Studio
from omni.studio.worker import Worker
from omniwheel.errors import LogError, OmniError

T = TypeVar("T")
LARGEST_UPLOAD = 512 << 20
MOST_UPLOADS = 4
UPLOAD_TIMEOUT_S = 20.0
"""An upload without data for so long is ended: it counts among MOST_UPLOADS."""
LARGEST_REQUEST = 64 * 1024
_WIDTHS = (10, 4000)
_TYPE = "application/octet-stream"
Action = Callable[[Page, Mapping[str, Any]], Coroutine[Any, Any, Any]]


class Runs:
    """Lists runs, opens and compares them, and takes logs from the page. Ends with :meth:`close`."""

    def __init__(self, studio: Studio, access: Access, headers: Mapping[str, str]) -> None:
        self._studio = studio
        self._access = access
        self._headers = dict(headers)
        self._logs = Worker()
        self._uploading = 0
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._uploads: OrderedDict[str, Path] = OrderedDict()
        self._count = 0
        self.actions: dict[str, Action] = {
            "runs": self._list,
            "open_run": self._open,
            "compare_runs": self._compare,
            "run_spectrum": self._spectrum,
            "record": self._record,
        }

    def routes(self) -> list[Route]:
        """Return the routes for what is no JSON: both are POST, so a browser says from which site a request comes."""
        return [
            Route("/run-samples", self._samples, methods=["POST"]),
            Route("/run-log", self._upload, methods=["POST"]),
        ]

    def close(self) -> None:
        """Forget the uploaded logs and end the process that reads logs."""
        self._logs.close()
        if self._folder is not None:
            self._folder.cleanup()

    # ---- over the socket

    async def _list(self, _page: Page, request: Mapping[str, Any]) -> Any:
        text = request.get("find", "")
        if not isinstance(text, str):
            raise BadRequestError("find must be a string")
        found = await _answer(self._studio.worker.ask(reading.listing, self._studio.recorder.root, text))
        return {**found, "largest_upload": LARGEST_UPLOAD}

    async def _open(self, _page: Page, request: Mapping[str, Any]) -> Any:
        return await _answer(self._logs.ask(reading.opened, await self._path(request.get("log"))))

    async def _compare(self, _page: Page, request: Mapping[str, Any]) -> Any:
        names = [_text(request, name) for name in ("one", "other")]
        return await _answer(self._studio.worker.ask(reading.comparison, self._studio.recorder.root, *names))

    async def _spectrum(self, _page: Page, request: Mapping[str, Any]) -> Any:
        keys = keys_of(request)
        begin_s, end_s = number_of(request, "begin_s"), number_of(request, "end_s")
        return await _answer(
            self._logs.ask(reading.spectra, await self._path(request.get("log")), keys, begin_s, end_s)
        )

    async def _record(self, page: Page, request: Mapping[str, Any]) -> Any:
        self._studio.require_command(page)
        if request.get("on") is not True:
            await asyncio.to_thread(self._studio.recorder.stop)
            return None
        session = self._studio.require_session()
        self._studio.experiments.require_idle()  # it keeps a log of its own
        return await asyncio.to_thread(self._studio.recorder.start, session)

    # ---- over HTTP

    async def _samples(self, request: Request) -> Response:
        return await self._checked(request, self._window)

    async def _upload(self, request: Request) -> Response:
        return await self._checked(request, self._take)

    async def _checked(self, request: Request, work: Callable[[Request], Coroutine[Any, Any, Response]]) -> Response:
        problem = self._access.problem(request.headers, request.query_params.get("token", ""))
        if problem:
            return PlainTextResponse(problem + "\n", 403)
        try:
            return await work(request)
        except OmniError as error:
            return JSONResponse({"error": str(error), "hint": hint_of(error)}, 400, self._headers)
        except ClientDisconnect:
            return PlainTextResponse("gone\n", 400)

    async def _window(self, request: Request) -> Response:
        content = bytearray()
        async for part in request.stream():
            content += part
            if len(content) > LARGEST_REQUEST:
                raise BadRequestError("the request is too long")
        wanted = parse_request(content)
        if not isinstance(wanted, dict):
            raise BadRequestError("malformed request")
        keys = keys_of(wanted)
        width = min(max(int(number_of(wanted, "width", 1000.0)), _WIDTHS[0]), _WIDTHS[1])
        begin_s, end_s = number_of(wanted, "begin_s"), number_of(wanted, "end_s")
        path = await self._path(wanted.get("log"))
        found = await _answer(self._logs.ask(reading.window, path, keys, begin_s, end_s, width))
        return Response(found, media_type=_TYPE, headers=self._headers)

    async def _take(self, request: Request) -> Response:
        said = request.headers.get("content-length", "")
        if said.isdigit() and int(said) > LARGEST_UPLOAD:
            raise _too_large()
        if self._uploading >= MOST_UPLOADS:
            raise LogError(f"{MOST_UPLOADS} files are being uploaded already", hint="wait for one of them")
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="omniwheel-studio-")
        self._count += 1
        name = f"file:{self._count}"
        path = Path(self._folder.name) / f"{self._count}.tlog"
        self._uploading += 1
        try:
            with await asyncio.to_thread(path.open, "wb") as file:
                await _received(request, file)
        except BaseException:
            path.unlink(missing_ok=True)
            raise
        finally:
            self._uploading -= 1
        self._uploads[name] = path
        while len(self._uploads) > MOST_UPLOADS:
            self._uploads.popitem(last=False)[1].unlink(missing_ok=True)
        return JSONResponse({"log": name}, headers=self._headers)

    async def _path(self, log: Any) -> Path:
        """Return the file that the page calls "run:NAME" or "file:NUMBER". Raises LogError."""
        kind, _, name = log.partition(":") if isinstance(log, str) else ("", "", "")
        if kind == "run":
            return await _answer(self._studio.worker.ask(reading.run_log, self._studio.recorder.root, name))
        if kind == "file" and log in self._uploads:
            return self._uploads[log]
        raise LogError(
            "this log is no longer open", hint=f"open it again: only the last {MOST_UPLOADS} uploads are kept"
        )


async def _received(request: Request, file: IO[bytes]) -> None:
    size = 0
    parts = request.stream()
    try:
        while (part := await asyncio.wait_for(anext(parts, None), UPLOAD_TIMEOUT_S)) is not None:
            size += len(part)
            if size > LARGEST_UPLOAD:
                raise _too_large()
            await asyncio.to_thread(file.write, part)
        await asyncio.to_thread(file.flush)
    except asyncio.TimeoutError as error:
        raise LogError(f"the upload timed out: no data for {UPLOAD_TIMEOUT_S:g} s", hint="upload it again") from error
    except OSError as error:
        raise LogError(f"cannot store this file: {error.strerror}", hint="free some space on the disk") from error


def _too_large() -> LogError:
    most = f"{LARGEST_UPLOAD >> 20} MB"
    return LogError(
        f"this file is larger than {most}", hint="record shorter runs; logs in the runs folder may have any size"
    )


def _text(request: Mapping[str, Any], name: str) -> str:
    value = request.get(name)
    if not isinstance(value, str):
        raise BadRequestError(f"{name} must be a run's name")
    return value


async def _answer(future: Future[T]) -> T:
    return await asyncio.wrap_future(future)
