"""Renders scenes as a step of PyTorch's autograd.

    import torch
    import traceflow as tf
    from traceflow.torch import parameters_of, render

    scene = tf.load_scene("RUN")
    parameters = parameters_of(scene)            # tensors on the CPU that share the scene's memory
    optimiser = torch.optim.Adam(parameters.values(), lr=1e-3)
    colour = render(scene, view, parameters)["colour"]
    (colour - photograph).square().mean().backward()
    optimiser.step()                             # the next render sees it

PyTorch is imported by this module alone.
"""

import torch

from traceflow import ops

_SURFEL_FIELDS = ("position", "log_scale", "rotation", "opacity_logit", "sh", "tint_logit", "roughness_logit")
_PARTS = {
    "main": _SURFEL_FIELDS,
    "environment": _SURFEL_FIELDS,
    "motion": ("rotation", "shift"),
    "nodes": ("turn", "shift"),
    "lighting": ("brightness", "body_brightness"),
    "environment_map": ("logit",),
}
_FIELDS = ("main_field", "environment_field")
LAYERS = ("colour", "normal", "pseudo_normal", "distortion", "alpha", "silhouette")


def _arrays_of(parts):
    """Pairs of a name, such as main.position, and an array. `parts` gives a part of the scene by its name, or None."""
    for part, fields in _PARTS.items():
        held = parts(part)
        for field in fields:
            array = getattr(held, field, None)
            if array is not None:
                yield f"{part}.{field}", array
    for part in _FIELDS:
        if parts(part) is not None:
            for name, array in parts(part).parameters().items():
                yield f"{part}.{name}", array


def parameters_of(scene):
    """All that a scene on the CPU trains, by name, as leaf tensors that share its memory and need a gradient."""
    arrays = _arrays_of(lambda part: getattr(scene, part))
    return {name: torch.from_numpy(array).requires_grad_() for name, array in arrays if array.size > 0}


class _Render(torch.autograd.Function):
    @staticmethod
    def forward(ctx, scene, camera, time, names, *_):
        layers, ctx.saved = ops.render.forward(scene, camera, time)
        ctx.names = names
        ctx.layers = tuple(name for name in LAYERS if name in layers)
        return tuple(torch.from_numpy(layers[name]) for name in ctx.layers)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, *gradients):
        given = {n: g.contiguous().numpy() for n, g in zip(ctx.layers, gradients) if g is not None}
        found = dict(_arrays_of(ops.render.backward(ctx.saved, given).get))
        return (None, None, None, None, *(torch.from_numpy(found[name]) for name in ctx.names))


def render(scene, camera, parameters, time=None):
    """The layers of traceflow.ops.render as tensors, differentiable by `parameters` (of parameters_of(scene)).

    camera: a View, or a Camera with a time in [0, 1]. The scene must not change between this and backward().
    """
    layers = _Render.apply(scene, camera, time, tuple(parameters), *parameters.values())
    # The order is that of LAYERS; only scenes with bodies have the last one.
    return dict(zip(LAYERS, layers))
