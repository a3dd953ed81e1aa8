"""The application: the page's own files, and one address for each call that the page makes."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from cmpdesign import __version__
from cmpdesign.api.sequences import cameras
from cmpdesign.design.templates import templates
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import read_file
from cmpdesign.libraries import extra
from cmpdesign.studio import designs, pictures
from cmpdesign.studio.builds import Builds
from cmpdesign.studio.designs import Look
from cmpdesign.studio.guard import Door, Guard
from cmpdesign.studio.live import (
    CameraReader,
    LiveFeed,
    hello_document,
    obey,
    open_camera,
)
from cmpdesign.studio.readings import MAX_PICTURE_BYTES, Readings
from cmpdesign.studio.recording import KINDS, Recordings
from extractor import ExtractorError, Reference

with extra("studio"):
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.requests import HTTPConnection, Request
    from starlette.responses import JSONResponse, Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocket, WebSocketDisconnect

MAX_TEXT_BYTES, MAX_LAYOUT_BYTES = 1 << 20, 64 << 20
PAGE = Path(__file__).parent / "page"
_KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".png": "image/png",
    ".glb": "model/gltf-binary",
}
_SHOWN = (".svg", ".png", ".glb")  # other files of a build are downloads
Call = Callable[[Request], Awaitable[Response]]
_CALLS = {
    "design": designs.design_document,
    "remedy": designs.remedy_of,
    "size": designs.proposed_design,
    "laser": pictures.laser_document,
}


class _Refused(Exception):
    """A request that is not answered; ``args``: the HTTP status and the words."""


@dataclass(frozen=True, eq=False)
class Studio:
    """The state of one run of the page."""

    live: LiveFeed | None = None
    builds: Builds = field(default_factory=Builds)
    readings: Readings = field(default_factory=Readings)
    recordings: Recordings = field(default_factory=Recordings)

    def routes(self) -> list[Route | WebSocketRoute]:
        """The addresses."""
        get, post = ["GET"], ["POST"]
        return [
            Route("/", _page_file, methods=get),
            Route("/page/{name}", _page_file, methods=get),
            Route("/api/start", self._start, methods=get),
            Route("/api/cameras", _cameras, methods=get),
            Route("/api/templates/{name}.svg", _template, methods=get),
            *(Route(f"/api/{name}", _call(of), methods=post) for name, of in _CALLS.items()),
            Route("/api/toml", _toml, methods=post),
            Route("/api/seen", _seen, methods=post),
            Route("/api/builds", self._build, methods=post),
            Route("/api/builds/{key}", self._build_state, methods=["GET", "DELETE"]),
            Route("/api/builds/{key}/all.zip", self._build_archive, methods=get),
            Route("/api/builds/{key}/files/{name:path}", self._build_file, methods=get),
            Route("/api/layouts", self._layout, methods=post),
            Route("/api/readings", self._read, methods=post),
            Route("/api/readings/{key}/moved", self._moved, methods=get),
            Route("/api/readings/{key}/report.zip", self._report, methods=get),
            Route("/api/readings/{key}/{stage}.jpg", self._picture, methods=get),
            Route("/api/tracks", self._track, methods=post),
            Route("/api/recordings/{key}", self._recording, methods=get),
            WebSocketRoute("/live/source", self._live),
            WebSocketRoute("/live/machine", self._machine),
            WebSocketRoute("/live/camera", self._camera),
        ]

    def close(self) -> None:
        """End all builds and remove all files."""
        for kept in (self.builds, self.readings, self.recordings):
            kept.close()

    async def _start(self, request: Request) -> Response:
        document = await run_in_threadpool(designs.start_document)
        source = None if self.live is None else self.live.name
        return JSONResponse({"version": __version__, "live": source, "recorded": KINDS, **document})

    async def _live(self, socket: WebSocket) -> None:
        """The run of ``view``."""
        await socket.accept()
        if self.live is None:
            await socket.close(reason="there is no live source; start with: cmpdesign view LAYOUT SOURCE")
            return
        with suppress(WebSocketDisconnect):
            await self._show(socket, self.live)

    async def _machine(self, socket: WebSocket) -> None:
        """A camera of this machine, for as long as the page looks at it."""
        await socket.accept()
        with suppress(WebSocketDisconnect):
            try:
                number = int(socket.query_params.get("camera", "0"))
                feed = await run_in_threadpool(open_camera, self._layout_of(socket), number)
            except (CmpDesignError, ExtractorError, ValueError) as error:
                await socket.send_json({"over": str(error)})
                return
            try:
                await self._show(socket, feed)
            finally:
                feed.stop()

    async def _show(self, socket: WebSocket, feed: LiveFeed) -> None:
        """The latest frame of a run, each time that the page asks for one."""
        count = -1
        await socket.send_json(hello_document(feed.layout, feed.name))
        while True:
            words = await socket.receive_text()
            if words != "next":
                answer = await run_in_threadpool(obey, feed, words, self.recordings)
                if answer is not None:
                    await socket.send_json(answer)
                continue
            latest = None
            while latest is None and not (feed.is_over and count >= 0):
                latest = await run_in_threadpool(feed.newer, count)
            if latest is None:
                await socket.send_json({"over": feed.failure or "the source has ended"})
                return
            count = latest.count
            await socket.send_bytes(await run_in_threadpool(latest.message))

    async def _camera(self, socket: WebSocket) -> None:
        """Frames of the browser's camera, read with the layout of a design; one frame is under way."""
        await socket.accept()
        with suppress(WebSocketDisconnect):
            try:
                layout = await run_in_threadpool(self._layout_of, socket)
                reader = await run_in_threadpool(CameraReader, layout)
            except (CmpDesignError, ExtractorError) as error:
                await socket.send_json({"over": str(error)})
                return
            await socket.send_json(hello_document(layout, "the camera of this browser"))
            try:
                while (message := await socket.receive())["type"] != "websocket.disconnect":
                    if (data := message.get("bytes")) is not None:
                        await socket.send_bytes(await run_in_threadpool(reader.read, data))
                        continue
                    words = message.get("text") or ""
                    answer = await run_in_threadpool(obey, reader, words, self.recordings)
                    if answer is not None:
                        await socket.send_json(answer)
            finally:
                reader.close()

    def _layout_of(self, request: HTTPConnection) -> Reference:
        """The layout that a request names: one that was opened, else that of the design."""
        query = request.query_params
        design = designs.design_of(parse_json(query.get("fields", "{}"), "the design"))
        return self.readings.layout(design, query.get("layout", ""))

    async def _build(self, request: Request) -> Response:
        asked = await _asked(request)
        design = designs.design_of(asked.get("fields"))
        names = _texts(asked, "products")
        return JSONResponse(self.builds.start(design, names, Look.of(asked).camera_px).document())

    async def _build_state(self, request: Request) -> Response:
        build = self.builds.get(request.path_params["key"])
        if request.method == "DELETE":
            await run_in_threadpool(build.cancel)
        return JSONResponse(build.document())

    async def _build_archive(self, request: Request) -> Response:
        build = self.builds.get(request.path_params["key"])
        return _download(await run_in_threadpool(build.archive), "pad.zip")

    async def _build_file(self, request: Request) -> Response:
        name = request.path_params["name"]
        path = self.builds.get(request.path_params["key"]).files().get(name)
        if path is None:
            raise _Refused(404, "this build has no such file")
        data = await run_in_threadpool(read_file, path)
        if path.suffix in _SHOWN:
            return Response(data, media_type=_KINDS[path.suffix])
        return _download(data, path.name)

    async def _layout(self, request: Request) -> Response:
        text = (await _body(request, MAX_LAYOUT_BYTES)).decode("utf-8", "replace")
        return JSONResponse(await run_in_threadpool(self.readings.add_layout, text))

    async def _read(self, request: Request) -> Response:
        query = request.query_params
        design = designs.design_of(parse_json(query.get("fields", "{}"), "the design"))
        data = await _body(request, MAX_PICTURE_BYTES)
        name = query.get("name", "picture")[:100]
        read = partial(self.readings.read, design, query.get("layout", ""), name, data)
        return JSONResponse(await run_in_threadpool(read))

    async def _moved(self, request: Request) -> Response:
        rest = request.query_params.get("rest")
        reading = self.readings.get(request.path_params["key"])
        at_rest = None if rest is None else self.readings.get(rest)
        return JSONResponse(await run_in_threadpool(reading.moved, at_rest))

    async def _picture(self, request: Request) -> Response:
        path = request.path_params
        picture = await run_in_threadpool(self.readings.picture, path["key"], path["stage"])
        return Response(picture, media_type="image/jpeg")

    async def _report(self, request: Request) -> Response:
        reading = self.readings.get(request.path_params["key"])
        return _download(await run_in_threadpool(reading.report), "report.zip")

    async def _track(self, request: Request) -> Response:
        asked = await _asked(request)
        keys, rest, kind = _texts(asked, "keys"), asked.get("rest"), str(asked.get("kind"))
        rest = None if rest is None else str(rest)
        return _download(await run_in_threadpool(self.readings.track, keys, rest, kind), f"run.{kind}")

    async def _recording(self, request: Request) -> Response:
        name, data = await run_in_threadpool(self.recordings.read, request.path_params["key"])
        return _download(data, name)


def make_app(door: Door, live: LiveFeed | None = None) -> Any:
    """The ASGI application behind its guard; ``live``: the run of the live part.

    Raises:
        MissingLibraryError: the extra is not installed.
    """
    studio = Studio(live)

    @asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        yield
        studio.close()

    app = Starlette(
        routes=studio.routes(),
        lifespan=lifespan,
        exception_handlers={
            CmpDesignError: _explain,
            ExtractorError: _explain,
            _Refused: _refuse,
            404: _not_found,
        },
    )
    return Guard(app, door)


async def _page_file(request: Request) -> Response:
    name = request.path_params.get("name", "index.html")
    if name not in {path.name for path in PAGE.iterdir()}:
        raise _Refused(404, "the page has no such file")
    path = PAGE / name
    return Response(
        await run_in_threadpool(read_file, path), media_type=_KINDS.get(path.suffix, "text/plain")
    )


async def _template(request: Request) -> Response:
    name = request.path_params["name"]
    if name not in templates():
        raise _Refused(404, "no such template")
    from cmpdesign.api.designs import load
    from cmpdesign.products.drawing.svg import layout_to_compact_svg

    text = await run_in_threadpool(lambda: layout_to_compact_svg(load(name).layout))
    return Response(text, media_type=_KINDS[".svg"])


def _call(of: Callable[[dict[str, Any]], dict[str, Any]]) -> Call:
    """The answer of a function of the request's JSON object."""

    async def answer(request: Request) -> Response:
        return JSONResponse(await run_in_threadpool(of, await _asked(request)))

    return answer


async def _cameras(request: Request) -> Response:
    """The cameras of this machine by number; ``problem``: why they cannot be listed."""
    try:
        found = (await run_in_threadpool(cameras)).cameras
    except CmpDesignError as error:
        return JSONResponse({"cameras": [], "problem": str(error)})
    return JSONResponse(
        {"cameras": [{"number": one.number, "name": one.name} for one in found], "problem": ""}
    )


async def _toml(request: Request) -> Response:
    text = (await _body(request, MAX_TEXT_BYTES)).decode("utf-8", "replace")
    return JSONResponse({"fields": await run_in_threadpool(designs.read_design_toml, text)})


async def _seen(request: Request) -> Response:
    """The pad as the camera sees it: the picture of ``render``, as PNG."""
    picture = await run_in_threadpool(pictures.seen_picture, await _asked(request))
    return Response(picture, media_type=_KINDS[".png"])


async def _asked(request: Request) -> dict[str, Any]:
    """The JSON object of a request."""
    document = parse_json((await _body(request, MAX_TEXT_BYTES)).decode("utf-8", "replace"), "the request")
    if not isinstance(document, dict):
        raise _Refused(422, "the request is no JSON object")
    return document


def _texts(asked: dict[str, Any], name: str) -> list[str]:
    """The texts of a list in a request."""
    match asked.get(name, []):
        case [*items]:
            return [str(item) for item in items]
    raise _Refused(422, f"{name}: expected a list")


async def _body(request: Request, most_bytes: int) -> bytes:
    """The body; counted while it arrives, so that a large one does not fill the memory."""
    parts, count = [], 0
    async for part in request.stream():
        count += len(part)
        if count > most_bytes:
            raise _Refused(413, f"larger than {most_bytes >> 20} MiB, the limit; make it smaller")
        parts.append(part)
    return b"".join(parts)


def _download(data: bytes, name: str) -> Response:
    safe = "".join(letter for letter in name if letter.isascii() and (letter.isalnum() or letter in "-_."))
    headers = {"content-disposition": f'attachment; filename="{safe}"'}
    return Response(data, media_type="application/octet-stream", headers=headers)


async def _explain(request: Request, error: Exception) -> Response:
    text = " ".join(str(error).split())
    return JSONResponse({"error": text, "fields": designs.error_fields(text)}, status_code=422)


async def _refuse(request: Request, error: Exception) -> Response:
    status, text = error.args
    return JSONResponse({"error": text}, status_code=status)


async def _not_found(request: Request, error: Exception) -> Response:
    return JSONResponse({"error": "no such address"}, status_code=404)
