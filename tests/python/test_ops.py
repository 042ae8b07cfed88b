"""The ops against the whole program and their derivatives against central differences."""

import unittest

import numpy as np

import support
import traceflow as tf

ops = tf.ops


def random_surfels(count, seed, tint=False):
    """Large, half transparent surfels in front of camera(), so that no cut-off comes between two differences."""
    rng = np.random.default_rng(seed)
    position = rng.uniform([-0.6, -0.4, 2], [0.6, 0.4, 3], (count, 3))
    fields = {"tint": rng.uniform(0.2, 0.8, count)} if tint else {}
    return tf.PosedSurfels(position=position, scale=rng.uniform(0.4, 0.8, (count, 2)),
                           rotation=np.array([1, 0, 0, 0]) + rng.normal(0, 0.2, (count, 4)),
                           opacity=rng.uniform(0.2, 0.6, count), sh=rng.normal(0, 0.3, (count, 4, 3)), **fields)


def still_motion(bodies):
    rotation = np.zeros((bodies, 2, 4))
    rotation[..., 0] = 1
    return tf.Motion(time=[0, 1], centre=np.zeros((bodies, 3)), rotation=rotation, shift=np.zeros((bodies, 2, 3)))


def camera():
    return tf.Camera(24, 16, 20)


def sums_of(layers, weights):
    return sum(float((layers[name].astype(np.float64) * weight).sum()) for name, weight in weights.items())


class Gradients(unittest.TestCase):
    def check(self, function, array, gradient, indices, step=1e-2, tolerance=0.02):
        """The gradient at some indices, relative to its largest number."""
        scale = np.abs(gradient).max()
        self.assertGreater(scale, 0)
        for index in indices:
            difference = support.central_difference(function, array, index, step)
            self.assertLess(abs(difference - gradient[index]) / scale, tolerance,
                            f"{index}: difference {difference}, gradient {gradient[index]}")

    def test_raster(self):
        surfels, view = random_surfels(5, 1, tint=True), camera()
        # A hit's low-pass and its cut-off are branches: neither is taken.
        options = tf.RenderOptions(low_pass=False, alpha_min=1e-6, transmittance_min=1e-9)
        rng = np.random.default_rng(2)
        weights = {name: rng.normal(0, 1, (16, 24, 3) if name in ("colour", "normal") else (16, 24)) * 0.05
                   for name in ("colour", "alpha", "tint", "normal", "depth")}

        def loss():
            return sums_of(ops.raster.forward(surfels, view, options)[0], weights)

        _, saved = ops.raster.forward(surfels, view, options)
        by_surfels, by_camera, signal = ops.raster.backward(saved, weights)
        for name, step in (("position", 3e-3), ("scale", 3e-3), ("rotation", 3e-3), ("opacity", 1e-2), ("sh", 1e-2),
                           ("tint", 1e-2)):
            array, gradient = getattr(surfels, name), getattr(by_surfels, name)
            self.assertEqual(gradient.shape, array.shape)
            with self.subTest(name):
                self.check(loss, array, gradient, [(i, *(0,) * (array.ndim - 1)) for i in range(5)], step)
        self.assertEqual(signal.shape, (5,))
        position = view.position.astype(np.float64)
        for axis in range(3):
            values = []
            for sign in (1, -1):
                view.position = position + sign * 3e-3 * np.eye(3)[axis]
                values.append(loss())
            view.position = position
            difference = (values[0] - values[1]) / 6e-3
            self.assertLess(abs(difference - by_camera["position"][axis]) / np.abs(by_camera["position"]).max(), 0.02)

    def test_trace(self):
        surfels = random_surfels(5, 3)
        rng = np.random.default_rng(4)
        origins = np.zeros((5, 3), np.float32)
        directions = np.concatenate([rng.uniform(-0.15, 0.15, (5, 2)), np.ones((5, 1))], axis=1).astype(np.float32)
        options = tf.RenderOptions(trace_alpha_min=1e-6, transmittance_min=1e-9)
        weights = {"colour": rng.normal(0, 1, (5, 3)), "alpha": rng.normal(0, 1, 5), "distance": rng.normal(0, 1, 5)}

        def loss():
            return sums_of(ops.trace.forward(surfels, origins, directions, options=options)[0], weights)

        _, saved = ops.trace.forward(surfels, origins, directions, options=options)
        by_surfels, by_rays, _ = ops.trace.backward(saved, **weights)
        self.check(loss, surfels.position, by_surfels.position, [(i, i % 3) for i in range(5)], 3e-3)
        self.check(loss, surfels.opacity, by_surfels.opacity, range(5))
        self.check(loss, surfels.sh, by_surfels.sh, [(i, i % 4, 1) for i in range(5)])
        self.check(loss, directions, by_rays["directions"], [(i, i % 2) for i in range(5)], 3e-3)

    def test_shade_and_losses(self):
        rng = np.random.default_rng(5)
        diffuse, target = (rng.uniform(0.1, 0.9, (16, 20, 3)).astype(np.float32) for _ in range(2))
        tint = rng.uniform(0.2, 0.8, (16, 20)).astype(np.float32)
        pixels = np.arange(0, 320, 3, dtype=np.int32)
        specular = rng.uniform(0, 1, (len(pixels), 3)).astype(np.float32)

        def loss():
            return ops.loss.ssim(ops.shade.forward(diffuse, tint, pixels, specular), target)[0]

        _, gradient = ops.loss.ssim(ops.shade.forward(diffuse, tint, pixels, specular), target)
        by_diffuse, by_tint, by_specular = ops.shade.backward(diffuse, tint, pixels, specular, gradient)
        self.check(loss, diffuse, by_diffuse, [(3, 4, 0), (8, 9, 1)])
        self.check(loss, tint, by_tint, [(0, 3), (7, 4)])
        self.check(loss, specular, by_specular, [(10, 2), (50, 0)])
        value, gradient = ops.loss.l1(diffuse, target)
        self.assertAlmostEqual(value, np.abs(diffuse - target).mean(), places=6)
        np.testing.assert_allclose(gradient, np.sign(diffuse - target) / diffuse.size, rtol=1e-5)
        value, gradient = ops.loss.distortion(tint)
        self.assertAlmostEqual(value, tint.mean(), places=6)

    def test_environment_map(self):
        rng = np.random.default_rng(6)
        logit = rng.normal(0, 1, (48, 8, 3)).astype(np.float32)
        directions = rng.normal(0, 1, (7, 3)).astype(np.float32)
        weight = rng.normal(0, 1, (7, 3))

        def loss():
            return float((ops.environment_map.forward(logit, directions) * weight).sum())

        by_logit, _ = ops.environment_map.backward(logit, directions, weight)
        largest = [np.unravel_index(i, logit.shape) for i in np.argsort(-np.abs(by_logit).ravel())[:5]]
        self.check(loss, logit, by_logit, largest)

    def test_motion(self):
        rng = np.random.default_rng(7)
        surfels = random_surfels(4, 8)
        body = np.array([0, 0, -1, 1], dtype=np.int32)
        motion = tf.Motion(time=[0, 1], centre=rng.normal(0, 1, (2, 3)),
                           rotation=np.array([1, 0, 0, 0]) + rng.normal(0, 0.2, (2, 2, 4)), shift=rng.normal(0, 1, (2, 2, 3)))
        weight = rng.normal(0, 1, (4, 3))

        def loss():
            moved, _ = ops.motion.forward(motion, body, 0.3, surfels)
            return float((moved.position * weight).sum())

        moved, saved = ops.motion.forward(motion, body, 0.3, surfels)
        np.testing.assert_array_equal(moved.position[2], surfels.position[2])
        zeros = {name: np.zeros_like(getattr(moved, name)) for name in ("scale", "rotation", "opacity", "sh")}
        by_surfels, by_motion = ops.motion.backward(saved, tf.PosedSurfels(position=weight, **zeros))
        self.check(loss, surfels.position, by_surfels.position, [(0, 0), (2, 1), (3, 2)])
        self.check(loss, motion.shift, by_motion.shift, [(0, 0, 0), (0, 1, 2), (1, 0, 1)])
        self.check(loss, motion.rotation, by_motion.rotation, [(0, 0, 1), (1, 1, 3)])


class WholeFrame(support.WithRun):
    """The ops one after the other make the program's picture."""

    def setUp(self):
        self.scene = tf.load_scene(self.run_folder)
        self.view = self.scene.capture().test[0]

    def posed_main(self):
        scene, time = self.scene, self.view.time
        posed, _ = ops.deform.forward(scene.main, scene.main_field, time=time, precision="fp32")
        if scene.nodes is not None:
            posed, _ = ops.nodes.forward(scene.nodes, scene.main.body, time, posed)
        if scene.motion is not None:
            posed, _ = ops.motion.forward(scene.motion, scene.main.body, time, posed)
        if scene.lighting is not None:
            posed, _ = ops.lighting.forward(scene.lighting, scene.main.body, time, posed)
        return posed

    def test_is_made_of_the_ops(self):
        scene, camera = self.scene, self.view.camera
        options = scene.options
        options["precision"] = "fp32"
        scene.options = options
        wanted = scene.render(self.view, layers=["rgb", "diffuse", "tint", "normal", "alpha"])
        layers, _ = ops.raster.forward(self.posed_main(), camera, options, scene.extent)
        for ours, theirs in (("colour", "diffuse"), ("tint", "tint"), ("normal", "normal"), ("alpha", "alpha")):
            self.assertEqual(layers[ours].tobytes(), wanted[theirs].tobytes(), theirs)
        pixels = ops.surface.select_pixels(layers["alpha"], layers["tint"], layers["normal"], options)
        self.assertGreater(len(pixels), 0)
        origins, directions = ops.surface.reflection_rays(camera, pixels, layers["depth"], layers["median_depth"],
                                                          layers["normal"], options["depth_ratio"])
        environment, _ = ops.deform.forward(scene.environment, scene.environment_field, time=self.view.time)
        mirrored, _ = ops.trace.forward(environment, origins, directions, options=options, extent=scene.extent)
        colour = ops.shade.forward(layers["colour"], layers["tint"], pixels, mirrored["colour"])
        self.assertEqual(colour.tobytes(), wanted["rgb"].tobytes())

    def test_has_the_gradient_of_central_differences(self):
        scene = self.scene
        image = self.view.image

        def loss():
            return float(((ops.render.forward(scene, self.view)[0]["colour"].astype(np.float64) - image) ** 2).sum())

        layers, saved = ops.render.forward(scene, self.view)
        self.assertEqual(layers["colour"].tobytes(), scene.render(self.view)["rgb"].tobytes())
        gradient = ops.render.backward(saved, {"colour": 2 * (layers["colour"] - image)})
        for part, field in (("main", "sh"), ("environment", "sh"), ("main", "opacity_logit")):
            array, by_array = getattr(getattr(scene, part), field), getattr(gradient[part], field)
            largest = [np.unravel_index(i, array.shape) for i in np.argsort(-np.abs(by_array).ravel())[:3]]
            for index in largest:
                difference = support.central_difference(loss, array, index, 2e-2)
                self.assertLess(abs(difference - by_array[index]) / np.abs(by_array).max(), 0.05, (part, field))

    def test_takes_arrays_of_the_library_without_copying_them(self):
        layers, _ = ops.render.forward(self.scene, self.view)
        for array in (layers["colour"], layers["colour"][:], self.view.image, self.scene.main.sh):
            self.assertTrue(tf._core._is_taken_as_it_is(array))
        for array in (layers["colour"][1:], layers["colour"].astype(np.float64), np.zeros((2, 2, 3), np.float32)):
            self.assertFalse(tf._core._is_taken_as_it_is(array))


class Errors(unittest.TestCase):
    def test_shapes_are_checked(self):
        image = np.zeros((16, 16, 3), np.float32)
        for call in (lambda: ops.loss.l1(image, image[1:]), lambda: ops.loss.l1(image[0], image),
                     lambda: ops.loss.l1("image", image), lambda: tf.PosedSurfels(image, image, image, image, image),
                     lambda: ops.environment_map.forward(image, image[0]),
                     lambda: ops.shade.forward(image, image, [0], image),
                     lambda: ops.shade.forward(image, image[..., 0], [256], image[0, :1]),
                     lambda: ops.shade.forward(image, image[..., 0], [5, 5], image[0, :2]),
                     lambda: ops.motion.forward(still_motion(1), [0, 1], 0, random_surfels(2, 1)),
                     lambda: ops.motion.backward(ops.motion.forward(still_motion(1), [0, 0], 0, random_surfels(2, 1))[1],
                                                 random_surfels(3, 1))):
            with self.assertRaises(tf.InputError):
                call()
        with self.assertRaisesRegex(tf.InputError, "gradients: found colours, expected layers among colour, alpha"):
            _, saved = ops.raster.forward(random_surfels(2, 1), camera())
            ops.raster.backward(saved, {"colours": image})


if __name__ == "__main__":
    unittest.main()
