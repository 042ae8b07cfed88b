import numpy as np
from numpy.typing import ArrayLike, NDArray

_Floats = NDArray[np.float32]

def forward(diffuse: ArrayLike, tint: ArrayLike, pixels: ArrayLike, specular: ArrayLike) -> _Floats: ...
def backward(
    diffuse: ArrayLike, tint: ArrayLike, pixels: ArrayLike, specular: ArrayLike, gradient: ArrayLike
) -> tuple[_Floats, _Floats, _Floats]: ...
