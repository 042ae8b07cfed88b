"""What the tests share: the program, a small capture and a short run."""

import json
import os
import pathlib
import shutil
import struct
import subprocess
import tempfile
import unittest

import numpy as np

import traceflow as tf

PROGRAM = os.environ["TRACEFLOW_PROGRAM"]
SYNTH = {"frames": 8, "width": 64, "height": 36, "samples": 2, "points": 1000}
ITERATIONS = 60


def call(*arguments):
    """Runs the program; returns its exit code and what it wrote to standard error."""
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    return done.returncode, done.stderr


def run(*arguments):
    code, errors = call(*arguments)
    if code != 0:
        raise AssertionError(f"traceflow {arguments}: {errors}")


def error_of(*arguments):
    """The text of the error that the program ends with."""
    code, errors = call(*arguments)
    if code == 0:
        raise AssertionError(f"traceflow {arguments} did not fail")
    return errors.strip().splitlines()[-1].removeprefix("traceflow: ")


def checkpoint(run_folder):
    """A checkpoint's tensors as bytes, and its metadata without times."""
    data = pathlib.Path(run_folder, "checkpoint.safetensors").read_bytes()
    (size,) = struct.unpack("<Q", data[:8])
    header = json.loads(data[8 : 8 + size])
    metadata = header.pop("__metadata__")
    tensors = {}
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        tensors[name] = (entry["dtype"], entry["shape"], data[8 + size + begin : 8 + size + end])
    return tensors, {k: v for k, v in metadata.items() if k not in TIMES}


# Entries of a checkpoint's metadata that depend on how long the training took, and checksums over them.
TIMES = ("train_seconds", "traceflow.crc32")


class WithRun(unittest.TestCase):
    """Tests on one capture and one run, made once by the program."""

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.addClassCleanup(shutil.rmtree, cls.folder)
        cls.capture_folder = cls.folder / "capture"
        options = [part for name, value in SYNTH.items() for part in (f"--{name}", value)]
        run("synth", cls.capture_folder, *options)
        cls.run_folder = cls.folder / "run"
        if cls.needs_run:
            run("train", "-d", cls.capture_folder, "-o", cls.run_folder, "--preset", "demo", "-i", ITERATIONS, "-q",
                "--device", "cpu")

    needs_run = True


def central_difference(function, array, index, step):
    """d function / d array[index], for a function that reads the array."""
    kept = array[index]
    array[index] = kept + step
    above, high = function(), array[index]
    array[index] = kept - step
    below, low = function(), array[index]
    array[index] = kept
    return (above - below) / (float(high) - float(low))
