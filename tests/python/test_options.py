import re
import subprocess
import unittest

import numpy as np

import support
import traceflow as tf


class Options(unittest.TestCase):
    def test_has_the_names_of_the_command_line(self):
        page = subprocess.run([support.PROGRAM, "--help-options"], capture_output=True, text=True, check=True).stdout
        names = re.findall(r"^\| `([a-z0-9_.]+)`", page, re.MULTILINE)
        self.assertGreater(len(names), 100)
        self.assertEqual(list(tf.TrainOptions()), names)

    def test_presets_differ(self):
        self.assertEqual(tf.TrainOptions()["iterations"], 60000)
        self.assertEqual(tf.TrainOptions(preset="cpu")["density.max_surfels"], 20000)
        self.assertNotEqual(tf.TrainOptions("cpu"), tf.TrainOptions("demo"))
        with self.assertRaises(tf.InputError):
            tf.TrainOptions("none")

    def test_takes_values_of_every_kind(self):
        options = tf.TrainOptions("cpu")
        options["density.max_surfels"] = np.int64(40000)
        options["loss.ssim"] = np.float32(0.25)
        options["specular"] = "environment_map"
        options["render.background"] = [0, 0.5, 1]
        options.set({"deform.kind": "network"}, seed="7", iterations=100)
        self.assertEqual(options["density.max_surfels"], 40000)
        self.assertEqual(options["loss.ssim"], 0.25)
        self.assertEqual(options["specular"], "environment-map")
        self.assertEqual(options["render.background"], (0, 0.5, 1))
        self.assertEqual([options[n] for n in ("deform.kind", "seed", "iterations")], ["network", 7, 100])
        self.assertEqual(dict(options.items())["seed"], 7)

    def test_errors_have_the_text_of_the_program(self):
        for name, value in (("loss.ssim", 2), ("density.max_surfels", 0), ("schedule.length", -1)):
            with self.assertRaises(tf.InputError) as caught:
                tf.TrainOptions()[name] = value
            self.assertEqual(str(caught.exception),
                             support.error_of("train", "-d", "x", "-o", "y", "--set", f"{name}={value}"))
            self.assertIsInstance(caught.exception, ValueError)
            self.assertIsInstance(caught.exception, tf.Error)

    def test_suggests_a_name(self):
        with self.assertRaisesRegex(tf.InputError, "did you mean density.max_surfels?"):
            tf.TrainOptions()["density.max_surfel"]

    def test_refuses_values_that_a_field_cannot_hold(self):
        for name, value in (("iterations", 1.5), ("iterations", 2**70), ("seed", None), ("render.background", [1, 2]),
                            ("deform.main", 1), ("specular", "mirror"), ("render.background", ["a", "b", "c"])):
            with self.subTest(name=name, value=value), self.assertRaises(tf.InputError):
                tf.TrainOptions()[name] = value

    def test_sets_all_or_none(self):
        options = tf.TrainOptions()
        with self.assertRaises(tf.InputError):
            options.set({"seed": 5, "loss.ssim": 2})
        self.assertEqual(options, tf.TrainOptions())
        # Each alone would not fit the other.
        options.set({"schedule.specular_from": 20000, "schedule.joint_from": 30000})
        self.assertEqual(options["schedule.joint_from"], 30000)

    def test_describes(self):
        described = tf.TrainOptions().describe("density.prune_above")
        self.assertEqual(described["unit"], "extents")
        self.assertIn("a number", described["accepts"])
        self.assertTrue(described["help"])

    def test_is_copied(self):
        options = tf.SynthOptions(frames=3)
        other = options.copy()
        other["frames"] = 4
        self.assertEqual(options["frames"], 3)


if __name__ == "__main__":
    unittest.main()
