"""The client against a running server, whose address is in `SPAO_URL` and whose key in `SPAO_API_KEY`."""

from __future__ import annotations

import json
import os
import struct
import tempfile
import unittest
from pathlib import Path

from spao_client import Client, SpaoError, merge_patch
from spao_client.orbit import main as orbit, turned

NRRD = b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n\n" + bytes(range(24))


def png_size(image: bytes) -> tuple[int, int]:
    """Width and height in a PNG's header."""
    assert image.startswith(b"\x89PNG"), image[:8]
    width, height = struct.unpack(">II", image[16:24])
    return width, height


class TestRest(unittest.TestCase):
    def setUp(self) -> None:
        self.server = Client(os.environ["SPAO_URL"])

    def test_volumes_come_and_go(self) -> None:
        volume = self.server.upload(NRRD, name="numbers")
        self.assertEqual((volume["name"], volume["dims"]), ("numbers", [2, 3, 4]))
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "small.nrrd")
            path.write_bytes(NRRD)
            self.assertEqual(self.server.upload(path)["name"], "small")
        boxes = self.server.procedural("boxes", [5, 6, 7], seed=3, name="b")
        self.assertIn(boxes["id"], [volume["id"] for volume in self.server.volumes()])
        self.server.delete_volume(boxes["id"])
        with self.assertRaises(SpaoError) as refused:
            self.server.create_scene(boxes["id"])
        self.assertEqual((refused.exception.code, refused.exception.status), ("volume_not_found", 404))
        self.assertEqual(refused.exception.details["path"], "volume")

    def test_scenes_are_changed_drawn_and_deleted(self) -> None:
        volume = self.server.procedural("gyroid", [12, 10, 8])
        scene = self.server.create_scene(volume["id"], lighting={"ambient": 0.4})
        self.assertIn(scene.id, [other.id for other in self.server.scenes()])
        self.assertEqual(scene.patch(rendering={"background": "#ff0000"})["revision"], 2)
        self.assertEqual(png_size(scene.frame(40, 30)), (40, 30))
        self.assertTrue(scene.frame(8, 8, format="jpeg").startswith(b"\xff\xd8"))
        self.assertEqual(scene.undo()["rendering"]["background"], "#000000")
        self.assertEqual(scene.redo()["rendering"]["background"], "#ff0000")
        self.assertTrue(scene.ao().startswith(b"\x93NUMPY"))
        document = {name: value for name, value in scene.document().items() if name not in ("id", "revision")}
        self.assertEqual(self.server.render(document, 40, 30), scene.frame(40, 30))
        with self.assertRaises(SpaoError) as refused:
            scene.patch(camera={"fov_y_deg": 0})
        self.assertEqual(refused.exception.details["path"], "camera.fov_y_deg")
        scene.delete()
        with self.assertRaises(SpaoError):
            scene.document()

    def test_a_wrong_key_is_refused(self) -> None:
        stranger = Client(self.server.url, api_key="not-this-key")
        for ask in (stranger.server, stranger.scene().stream().__enter__):
            with self.assertRaises(SpaoError) as refused:
                ask()
            self.assertEqual((refused.exception.code, refused.exception.status), ("unauthorized", 401))


class TestStream(unittest.TestCase):
    def setUp(self) -> None:
        self.server = Client(os.environ["SPAO_URL"])
        volume = self.server.procedural("gyroid", [16, 16, 16])
        self.scene = self.server.create_scene(volume["id"])

    def test_pictures_follow_updates(self) -> None:
        with self.scene.stream(width=48, height=32) as stream:
            first = stream.wait_final()
            self.assertEqual(first.image, self.scene.frame(48, 32))
            seq = stream.update(scene={"lighting": {"ambient": 0.1}})
            frames = []
            for frame in stream.frames(timeout=60):
                frames.append(frame)
                if frame.final:
                    break
            self.assertEqual((frames[-1].seq, frames[-1].encoding), (seq, "png"))
            self.assertEqual(frames[0].encoding, "jpeg")
            self.assertEqual(png_size(frames[-1].image), (48, 32))
            self.assertEqual(frames[-1].image, self.scene.frame(48, 32))
            self.assertNotEqual(frames[-1].image, first.image)

    def test_changes_by_others_arrive(self) -> None:
        with self.scene.stream(width=48, height=32) as stream:
            stream.wait_final()
            changed = self.scene.patch(lighting={"diffuse": 0.2})
            stream.wait_final()
            self.assertEqual(stream.scene, changed)

    def test_a_refused_update_is_raised_and_the_stream_goes_on(self) -> None:
        with self.scene.stream(width=48, height=32) as stream:
            seq = stream.update(scene={"camera": {"fov_y_deg": 0}})
            with self.assertRaises(SpaoError) as refused:
                for _ in stream.frames(timeout=60):
                    pass
            self.assertEqual((refused.exception.seq, refused.exception.code), (seq, "invalid"))
            stream.update(view={"width": 20})
            self.assertEqual(png_size(stream.wait_final().image), (20, 32))

    def test_a_broken_line_is_taken_up_again(self) -> None:
        with self.scene.stream(width=48, height=32) as stream:
            view = turned(stream.view["camera"], 40)
            stream.update(view={"camera": view})
            before = stream.wait_final()
            socket = stream._open().socket
            socket.shutdown(2)
            # Lost with the line.
            stream.update(view={"width": 60})
            after = stream.wait_final()
            self.assertEqual(stream.view["camera"]["eye"], view["eye"])
            self.assertEqual((png_size(before.image), png_size(after.image)), ((48, 32), (60, 32)))

    def test_the_end_of_the_scene_ends_the_pictures(self) -> None:
        with self.scene.stream(width=48, height=32) as stream:
            self.scene.delete()
            for _ in stream.frames(timeout=60):
                pass
            with self.assertRaises(ConnectionError):
                stream.wait_final()

    def test_orbit_saves_pictures(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            orbit(["--url", self.server.url, "--scene", self.scene.id, "--frames", "3", "--width", "40", "--height", "30", "--out", folder])
            images = [path.read_bytes() for path in sorted(Path(folder).iterdir())]
        self.assertEqual([png_size(image) for image in images], [(40, 30)] * 3)
        self.assertEqual(len(set(images)), 3)


class TestMergePatch(unittest.TestCase):
    def test_it_merges_as_the_rfc_says(self) -> None:
        document = {"a": {"b": 1, "c": [1]}, "d": 2}
        merged = merge_patch(document, {"a": {"b": None, "e": {"f": None, "g": 1}}, "d": [None]})
        self.assertEqual(merged, {"a": {"c": [1], "e": {"g": 1}}, "d": [None]})
        self.assertEqual(json.dumps(document), '{"a": {"b": 1, "c": [1]}, "d": 2}')


if __name__ == "__main__":
    unittest.main()
