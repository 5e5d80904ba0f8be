"""The stream: live pictures of a scene over a WebSocket."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import ClientConnection, connect

from .client import Client, Document, SpaoError, _error, _quote

_RECONNECTS = 5
"""Tries to come back after a line broke, a second apart."""


def merge_patch(document: Any, patch: Any) -> Any:
    """The document after a JSON Merge Patch (RFC 7396); both stay what they are."""
    if not isinstance(patch, dict):
        return patch
    merged = dict(document) if isinstance(document, dict) else {}
    for name, value in patch.items():
        if value is None:
            merged.pop(name, None)
        else:
            merged[name] = merge_patch(merged.get(name), value)
    return merged


@dataclass(frozen=True)
class Frame:
    """A picture: what the server tells about it, and the bytes of the image file."""

    header: Document
    image: bytes

    @property
    def seq(self) -> int:
        """The last update that the picture shows."""
        return int(self.header["seq"])

    @property
    def final(self) -> bool:
        """Whether it is the full-size, lossless picture that follows when nothing moves any more."""
        return bool(self.header["phase"] == "final")

    @property
    def exact(self) -> bool:
        """Whether it is full-size, lossless, and has the ambient occlusion that the scene asks for."""
        return bool(self.header["exact"])

    @property
    def encoding(self) -> str:
        """`png`, `jpeg` or `webp`."""
        return str(self.header["encoding"])


class Stream:
    """A connection to a scene; to be used in a `with` statement, by one thread.

    A picture counts as shown, and makes room for the next, when the one after it is asked for. A line that breaks is
    taken up again with the same view.

    - `scene`: the scene as it is now, changes by others included
    - `view`: the camera and size of this connection, as the server told them in the beginning
    - `progress`: share of the ambient occlusion that is computed, 0 to 1
    """

    def __init__(
        self,
        client: Client,
        scene: str = "default",
        *,
        width: int | None = None,
        height: int | None = None,
        encodings: Sequence[str] = ("jpeg", "png"),
        max_in_flight: int = 2,
    ) -> None:
        self.scene: Document = {}
        self.view: Document = {}
        self.progress = 1.0
        self.seq = 0
        self._client = client
        self._url = f"ws{client.url.removeprefix('http')}/v1/scenes/{_quote(scene)}/stream"
        self._hello: Document = {
            "type": "hello",
            "protocol": 1,
            "encodings": list(encodings),
            "max_in_flight": max_in_flight,
            "width": width,
            "height": height,
            "resume": None,
        }
        self._socket: ClientConnection | None = None
        self._open_socket = ExitStack()
        self._shown: int | None = None
        self._own_view: Document = {}
        self._goodbye: str | None = None

    def __enter__(self) -> Stream:
        self._connect()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection."""
        self._socket = None
        self._open_socket.close()

    def update(self, *, scene: Document | None = None, view: Document | None = None) -> int:
        """Changes the scene for everybody, this connection's view, or both; the update's number.

        What the server refuses is raised as [`SpaoError`] by the call that meets its answer.
        """
        self.seq += 1
        message: Document = {"type": "update", "seq": self.seq}
        if scene is not None:
            message["scene"] = scene
        if view is not None:
            message["view"] = view
            self._own_view = _said(self._own_view, view)
        self._send(message)
        return self.seq

    def visibility(self, visible: bool) -> None:
        """Pauses and resumes the pictures."""
        self._send({"type": "visibility", "visible": visible})

    def refresh(self) -> None:
        """Asks for a picture though nothing has changed."""
        self._send({"type": "refresh"})

    def frames(self, timeout: float | None = None) -> Iterator[Frame]:
        """Pictures as they come, until the server says goodbye; waits at most `timeout` seconds for each."""
        while (frame := self.next_frame(timeout)) is not None:
            yield frame

    def wait_final(self, timeout: float = 120) -> Frame:
        """The final picture of everything said so far; moving ones are passed over."""
        deadline = time.monotonic() + timeout
        while (frame := self.next_frame(max(deadline - time.monotonic(), 0))) is not None:
            if frame.final and frame.exact and frame.seq >= self.seq:
                return frame
        raise ConnectionError(f"the server said goodbye: {self._goodbye}")

    def next_frame(self, timeout: float | None = None) -> Frame | None:
        """The next picture; None when the server has said goodbye.

        Raises `TimeoutError`, or [`SpaoError`] for an update that was refused.
        """
        if self._shown is not None:
            shown, self._shown = self._shown, None
            self._send({"type": "ack", "frame": shown})
        deadline = None if timeout is None else time.monotonic() + timeout
        while self._goodbye is None:
            left = None if deadline is None else max(deadline - time.monotonic(), 0)
            try:
                frame = self._receive(left)
            except ConnectionClosed:
                if self._goodbye is None:
                    self._reconnect()
                continue
            if frame is not None:
                self._shown = int(frame.header["frame"])
                return frame
        return None

    def _receive(self, timeout: float | None) -> Frame | None:
        socket = self._open()
        message = _text(socket.recv(timeout))
        kind = message.get("type")
        if kind == "frame":
            # The picture is on its way behind its header.
            image = socket.recv(self._client.timeout)
            if isinstance(image, str):
                raise ConnectionError("expected a picture, got a text")
            return Frame(message, image)
        if kind == "scene":
            self.scene = merge_patch(self.scene, message["patch"])
            self.scene["revision"] = message["revision"]
        elif kind == "progress":
            self.progress = float(message["fraction"])
        elif kind == "error":
            raise SpaoError(message)
        elif kind == "goodbye":
            self._goodbye = str(message["reason"])
        return None

    def _open(self) -> ClientConnection:
        if self._socket is None:
            raise ConnectionError("the stream is not open: use it in a `with` statement")
        return self._socket

    def _send(self, message: Document) -> None:
        try:
            self._open().send(json.dumps(message))
        except ConnectionClosed:
            # Whoever waits for a picture next comes back, or learns why not.
            return

    def _connect(self) -> None:
        key = self._client.api_key
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        try:
            connection = connect(
                self._url,
                additional_headers=headers,
                compression=None,
                max_size=None,
                open_timeout=self._client.timeout,
            )
            socket = self._open_socket.enter_context(connection)
        except InvalidStatus as refused:
            raise _error(bytes(refused.response.body or b""), refused.response.status_code) from None
        self._socket = socket
        socket.send(json.dumps(self._hello))
        welcome = _text(socket.recv(self._client.timeout))
        if welcome.get("type") != "welcome":
            self.close()
            raise SpaoError(welcome)
        self.scene, self.view = welcome["scene"], welcome["view"]
        self._hello["resume"] = welcome["resume_token"]
        self._shown = None

    def _reconnect(self) -> None:
        self.close()
        for left in reversed(range(_RECONNECTS)):
            try:
                self._connect()
                break
            except (OSError, ConnectionClosed):
                if left == 0:
                    raise
                time.sleep(1)
        if self.seq > 0:
            # Updates may have been lost with the line. The view is said again; the scene may be others' by now.
            self._send({"type": "update", "seq": self.seq, "view": self._own_view})


def _said(before: Document, view: Document) -> Document:
    """Two view patches as one. A null is kept: it goes back to the scene's camera."""
    cameras = [part.get("camera") for part in (before, view)]
    both = {**before, **view}
    if isinstance(cameras[0], dict) and isinstance(cameras[1], dict):
        both["camera"] = {**cameras[0], **cameras[1]}
    return both


def _text(message: str | bytes) -> Document:
    if isinstance(message, bytes):
        raise ConnectionError("a picture came without its header")
    document = json.loads(message)
    if not isinstance(document, dict):
        raise ConnectionError("expected a JSON object")
    return document
