"""TraceFlow: reconstruction of moving, shiny scenes with 2D Gaussian surfels.

Arrays that the package returns share the memory of what they belong to, and keep it alive. Lengths are in units of
the normalised scene unless a description says otherwise. docs/python.md has an example.
"""

import sys as _sys

from traceflow import _core
from traceflow._core import *  # noqa: F401,F403
from traceflow._core import __version__, metrics, ops

__all__ = sorted(name for name in vars(_core) if not name.startswith("_")) + ["__version__"]

# So that `import traceflow.ops.raster` finds what is part of one extension module.
_sys.modules["traceflow.metrics"] = metrics
_sys.modules["traceflow.ops"] = ops
for _name, _op in vars(ops).items():
    if not _name.startswith("_"):
        _sys.modules["traceflow.ops." + _name] = _op
