#!/usr/bin/env python3
"""Writes the weights that `traceflow eval --lpips FILE` reads, from torchvision's VGG-16 and the lpips package.

    pip install torch torchvision lpips
    scripts/export_lpips.py lpips_vgg16.safetensors

torchvision fetches its ImageNet weights (528 MB) on first use; lpips carries its linear layers with it. The file holds
float32 tensors: features.N.weight and features.N.bias of the 13 convolutions (torchvision's names) and
linK.model.1.weight of the five linear layers (lpips's names), 59 MB in all.
"""
import argparse
import json
import re
import struct


def collect(model):
    """The tensors under the names that TraceFlow reads."""
    tensors = {}
    for name, tensor in model.state_dict().items():
        convolution = re.fullmatch(r"net\.slice\d+\.(\d+)\.(weight|bias)", name)
        if convolution:
            tensors["features." + convolution[1] + "." + convolution[2]] = tensor
        elif re.fullmatch(r"lin\d\.model\.1\.weight", name):
            tensors[name] = tensor
    return tensors


def write_safetensors(path, tensors):
    header, blobs, offset = {}, [], 0
    for name in sorted(tensors):
        array = tensors[name].detach().cpu().float().contiguous().numpy()
        blob = array.astype("<f4").tobytes()
        header[name] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [offset, offset + len(blob)]}
        blobs.append(blob)
        offset += len(blob)
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text + b"".join(blobs))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("output", help="where to write, e.g. lpips_vgg16.safetensors")
    path = parser.parse_args().output
    try:
        import lpips
    except ImportError as error:
        raise SystemExit(f"export_lpips.py: {error}; pip install torch torchvision lpips")
    tensors = collect(lpips.LPIPS(net="vgg", version="0.1", verbose=False))
    if len(tensors) != 31:
        raise SystemExit(f"export_lpips.py: found {len(tensors)} tensors, expected 31; this lpips has another layout")
    write_safetensors(path, tensors)
    print(f"wrote {path}")


if __name__ == "__main__":
    main()
