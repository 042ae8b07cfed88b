import gc
import unittest

import numpy as np

import support
import traceflow as tf


class Scene(support.WithRun):
    def setUp(self):
        self.scene = tf.load_scene(self.run_folder)
        self.view = self.scene.capture().test[0]

    def test_renders_the_bytes_of_the_program(self):
        support.run("render", self.run_folder, "-o", self.folder / "layers", "--layers", "all", "--format", "npy",
                    "--device", "cpu")
        for view in self.scene.capture().test:
            layers = self.scene.render(view, layers="all")
            self.assertEqual(len(layers), 12)
            for name, values in layers.items():
                wanted = np.load(self.folder / "layers" / name / f"{view.name}.npy")
                self.assertEqual((values.dtype, values.shape), (np.float32, wanted.shape), name)
                self.assertEqual(values.tobytes(), wanted.tobytes(), name)

    def test_paints_the_bytes_of_the_program(self):
        support.run("render", self.run_folder, "-o", self.folder / "pictures", "--layers", "rgb,depth", "--device",
                    "cpu")
        painter = tf.Painter()
        for view in self.scene.capture().test:
            layers = self.scene.render(view, layers=["rgb", "depth"])
            for name, values in layers.items():
                tf.write_png(self.folder / "own.png", painter.paint(name, values))
                wanted = self.folder / "pictures" / name / f"{view.name}.png"
                self.assertEqual((self.folder / "own.png").read_bytes(), wanted.read_bytes(), name)

    def test_an_exported_scene_renders_too(self):
        support.run("export", self.run_folder, "-o", self.folder / "export", "--time", "0")
        exported = tf.load_scene(self.folder / "export")
        self.assertIsNone(exported.capture_folder)
        # The capture's coordinates are not those of the run: the view's camera is converted.
        ours, theirs = (s.render(self.view, 0.0)["rgb"] for s in (self.scene, exported))
        self.assertLess(np.abs(ours - theirs).mean(), 0.01)

    def test_arrays_share_memory_and_outlive_the_scene(self):
        position = self.scene.main.position
        self.assertEqual(position.shape, (len(self.scene.main), 3))
        self.assertTrue(np.shares_memory(position, self.scene.main.position))
        before = self.scene.render(self.view)["rgb"]
        opacity = self.scene.main.opacity_logit
        kept = opacity.copy()
        opacity[:] = -20
        self.scene.environment.opacity_logit = np.full(len(self.scene.environment), -20)
        self.assertEqual(self.scene.render(self.view, layers=["alpha"])["alpha"].max(), 0)
        self.scene.main.opacity_logit = kept
        self.assertFalse(np.array_equal(before, self.scene.render(self.view)["rgb"]), "nothing is mirrored")
        copy = position.copy()
        self.scene = None
        gc.collect()
        np.testing.assert_array_equal(position, copy)

    def test_results_belong_to_the_caller(self):
        first = self.scene.render(self.view)["rgb"]
        copy = first.copy()
        self.scene.render(self.scene.capture().train[-1])
        np.testing.assert_array_equal(first, copy)
        first[:] = 0

    def test_renders_from_any_camera(self):
        camera = self.view.camera.resized(32, 18)
        picture = self.scene.render(camera, 0.5, layers=["rgb", "tint"])
        self.assertEqual(picture["rgb"].shape, (18, 32, 3))
        self.assertEqual(picture["tint"].shape, (18, 32))
        path = tf.orbit(self.scene.capture(), frames=5)
        self.assertEqual([time for _, time in path], [0, 0.25, 0.5, 0.75, 1])
        self.assertEqual(len(tf.spiral(self.scene.capture(), frames=3, width=40, height=20)), 3)

    def test_options_change_pictures(self):
        options = self.scene.options
        options["background"] = [1, 0, 0]
        self.scene.options = options
        layers = self.scene.render(self.view, layers=["diffuse", "alpha"])
        clear = layers["alpha"] < 0.01
        if clear.any():
            self.assertGreater(layers["diffuse"][clear][:, 0].min(), 0.9)

    def test_errors(self):
        with self.assertRaises(tf.InputError) as caught:
            tf.load_scene(self.folder / "nothing")
        self.assertEqual(str(caught.exception), support.error_of("render", self.folder / "nothing", "-o", "x"))
        for arguments in ((self.view, 2), (self.view.camera,), ("somewhere", 0), (self.view, 0, "colour")):
            with self.subTest(arguments=arguments), self.assertRaises(tf.InputError):
                self.scene.render(*arguments)
        with self.assertRaisesRegex(tf.InputError, "position: found shape 2×3"):
            self.scene.main.position = np.zeros((2, 3))
        with self.assertRaises(tf.InputError):
            tf.load_scene(self.run_folder, device="gpu")


if __name__ == "__main__":
    unittest.main()
