"""Measures a running server: pictures a second, and the time from an input to the picture that shows it.

`--clients` connections orbit for `--seconds`, each in a process of its own, with an input every 16 ms; the i-th watches
scene i modulo the number of `--scene` options. An input's time ends when the whole picture has arrived. What the server
did for that picture is in its header; `waiting` is the rest: the input waited for the picture before, and the line.
"""

from __future__ import annotations

import argparse
import multiprocessing
import statistics
import time
from dataclasses import dataclass

from spao_client import Client, Frame
from spao_client.orbit import turned

STAGES = ("queue", "ao", "raycast", "readback", "encode")


@dataclass(frozen=True)
class Sample:
    """One moving picture: milliseconds by stage, and its size."""

    total: float
    stages: tuple[float, ...]
    size: tuple[int, int]
    bytes: int


def watch(url: str, scene: str, width: int, height: int, encoding: str, seconds: float) -> list[Sample]:
    """Orbits for a while."""
    samples: list[Sample] = []
    sent: dict[int, float] = {}
    with Client(url).scene(scene).stream(width=width, height=height, encodings=[encoding]) as stream:
        camera = stream.view["camera"]
        stream.wait_final()
        begin = time.monotonic()
        due = begin
        while (now := time.monotonic()) < begin + seconds:
            if now >= due:
                sent[stream.update(view={"camera": turned(camera, (now - begin) * 60)})] = now
                due += 0.016
            try:
                frame = stream.next_frame(timeout=max(due - time.monotonic(), 0))
            except TimeoutError:
                continue
            if frame is not None and frame.seq in sent and not frame.final:
                samples.append(sample(frame, time.monotonic() - sent[frame.seq]))
    return samples


def sample(frame: Frame, seconds: float) -> Sample:
    """What one picture tells."""
    header = frame.header
    stages = tuple(float(header["timings_ms"][stage]) for stage in STAGES)
    return Sample(seconds * 1000, stages, (header["width"], header["height"]), len(frame.image))


def percentile(values: list[float], share: float) -> float:
    """The value that so many are not above."""
    ordered = sorted(values)
    return ordered[min(int(share * len(ordered)), len(ordered) - 1)]


def report(name: str, samples: list[Sample], seconds: float) -> None:
    """One row for each stage."""
    if not samples:
        print(f"{name}: no pictures")
        return
    sizes = statistics.mode(s.size for s in samples)
    kilobytes = statistics.mean(s.bytes for s in samples) / 1000
    print(f"{name}: {len(samples) / seconds:.1f} pictures/s, mostly {sizes[0]}x{sizes[1]}, {kilobytes:.1f} kB each")
    rows = {"input to picture": [s.total for s in samples]}
    rows |= {stage: [s.stages[i] for s in samples] for i, stage in enumerate(STAGES)}
    rows["waiting"] = [s.total - sum(s.stages) for s in samples]
    for row, values in rows.items():
        print(f"  {row:17} p50 {percentile(values, 0.5):7.1f} ms   p95 {percentile(values, 0.95):7.1f} ms")


def main() -> None:
    """`python bench_stream.py --clients 4 --scene default --scene s_1`"""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--url", default="http://127.0.0.1:8080")
    parser.add_argument("--scene", action="append", help="id of a scene; may be given several times")
    parser.add_argument("--clients", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=10)
    parser.add_argument("--width", type=int, default=640)
    parser.add_argument("--height", type=int, default=480)
    parser.add_argument("--encoding", default="jpeg")
    args = parser.parse_args()
    scenes = args.scene or ["default"]
    jobs = [
        (args.url, scenes[i % len(scenes)], args.width, args.height, args.encoding, args.seconds)
        for i in range(args.clients)
    ]
    for scene in scenes:
        # Its ambient occlusion is not what is measured.
        Client(args.url).scene(scene).frame(16, 16)
    with multiprocessing.Pool(args.clients) as pool:
        results = pool.starmap(watch, jobs)
    for (_, scene, *_), samples in zip(jobs, results):
        report(f"scene {scene}", samples, args.seconds)
    if len(jobs) > 1:
        report("all", [sample for samples in results for sample in samples], args.seconds)


if __name__ == "__main__":
    main()
