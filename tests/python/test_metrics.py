import json
import unittest

import numpy as np

import support
import traceflow as tf


class Metrics(unittest.TestCase):
    def setUp(self):
        rng = np.random.default_rng(1)
        self.image, self.target = (rng.uniform(0, 1, (20, 24, 3)).astype(np.float32) for _ in range(2))
        self.mask = rng.uniform(0, 1, (20, 24)) > 0.5

    def test_psnr(self):
        squares = (self.image.astype(np.float64) - self.target) ** 2
        self.assertAlmostEqual(tf.metrics.psnr(self.image, self.target), -10 * np.log10(squares.mean()), places=4)
        self.assertAlmostEqual(tf.metrics.psnr(self.image, self.target, self.mask),
                               -10 * np.log10(squares[self.mask].mean()), places=4)
        self.assertIsNone(tf.metrics.psnr(self.image, self.image))
        self.assertIsNone(tf.metrics.psnr(self.image, self.target, self.mask * 0))

    def test_ssim_is_that_of_the_loss(self):
        self.assertAlmostEqual(tf.metrics.ssim(self.image, self.target),
                               1 - tf.ops.loss.ssim(self.image, self.target)[0], places=6)
        self.assertAlmostEqual(tf.metrics.ssim(self.image, self.image), 1, places=6)

    def test_normals_and_depths(self):
        x, z = np.zeros((2, 20, 24, 3), np.float32)
        x[..., 0] = z[..., 2] = 1
        self.assertAlmostEqual(tf.metrics.normal_mae_deg((x + z) * 5, z), 45, places=4)
        errors = tf.metrics.depth_errors(np.array([[1, 2, 0, 3]]), np.array([[2, 2, 2, 0]]))
        np.testing.assert_allclose(errors, [[0.5, 0, 1, -1]])


class Evaluation(support.WithRun):
    def test_gives_the_figures_of_the_program(self):
        support.run("eval", self.run_folder, "--layers", "none", "--device", "cpu")
        theirs = json.loads((self.run_folder / "eval/test/metrics.json").read_text())
        scene = tf.load_scene(self.run_folder)
        ours = tf.metrics.evaluate(scene, scene.capture())
        for report in (theirs, ours):
            self.assertGreater(report.pop("render_fps"), 0)
        self.assertEqual(ours, theirs)


if __name__ == "__main__":
    unittest.main()
