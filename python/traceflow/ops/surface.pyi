import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import Camera, RenderOptions

_Floats = NDArray[np.float32]

def pseudo_normals(
    camera: Camera, depth: ArrayLike, median_depth: ArrayLike, alpha: ArrayLike, depth_ratio: float = 0.0
) -> _Floats: ...
def pseudo_normals_backward(
    camera: Camera,
    depth: ArrayLike,
    median_depth: ArrayLike,
    alpha: ArrayLike,
    depth_ratio: float,
    gradient: ArrayLike,
) -> tuple[_Floats, _Floats, dict[str, _Floats]]: ...
def select_pixels(
    alpha: ArrayLike, tint: ArrayLike, normal: ArrayLike, options: RenderOptions = ...
) -> NDArray[np.int32]: ...
def reflection_rays(
    camera: Camera,
    pixels: ArrayLike,
    depth: ArrayLike,
    median_depth: ArrayLike,
    normal: ArrayLike,
    depth_ratio: float = 0.0,
) -> tuple[_Floats, _Floats]: ...
def reflection_rays_backward(
    camera: Camera,
    pixels: ArrayLike,
    depth: ArrayLike,
    median_depth: ArrayLike,
    normal: ArrayLike,
    depth_ratio: float,
    grad_origins: ArrayLike,
    grad_directions: ArrayLike,
) -> tuple[_Floats, _Floats, _Floats, dict[str, _Floats]]: ...
