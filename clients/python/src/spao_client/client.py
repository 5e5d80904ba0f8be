"""The REST interface: volumes and scenes."""

from __future__ import annotations

import io
import json
import os
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .stream import Stream

Document = dict[str, Any]
"""A JSON object: a scene, a volume, or a part of one."""

_JSON = {"Content-Type": "application/json"}


class SpaoError(Exception):
    """What the server refused, and why.

    `code` is for programs (`volume_not_found`, `invalid`, ...), `details` may name the field as `path`; `status` is
    that of HTTP, 0 for errors of a stream; `seq` is the update of a stream that was refused.
    """

    def __init__(self, error: Mapping[str, Any], status: int = 0) -> None:
        self.status = status
        self.code = str(error.get("code", ""))
        self.message = str(error.get("message", ""))
        self.details: Document = dict(error.get("details") or {})
        seq = error.get("seq")
        self.seq = seq if isinstance(seq, int) else None
        super().__init__(f"{self.code}: {self.message}")


class Client:
    """A server.

    `api_key` defaults to the environment's `SPAO_API_KEY`; `timeout` is in seconds, for each request.
    """

    def __init__(
        self, url: str = "http://127.0.0.1:8080", *, api_key: str | None = None, timeout: float = 120
    ) -> None:
        self.url = url.rstrip("/")
        self.api_key = api_key if api_key is not None else os.environ.get("SPAO_API_KEY")
        self.timeout = timeout

    def server(self) -> Document:
        """Version, adapter, limits and memory."""
        return self._json("GET", "/v1/server")

    def volumes(self) -> list[Document]:
        """Every volume."""
        return list(self._json("GET", "/v1/volumes")["volumes"])

    def upload(self, data: bytes | os.PathLike[str] | str, *, name: str | None = None, format: str | None = None) -> Document:
        """Loads a volume from a file or its bytes; `format` is guessed where it is missing."""
        if not isinstance(data, bytes):
            name = name or os.path.splitext(os.path.basename(data))[0]
            with open(data, "rb") as file:
                data = file.read()
        query = _query({"name": name, "format": format})
        headers = {"Content-Type": "application/octet-stream"}
        return _object(self._request("POST", f"/v1/volumes{query}", data, headers))

    def procedural(
        self, kind: str, dims: Sequence[int], *, seed: int | None = None, name: str | None = None
    ) -> Document:
        """Makes a volume by rule: `gyroid`, `boxes`, ..."""
        source: Document = {"kind": kind, "dims": list(dims)}
        if seed is not None:
            source["seed"] = seed
        request: Document = {"source": {"procedural": source}}
        if name is not None:
            request["name"] = name
        return self._json("POST", "/v1/volumes", request)

    def open(self, path: str, *, name: str | None = None) -> Document:
        """Loads a file of the server's `--data-dir`."""
        request: Document = {"source": {"path": path}}
        if name is not None:
            request["name"] = name
        return self._json("POST", "/v1/volumes", request)

    def delete_volume(self, volume: str, *, force: bool = False) -> None:
        """Frees a volume; `force` even while scenes look at it."""
        self._request("DELETE", f"/v1/volumes/{_quote(volume)}{'?force=true' if force else ''}")

    def scenes(self) -> list[Scene]:
        """Every scene, the oldest first."""
        return [Scene(self, scene["id"]) for scene in self._json("GET", "/v1/scenes")["scenes"]]

    def scene(self, id: str = "default") -> Scene:
        """A scene that is there already."""
        return Scene(self, id)

    def create_scene(self, volume: str, **document: Any) -> Scene:
        """Makes a scene; what `document` leaves out gets a default that fits the volume."""
        return Scene(self, self._json("POST", "/v1/scenes", {"volume": volume, **document})["id"])

    def render(self, scene: Document, width: int, height: int, *, format: str = "png") -> bytes:
        """One exact picture of a scene that is not kept."""
        body = {"scene": scene, "width": width, "height": height, "format": format}
        return self._request("POST", "/v1/render", json.dumps(body).encode(), _JSON)

    def _json(self, method: str, path: str, body: Document | None = None) -> Document:
        if body is None:
            return _object(self._request(method, path))
        return _object(self._request(method, path, json.dumps(body).encode(), _JSON))

    def _request(
        self, method: str, path: str, body: bytes | None = None, headers: Mapping[str, str] | None = None
    ) -> bytes:
        request = urllib.request.Request(self.url + path, data=body, method=method, headers=dict(headers or {}))
        if self.api_key:
            request.add_header("Authorization", f"Bearer {self.api_key}")
        try:
            with urllib.request.urlopen(request, timeout=self.timeout) as answer:
                data: bytes = answer.read()
                return data
        except urllib.error.HTTPError as error:
            raise _error(error.read(), error.code) from None


class Scene:
    """One scene of a server."""

    def __init__(self, client: Client, id: str) -> None:
        self.client = client
        self.id = id
        self._path = f"/v1/scenes/{_quote(id)}"

    def document(self) -> Document:
        """The whole scene, with `revision`."""
        return self.client._json("GET", self._path)

    def patch(self, **changes: Any) -> Document:
        """Merges changes in, as in `scene.patch(lighting={"ambient": 0.3})`; the new document."""
        return self.client._json("PATCH", self._path, changes)

    def undo(self) -> Document:
        """One change back."""
        return self.client._json("POST", f"{self._path}/undo")

    def redo(self) -> Document:
        """One undo back."""
        return self.client._json("POST", f"{self._path}/redo")

    def delete(self) -> None:
        """Ends the scene, and its streams."""
        self.client._request("DELETE", self._path)

    def frame(self, width: int | None = None, height: int | None = None, *, format: str = "png") -> bytes:
        """One exact picture, as the bytes of an image file; the size is the scene's viewport where it is missing."""
        query = _query({"width": width, "height": height, "format": format})
        return self.client._request("GET", f"{self._path}/frame{query}")

    def ao(self, *, format: str = "npy") -> bytes:
        """The accessibility of every voxel, as the bytes of a `npy` or `nrrd` file."""
        return self.client._request("GET", f"{self._path}/ao{_query({'format': format})}")

    def ao_array(self) -> Any:
        """The accessibility of every voxel as a NumPy array, `[z, y, x]`; needs NumPy."""
        import numpy

        return numpy.load(io.BytesIO(self.ao()))

    def stream(self, **options: Any) -> Stream:
        """Live pictures; the options are those of [`Stream`]."""
        from .stream import Stream

        return Stream(self.client, self.id, **options)


def _object(data: bytes) -> Document:
    document = json.loads(data)
    if not isinstance(document, dict):
        raise TypeError("the server did not answer with a JSON object")
    return document


def _error(body: bytes, status: int) -> SpaoError:
    try:
        return SpaoError(json.loads(body)["error"], status)
    except (ValueError, KeyError, TypeError):
        return SpaoError({"code": "unknown", "message": body[:200].decode(errors="replace")}, status)


def _quote(id: str) -> str:
    return urllib.parse.quote(id, safe="")


def _query(values: Mapping[str, object]) -> str:
    given = {name: value for name, value in values.items() if value is not None}
    return "?" + urllib.parse.urlencode(given) if given else ""
