"""What traceflow.torch gives to PyTorch and takes from it. There is no PyTorch here: a stand-in calls its functions."""

import importlib
import subprocess
import sys
import types
import unittest
from unittest import mock

import numpy as np

import support
import traceflow as tf


class StandInTensor(np.ndarray):
    def requires_grad_(self):
        return self

    def contiguous(self):
        return self

    def numpy(self):
        return np.asarray(self)


class StandInFunction:
    """Keeps the context of the last call, as autograd does until backward()."""

    @classmethod
    def apply(cls, *arguments):
        cls.context = types.SimpleNamespace()
        return cls.forward(cls.context, *arguments)


def stand_in():
    torch = types.ModuleType("torch")
    torch.from_numpy = lambda array: array.view(StandInTensor)
    function = types.SimpleNamespace(once_differentiable=lambda f: f)
    torch.autograd = types.SimpleNamespace(Function=StandInFunction, function=function)
    return torch


class Torch(support.WithRun):
    def test_passes_parameters_and_gradients(self):
        with mock.patch.dict(sys.modules, torch=stand_in()):
            module = importlib.import_module("traceflow.torch")
        scene = tf.load_scene(self.run_folder)
        view = scene.capture().train[0]
        parameters = module.parameters_of(scene)
        self.assertIn("main.tint_logit", parameters)
        self.assertIn("motion.shift", parameters)
        self.assertIn("environment_field.head_bias", parameters)
        self.assertTrue(np.shares_memory(parameters["main.sh"], scene.main.sh))

        layers, saved = tf.ops.render.forward(scene, view)
        tensors = module.render(scene, view, parameters)
        self.assertEqual(set(tensors), set(layers))
        for name, layer in layers.items():
            np.testing.assert_array_equal(tensors[name], layer)

        by_colour = layers["colour"] - view.image
        given = [by_colour.view(StandInTensor) if name == "colour" else None for name in tensors]
        gradients = module._Render.backward(module._Render.context, *given)
        self.assertEqual(len(gradients), 4 + len(parameters))
        self.assertEqual(gradients[:4], (None, None, None, None))
        wanted = tf.ops.render.backward(saved, {"colour": by_colour})
        for (name, parameter), gradient in zip(parameters.items(), gradients[4:]):
            self.assertEqual(gradient.shape, parameter.shape, name)
            if name.startswith("main.") and name.count(".") == 1 and hasattr(wanted["main"], name[5:]):
                np.testing.assert_array_equal(gradient, getattr(wanted["main"], name[5:]))
        self.assertGreater(np.abs(gradients[4 + list(parameters).index("main.sh")]).max(), 0)

    def test_is_imported_only_when_asked_for(self):
        code = "import sys, traceflow; assert 'torch' not in sys.modules and 'traceflow.torch' not in sys.modules"
        subprocess.run([sys.executable, "-B", "-c", code], check=True)


if __name__ == "__main__":
    unittest.main()
