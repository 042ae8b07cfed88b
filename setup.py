"""Builds the extension module with CMake; everything else about the package is in pyproject.toml.

TRACEFLOW_BUILD names a build folder that is configured with the Python module: its module is taken, and nothing else
is compiled. Without it there is one of its own, build/python-VERSION, which is kept between calls.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent


class BuildWithCMake(build_ext):
    def build_extension(self, extension):
        given = os.environ.get("TRACEFLOW_BUILD")
        build = pathlib.Path(given) if given else ROOT / f"build/python-{sys.version_info.major}.{sys.version_info.minor}"
        if not given:
            configure = ["cmake", "--preset", "release", "-B", build, "-DTRACEFLOW_PYTHON=ON", "-DTRACEFLOW_TESTS=OFF",
                         "-DTRACEFLOW_BENCHMARKS=OFF", f"-DPython_EXECUTABLE={sys.executable}"]
            pybind11 = pybind11_folder()
            if pybind11:
                configure.append(f"-Dpybind11_DIR={pybind11}")
            subprocess.run(configure, cwd=ROOT, check=True)
        subprocess.run(["cmake", "--build", build, "--target", "traceflow_python"], cwd=ROOT, check=True)
        module = next((build / "python/traceflow").glob("_core.*.so"))
        target = pathlib.Path(self.get_ext_fullpath(extension.name))
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(module, target)


def pybind11_folder():
    """Where CMake finds pybind11, if it is a Python package; Debian's it finds by itself."""
    try:
        import pybind11

        return pybind11.get_cmake_dir()
    except ImportError:
        return None


def version():
    return re.search(r"project\(traceflow VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)


setup(version=version(), ext_modules=[Extension("traceflow._core", [])], cmdclass={"build_ext": BuildWithCMake})
