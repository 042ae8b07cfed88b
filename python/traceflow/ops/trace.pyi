import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import PosedSurfels, RenderOptions

_Floats = NDArray[np.float32]

class Saved: ...

def forward(
    surfels: PosedSurfels,
    origins: ArrayLike,
    directions: ArrayLike,
    widths: ArrayLike | None = None,
    options: RenderOptions = ...,
    extent: float = 1.0,
) -> tuple[dict[str, _Floats], Saved]: ...
def backward(
    saved: Saved,
    colour: ArrayLike | None = None,
    alpha: ArrayLike | None = None,
    distance: ArrayLike | None = None,
) -> tuple[PosedSurfels, dict[str, _Floats | None], _Floats]: ...
