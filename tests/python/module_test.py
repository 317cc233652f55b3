"""The Python module against the program: the same bytes, arrays in and out, failures by class, Ctrl-C."""

import os
import signal
import subprocess
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np

import tessera

PROGRAM = os.environ["TESSERA_PROGRAM"]


def run(*words):
    subprocess.run([PROGRAM, *map(str, words)], check=True, capture_output=True)


def sheet(side=80):
    x, y = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float))
    vertices = np.column_stack([x.ravel(), y.ravel(), np.sin(0.2 * x.ravel())])
    v = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).ravel()
    return vertices, np.vstack([np.column_stack([v, v + 1, v + side + 1]), np.column_stack([v, v + side + 1, v + side])])


def cube():
    corners = np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)], dtype=float)
    return corners, np.array([[0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6], [0, 1, 5], [0, 5, 4],
                              [2, 6, 7], [2, 7, 3], [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5]])


class Module(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.addCleanup(self._folder.cleanup)
        self.folder = Path(self._folder.name)

    def test_meshes_come_back_as_they_were_written(self):
        vertices, faces = sheet(20)
        for dtype in (np.int32, np.uint32, np.int64, np.uint64):
            tessera.write_mesh(self.folder / "m.ply", vertices, faces.astype(dtype))
            v, f = tessera.read_mesh(self.folder / "m.ply")
            np.testing.assert_array_equal(v, vertices)
            np.testing.assert_array_equal(f, faces)
            self.assertEqual((v.dtype, f.dtype), (np.float64, np.uint64))
        rgba = np.random.default_rng(1).integers(0, 256, (len(vertices), 4), dtype=np.uint8)
        rgba[:, 3] = 255
        tessera.write_mesh(self.folder / "c.ply", vertices, faces, rgba=rgba)
        np.testing.assert_array_equal(tessera.read_mesh(self.folder / "c.ply", colours=True)[2], rgba)
        for chunk in (1, 7, 400, 10**6):
            parts = list(tessera.read_mesh_vertices(self.folder / "m.ply", chunk))
            self.assertTrue(all(len(p) == chunk for p in parts[:-1]))
            np.testing.assert_array_equal(np.concatenate(parts), vertices)
            np.testing.assert_array_equal(np.concatenate(list(tessera.read_mesh_faces(self.folder / "m.ply", chunk))), faces)

    def test_arrays_are_not_copied_twice(self):
        vertices, faces = sheet(20)
        tessera.write_mesh(self.folder / "m.ply", vertices, faces)
        v, f = tessera.read_mesh(self.folder / "m.ply")
        self.assertIsNotNone(v.base)  # the reader's own memory
        self.assertIsNotNone(f.base)

    def test_points_in_chunks_of_any_size(self):
        run("synth", "--scene", "sphere", "--points", "3000", "--normals", "--colour", "-o", self.folder / "s.ply")
        whole = list(tessera.read_points(self.folder / "s.ply", 10**6))
        self.assertEqual(len(whole), 1)
        self.assertEqual(whole[0]["position"].shape, (len(whole[0]["normal"]), 3))
        self.assertEqual(whole[0]["rgba"].dtype, np.uint8)
        for chunk in (1, 999, 1000):
            parts = list(tessera.read_points([self.folder / "s.ply"], chunk))
            self.assertTrue(all(len(p["position"]) == chunk for p in parts[:-1]))
            np.testing.assert_array_equal(np.concatenate([p["position"] for p in parts]), whole[0]["position"])
        first = next(iter(tessera.read_points(self.folder / "s.ply", 10)))  # left early
        self.assertEqual(len(first["position"]), 10)

    def test_jobs_have_the_bytes_of_the_program(self):
        vertices, faces = sheet()
        tessera.write_mesh(self.folder / "in.ply", vertices, faces)
        for job, options in (("decimate", {"tolerance": 0.05}), ("remesh", {"edge": 1.5}), ("smooth", {"steps": 2})):
            with self.subTest(job):
                flags = [w for k, v in options.items() for w in (f"--{k}", v)]
                run(job, self.folder / "in.ply", "-o", self.folder / f"{job}.ply", *flags)
                report = tessera.run(job, self.folder / "in.ply", self.folder / "called.ply", force=True, **options)
                self.assertEqual((self.folder / f"{job}.ply").read_bytes(), (self.folder / "called.ply").read_bytes())
                v, f, of_arrays = getattr(tessera, job)(vertices, faces, **options)
                want_v, want_f = tessera.read_mesh(self.folder / f"{job}.ply")
                np.testing.assert_array_equal(v, want_v)
                np.testing.assert_array_equal(f, want_f)
                self.assertEqual(report["mesh"]["faces"], of_arrays["mesh"]["faces"])

    def test_jobs_on_arrays_read_them_in_place(self):
        vertices, faces = sheet(40)
        found = []
        look = lambda _: found.extend(p for p in self.folder.rglob("*") if p.suffix == ".ply" or p.name == "given")
        want = tessera.decimate(vertices, faces, tolerance=0.05, temp=self.folder, progress=look)
        self.assertEqual(found, [])
        self.assertEqual(list(self.folder.iterdir()), [])
        for dtype in (np.int32, np.uint32, np.uint64, np.int16):
            made = tessera.decimate(np.asfortranarray(vertices), faces.astype(dtype), tolerance=0.05, temp=self.folder)
            np.testing.assert_array_equal(made[0], want[0])
            np.testing.assert_array_equal(made[1], want[1])
        with self.assertRaises(tessera.InputError):
            tessera.smooth(vertices, faces - 1)
        with self.assertRaises(tessera.UsageError):
            tessera.remesh(vertices, faces.astype(float), edge=1.5)
        with self.assertRaises(tessera.UsageError):
            tessera.decimate(vertices, faces, tolerance=0.05, texture=0.1)

    def test_jobs_of_two_threads_stop_one_by_one(self):
        vertices, faces = sheet(40)
        want = tessera.decimate(vertices, faces, tolerance=0.05)
        made, begun, cut = [], threading.Event(), threading.Event()

        def note(_):
            begun.set()
            cut.wait(60)

        whole = threading.Thread(target=lambda: made.append(tessera.decimate(vertices, faces, tolerance=0.05, progress=note)))
        whole.start()
        self.assertTrue(begun.wait(60))
        with self.assertRaises(ZeroDivisionError):
            tessera.decimate(vertices, faces, tolerance=0.05, progress=lambda n: 1 / 0)
        cut.set()
        whole.join()
        np.testing.assert_array_equal(made[0][1], want[1])

    def test_progress_and_its_exceptions(self):
        vertices, faces = sheet(40)
        news = []
        tessera.decimate(vertices, faces, tolerance=0.05, progress=news.append)
        self.assertTrue(any(n["stage_done"] for n in news))
        with self.assertRaises(ZeroDivisionError):
            tessera.decimate(vertices, faces, tolerance=0.05, progress=lambda n: 1 / 0)
        tessera.decimate(vertices, faces, tolerance=0.05)  # the wish to stop is gone

    def test_keyboard_interrupt_stops_and_the_same_call_goes_on(self):
        run("synth", "--scene", "sphere", "--points", "2M", "-o", self.folder / "s.ply")
        signal.signal(signal.SIGINT, signal.default_int_handler)  # what a shell starts in the background has none
        threading.Timer(0.5, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            tessera.reconstruct(self.folder / "s.ply", self.folder / "m.ply", threads=1)
            self.fail("it was done before")
        self.assertLess(time.monotonic() - start, 20)
        self.assertTrue((self.folder / "m.ply.tessera").exists())
        report = tessera.reconstruct(self.folder / "s.ply", self.folder / "m.ply", threads=1)
        self.assertGreater(report["mesh"]["faces"], 1000)

    def test_failures_are_classes_with_exit_codes(self):
        with self.assertRaises(tessera.InputError) as caught:
            tessera.read_mesh(self.folder / "none.ply")
        self.assertEqual(caught.exception.code, 3)
        self.assertIsInstance(caught.exception, tessera.Error)
        with self.assertRaises(tessera.InputError):
            next(tessera.read_points(self.folder / "none.las"))
        with self.assertRaises(tessera.UsageError):
            tessera.decimate(*sheet(5), tolerence=1)
        with self.assertRaises(tessera.UsageError):
            tessera.write_mesh(self.folder / "x.ply", np.zeros((3, 2)), np.zeros((1, 3), int))
        with self.assertRaises(tessera.InputError):
            tessera.write_mesh(self.folder / "x.ply", np.zeros((3, 3)), np.array([[0, 1, -1]]))
        with self.assertRaises(tessera.InputError):
            tessera.command("info", self.folder / "none.las")
        self.assertIn("tessera", tessera.command("doctor", temp=self.folder))

    def test_queries(self):
        vertices, faces = cube()
        points = np.array([[0.5, 0.5, 0.5], [0.5, 0.5, 3.0], [-1.0, 0.25, 0.25]])
        np.testing.assert_allclose(tessera.winding_number(vertices, faces, points), [1, 0, 0], atol=5e-3)
        feet, face, distance = tessera.closest_points(vertices, faces, points)
        np.testing.assert_allclose(distance, [0.5, 2.0, 1.0])
        np.testing.assert_allclose(feet[1:], [[0.5, 0.5, 1.0], [0.0, 0.25, 0.25]])
        self.assertTrue((face < 12).all())
        v, f, report = tessera.fill_holes(vertices, faces[:-2])
        self.assertEqual((report["loops"], report["filled"]), (1, 1))
        self.assertGreaterEqual(len(f), 12)
        np.testing.assert_array_equal(v[:8], vertices)
        tessera.write_mesh(self.folder / "closed.ply", v, f)
        self.assertEqual(tessera.check(self.folder / "closed.ply")["boundary_edges"], 0)
        tessera.write_mesh(self.folder / "cube.ply", vertices, faces)
        against = tessera.check(self.folder / "closed.ply", reference=self.folder / "cube.ply", tolerance=0.5)
        self.assertEqual(against["deviation"]["complaint"], "")

    def test_an_old_processor_is_told(self):
        for flags, lacking in (("sse4_2 avx2 bmi2 fma", ""), ("sse4_2 avx2", "FMA, BMI2"), ("sse4_2", "AVX2, FMA, BMI2")):
            (self.folder / "cpuinfo").write_text(f"processor\t: 0\nflags\t\t: fpu {flags}\n")
            if not lacking:
                tessera._require_processor(self.folder / "cpuinfo")
                continue
            with self.assertRaisesRegex(ImportError, f"lacks {lacking},"):
                tessera._require_processor(self.folder / "cpuinfo")

    def test_everything_public_says_what_it_does(self):
        for name in tessera.__all__:
            self.assertTrue(getattr(tessera, name).__doc__, name)


if __name__ == "__main__":
    unittest.main()
