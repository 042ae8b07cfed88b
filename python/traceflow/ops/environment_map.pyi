import numpy as np
from numpy.typing import ArrayLike, NDArray

_Floats = NDArray[np.float32]

def forward(logit: ArrayLike, directions: ArrayLike) -> _Floats: ...
def backward(logit: ArrayLike, directions: ArrayLike, gradient: ArrayLike) -> tuple[_Floats, _Floats]: ...
