from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import Camera, PosedSurfels, RenderOptions

_Floats = NDArray[np.float32]

class Saved: ...

def forward(
    surfels: PosedSurfels, camera: Camera, options: RenderOptions = ..., extent: float = 1.0
) -> tuple[dict[str, _Floats], Saved]: ...
def backward(saved: Saved, gradients: Mapping[str, ArrayLike]) -> tuple[PosedSurfels, dict[str, _Floats], _Floats]: ...
