"""What loading a volume costs those who look at another: a stream's pictures a second, and its longest gap, before and
while a file is loaded.

The stream orbits `--scene` with an input every 16 ms. Half-way the file is loaded from the server's data directory
(`--path`) or sent (`--file`), and counted until it is there; it is deleted afterwards.
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import threading
import time
from pathlib import Path

from spao_client import Client
from spao_client.orbit import turned


def load(client: Client, args: argparse.Namespace, times: list[float]) -> None:
    """Loads once, noting when it began and ended."""
    times.append(time.monotonic())
    volume = client.open(args.path) if args.path else client.upload(args.file)
    times.append(time.monotonic())
    client.delete_volume(volume["id"])


def watch(args: argparse.Namespace) -> tuple[list[float], list[float]]:
    """Times of pictures, and when the load began and ended."""
    arrivals: list[float] = []
    loading: list[float] = []
    loader = threading.Thread(target=load, args=(Client(args.url, timeout=600), args, loading))
    with Client(args.url).scene(args.scene).stream(width=args.width, height=args.height) as stream:
        camera = stream.view["camera"]
        stream.wait_final()
        begin = due = time.monotonic()
        while len(loading) < 2:
            now = time.monotonic()
            if now > begin + args.seconds and loader.ident is None:
                loader.start()
            if loader.ident is not None and not loader.is_alive() and len(loading) < 2:
                raise SystemExit("the load failed")
            if now >= due:
                stream.update(view={"camera": turned(camera, (now - begin) * 60)})
                due = now + 0.016
            try:
                if stream.next_frame(timeout=max(due - time.monotonic(), 0)) is not None:
                    arrivals.append(time.monotonic())
            except TimeoutError:
                continue
    loader.join()
    return arrivals, loading


def main() -> None:
    """Prints one row before and one during the load, and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--url", default="http://127.0.0.1:8080", help="the server (default: %(default)s)")
    parser.add_argument("--scene", default="default", help="the scene that is looked at (default: %(default)s)")
    source = parser.add_mutually_exclusive_group(required=True)
    source.add_argument("--path", help="a file in the server's data directory")
    source.add_argument("--file", type=Path, help="a file to send")
    parser.add_argument("--seconds", type=float, default=10, help="before the load (default: %(default)s)")
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    args = parser.parse_args()
    arrivals, (begin, end) = watch(args)
    rates = []
    for name, first, last in (("before", begin - args.seconds, begin), ("during", begin, end)):
        inside = [t for t in arrivals if first <= t <= last]
        gaps = [b - a for a, b in itertools.pairwise([first, *inside, last])]
        rates.append(len(inside) / (last - first))
        middle = statistics.median(gaps)
        print(f"{name}: {last - first:5.1f} s, {rates[-1]:5.1f} pictures/s, gap p50 {middle:.3f} s, longest {max(gaps):.3f} s")
    print(f"during / before: {rates[1] / rates[0]:.2f}")


if __name__ == "__main__":
    main()
