"""The application: the page's own files, and one address for each call that the page makes."""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from cmpdesign import __version__
from cmpdesign.design.templates import templates
from cmpdesign.errors import CmpDesignError
from cmpdesign.inputs.documents import parse_json
from cmpdesign.inputs.files import read_file
from cmpdesign.libraries import extra
from cmpdesign.studio import designs, pictures
from cmpdesign.studio.builds import Builds
from cmpdesign.studio.designs import Look
from cmpdesign.studio.guard import Door, Guard
from cmpdesign.studio.live import CameraReader, LiveFeed, frame_document, hello_document, shown_image
from cmpdesign.studio.readings import MOST_PICTURE_BYTES, Readings
from extractor import ExtractorError

with extra("studio"):
    from starlette.applications import Starlette
    from starlette.concurrency import run_in_threadpool
    from starlette.requests import Request
    from starlette.responses import JSONResponse, Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocket, WebSocketDisconnect

MOST_TEXT_BYTES = 1 << 20
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


class _Refused(Exception):
    """A request that is not answered; ``args``: the HTTP status and the words."""


@dataclass(frozen=True, eq=False)
class Studio:
    """The state of one run of the page."""

    live: LiveFeed | None = None
    builds: Builds = field(default_factory=Builds)
    readings: Readings = field(default_factory=Readings)

    def routes(self) -> list[Route | WebSocketRoute]:
        """The addresses."""
        get, post = ["GET"], ["POST"]
        return [
            Route("/", _page_file, methods=get),
            Route("/page/{name}", _page_file, methods=get),
            Route("/api/start", self._start, methods=get),
            Route("/api/templates/{name}.svg", _template, methods=get),
            Route("/api/design", _design, methods=post),
            Route("/api/remedy", _remedy, methods=post),
            Route("/api/size", _size, methods=post),
            Route("/api/toml", _toml, methods=post),
            Route("/api/seen", _seen, methods=post),
            Route("/api/laser", _laser, methods=post),
            Route("/api/builds", self._build, methods=post),
            Route("/api/builds/{key}", self._build_state, methods=["GET", "DELETE"]),
            Route("/api/builds/{key}/all.zip", self._build_archive, methods=get),
            Route("/api/builds/{key}/files/{name:path}", self._build_file, methods=get),
            Route("/api/readings", self._read, methods=post),
            Route("/api/readings/{key}/report.zip", self._report, methods=get),
            Route("/api/readings/{key}/{stage}.jpg", self._picture, methods=get),
            WebSocketRoute("/live/source", self._live),
            WebSocketRoute("/live/camera", _camera),
        ]

    async def _start(self, request: Request) -> Response:
        document = await run_in_threadpool(designs.start_document)
        source = None if self.live is None else self.live.name
        return JSONResponse({"version": __version__, "live": source, **document})

    async def _live(self, socket: WebSocket) -> None:
        """The latest frame of the run, each time that the page asks for one."""
        feed = self.live
        await socket.accept()
        if feed is None:
            await socket.close(reason="there is no live source; start with: cmpdesign view LAYOUT SOURCE")
            return
        count = -1
        with suppress(WebSocketDisconnect):
            await socket.send_json(hello_document(feed.layout, feed.name))
            while True:
                if await socket.receive_text() == "rest":
                    feed.reset_rest()
                    continue
                latest = None
                while latest is None and not (feed.is_over and count >= 0):
                    latest = await run_in_threadpool(feed.newer, count)
                if latest is None:
                    await socket.send_json({"over": feed.failure or "the source has ended"})
                    return
                count = latest.count
                await socket.send_json(frame_document(latest.frame, latest.frames_per_s))
                await socket.send_bytes(await run_in_threadpool(shown_image, latest.image))

    async def _build(self, request: Request) -> Response:
        asked = await _asked(request)
        design = designs.design_of(asked.get("fields"))
        names = [str(name) for name in asked.get("products") or ()]
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

    async def _read(self, request: Request) -> Response:
        query = request.query_params
        fields = parse_json(query.get("fields", "{}"), "the design")
        reference = designs.design_of(fields).layout.reference()
        data = await _body(request, MOST_PICTURE_BYTES)
        name = query.get("name", "picture")[:100]
        reading = await run_in_threadpool(self.readings.read, reference, name, data)
        return JSONResponse(await run_in_threadpool(reading.document))

    async def _picture(self, request: Request) -> Response:
        reading = self.readings.get(request.path_params["key"])
        return Response(
            await run_in_threadpool(reading.picture, request.path_params["stage"]), media_type="image/jpeg"
        )

    async def _report(self, request: Request) -> Response:
        reading = self.readings.get(request.path_params["key"])
        return _download(await run_in_threadpool(reading.report), "report.zip")


def make_app(door: Door, live: LiveFeed | None = None) -> Any:
    """The ASGI application behind its guard; ``live``: the run of the live part.

    Raises:
        MissingLibraryError: the extra is not installed.
    """
    studio = Studio(live)

    @asynccontextmanager
    async def lifespan(app: Any) -> AsyncIterator[None]:
        yield
        studio.builds.close()
        studio.readings.close()

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


async def _design(request: Request) -> Response:
    asked = await _asked(request)
    return JSONResponse(await run_in_threadpool(designs.design_document, asked.get("fields"), Look.of(asked)))


async def _remedy(request: Request) -> Response:
    asked = await _asked(request)
    subject = str(asked.get("subject", ""))
    return JSONResponse(
        await run_in_threadpool(designs.remedy_of, asked.get("fields"), subject, Look.of(asked))
    )


async def _size(request: Request) -> Response:
    from cmpdesign.proposal.camera_design import size

    asked = await _asked(request)
    make, error = asked.get("make") or None, str(asked.get("error") or "") or None
    view = str(asked.get("view", ""))
    proposal = await run_in_threadpool(size, str(asked.get("camera", "")), view, error, make=make)
    found = {"fields": designs.fields_of(proposal.design), "figures": proposal.figures()}
    return JSONResponse(found)


async def _toml(request: Request) -> Response:
    text = (await _body(request, MOST_TEXT_BYTES)).decode("utf-8", "replace")
    return JSONResponse({"fields": await run_in_threadpool(designs.read_design_toml, text)})


async def _seen(request: Request) -> Response:
    """The pad as the camera sees it: the picture of ``render``, as PNG."""
    asked = await _asked(request)
    picture = await run_in_threadpool(pictures.seen_picture, asked.get("fields"), Look.of(asked))
    return Response(picture, media_type=_KINDS[".png"])


async def _laser(request: Request) -> Response:
    asked = await _asked(request)
    return JSONResponse(await run_in_threadpool(pictures.laser_document, asked.get("fields")))


async def _camera(socket: WebSocket) -> None:
    """Frames of the browser's camera, read with the layout of a design; one frame is under way."""
    await socket.accept()
    with suppress(WebSocketDisconnect):
        try:
            fields = parse_json(socket.query_params.get("fields", "{}"), "the design")
            layout = designs.design_of(fields).layout.reference()
            reader = await run_in_threadpool(CameraReader, layout)
        except (CmpDesignError, ExtractorError) as error:
            await socket.send_json({"over": str(error)})
            return
        await socket.send_json(hello_document(layout, "the camera of this browser"))
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            if message.get("bytes") is None:
                reader.reset_rest()
            else:
                await socket.send_json(await run_in_threadpool(reader.read, message["bytes"]))


async def _asked(request: Request) -> dict[str, Any]:
    """The JSON object of a request."""
    document = parse_json((await _body(request, MOST_TEXT_BYTES)).decode("utf-8", "replace"), "the request")
    if not isinstance(document, dict):
        raise _Refused(422, "the request is no JSON object")
    return document


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
