import gc
import unittest

import numpy as np

import support
import traceflow as tf


class Capture(support.WithRun):
    needs_run = False

    def test_synth_writes_the_bytes_of_the_program(self):
        tf.synth(self.folder / "own", **support.SYNTH)
        files = [f.relative_to(self.capture_folder) for f in self.capture_folder.rglob("*") if f.is_file()]
        self.assertGreater(len(files), 20)
        for file in files:
            self.assertEqual((self.folder / "own" / file).read_bytes(), (self.capture_folder / file).read_bytes(), file)

    def test_views_have_pixels(self):
        capture = tf.load_capture(self.capture_folder)
        self.assertEqual(len(capture.train), support.SYNTH["frames"])
        view = capture.test[0]
        shape = (support.SYNTH["height"], support.SYNTH["width"])
        for array, wanted, dtype in ((view.image, (*shape, 3), np.float32), (view.mask, shape, np.uint8),
                                     (view.coverage, shape, np.float32), (view.true_normal, (*shape, 3), np.float32),
                                     (view.true_depth, shape, np.float32)):
            self.assertEqual((array.shape, array.dtype), (wanted, dtype))
        steps = view.image * 255
        np.testing.assert_allclose(steps, np.round(steps), atol=1e-4)  # of 8 bits
        lengths = np.linalg.norm(capture.train[0].normal, axis=2)
        np.testing.assert_allclose(lengths[lengths > 0], 1, atol=1e-5)
        self.assertIsNone(view.known)
        self.assertEqual(view.camera.width, shape[1])
        self.assertEqual(capture.points.shape[1], 3)

    def test_true_depth_is_that_of_the_file(self):
        capture = tf.load_capture(self.capture_folder)
        view = capture.test[0]
        stored = np.load(next((self.capture_folder / "truth").rglob(f"depth/**/{view.name}.npy")))
        np.testing.assert_allclose(view.true_depth, stored * capture.scale, rtol=1e-6)

    def test_arrays_of_a_view_share_memory_and_outlive_the_capture(self):
        capture = tf.load_capture(self.capture_folder)
        view = capture.train[0]
        image = view.image
        self.assertTrue(np.shares_memory(image, view.image))
        with self.assertRaises(ValueError):
            image[0, 0, 0] = 1
        copy = image.copy()
        del capture, view
        gc.collect()
        np.testing.assert_array_equal(image, copy)

    def test_options_are_taken(self):
        capture = tf.load_capture(self.capture_folder, downscale=2)
        self.assertEqual(capture.train[0].image.shape, (support.SYNTH["height"] // 2, support.SYNTH["width"] // 2, 3))
        self.assertEqual(capture.options["downscale"], 2)

    def test_errors_have_the_text_of_the_program(self):
        with self.assertRaises(tf.InputError) as caught:
            tf.load_capture(self.folder / "nothing")
        self.assertEqual(str(caught.exception), support.error_of("inspect", "-d", self.folder / "nothing"))


class Camera(unittest.TestCase):
    def test_looks_at_a_target(self):
        camera = tf.Camera.look_at([1, 2, 3], [1, 5, 3], [0, 0, 1], 60, 40, fov_y=90)
        rotation = camera.camera_from_world
        np.testing.assert_allclose(rotation @ [0, 1, 0], [0, 0, 1], atol=1e-6)  # forward
        np.testing.assert_allclose(rotation @ [0, 0, 1], [0, -1, 0], atol=1e-6)  # up is −y
        self.assertAlmostEqual(camera.focal_y, 20, places=4)

    def test_is_checked(self):
        camera = tf.Camera(60, 40, 50)
        self.assertEqual((camera.centre_x, camera.centre_y, camera.focal_y), (30, 20, 50))
        with self.assertRaisesRegex(tf.InputError, "a rotation matrix"):
            camera.camera_from_world = 2 * np.eye(3)
        with self.assertRaisesRegex(tf.InputError, "shape 3"):
            camera.position = [1, 2]
        with self.assertRaises(tf.InputError):
            camera.width = 0
        self.assertEqual(camera.width, 60)


if __name__ == "__main__":
    unittest.main()
