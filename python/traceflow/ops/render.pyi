from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import Camera, Scene, View

class Saved: ...

def forward(
    scene: Scene, camera: View | Camera, time: float | None = None
) -> tuple[dict[str, NDArray[np.float32]], Saved]: ...
def backward(saved: Saved, gradients: Mapping[str, ArrayLike]) -> dict[str, Any]: ...
