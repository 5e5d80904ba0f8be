"""Saves pictures from all around a scene."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from .client import Client, Document


def turned(camera: Document, degrees: float) -> Document:
    """The camera after a turn about its target, around the world's z axis."""
    eye, target = camera["eye"], camera["target"]
    x, y = eye[0] - target[0], eye[1] - target[1]
    cos, sin = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return {"eye": [target[0] + cos * x - sin * y, target[1] + sin * x + cos * y, eye[2]]}


def main(arguments: Sequence[str] | None = None) -> None:
    """`spao-orbit --frames 36 --out orbit/`"""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="the server (default: %(default)s)")
    parser.add_argument("--scene", default="default", help="id of the scene (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=36, help="pictures of a whole turn (default: %(default)s)")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--out", type=Path, default=Path("."), help="folder of the pictures (default: here)")
    args = parser.parse_args(arguments)
    args.out.mkdir(parents=True, exist_ok=True)
    with Client(args.url).scene(args.scene).stream(width=args.width, height=args.height) as stream:
        camera = stream.view["camera"]
        for index in range(args.frames):
            stream.update(view={"camera": turned(camera, 360 * index / args.frames)})
            path = args.out / f"orbit_{index:03}.png"
            path.write_bytes(stream.wait_final().image)
            print(path)


if __name__ == "__main__":
    main()
