#!/usr/bin/env python3
"""Writes the first inputs of the fuzzers that read files: small whole files of every kind, into corpus/NAME/."""
import io
import json
import pathlib
import struct
import zipfile
import zlib

CORPUS = pathlib.Path(__file__).parent / "corpus"


def put(fuzzer, name, data):
    folder = CORPUS / fuzzer
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)


def npy(descr, shape, data, fortran=False, version=1):
    head = f"{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n".encode()
    length = struct.pack("<H" if version == 1 else "<I", len(head))
    return b"\x93NUMPY" + bytes([version, 0]) + length + head + data


def archive(members, method=zipfile.ZIP_STORED, zip64=False):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", method) as z:
        for name, data in members.items():
            info = zipfile.ZipInfo(name)
            info.compress_type = method
            with z.open(info, "w", force_zip64=zip64) as member:
                member.write(data)
    return buffer.getvalue()


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def png(width, height, depth, colour, rows, extra=(), interlace=0):
    head = struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, interlace)
    chunks = b"".join(chunk(kind, data) for kind, data in extra)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunks
            + chunk(b"IDAT", zlib.compress(b"".join(b"\0" + row for row in rows))) + chunk(b"IEND", b""))


def ply(properties, rows, notes=(), tail=""):
    head = "ply\nformat binary_little_endian 1.0\n"
    head += "".join(f"comment traceflow {note}\n" for note in notes)
    head += f"element vertex {len(rows)}\n" + "".join(f"property {t} {n}\n" for t, n in properties)
    form = "<" + "".join({"float": "f", "double": "d", "uchar": "B"}[t] for t, _ in properties)
    return (head + tail + "end_header\n").encode() + b"".join(struct.pack(form, *row) for row in rows)


def surfel(rest=0, tint=False, kind="float"):
    names = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2"] + [f"f_rest_{i}" for i in range(rest)]
    names += ["opacity", "scale_0", "scale_1", "rot_0", "rot_1", "rot_2", "rot_3"] + ["tint"] * tint
    return [(kind, name) for name in names]


def safetensors(tensors, metadata=None):
    head, data = {}, b""
    if metadata:
        head["__metadata__"] = metadata
    for name, (kind, shape, body) in tensors.items():
        head[name] = {"dtype": kind, "shape": shape, "data_offsets": [len(data), len(data) + len(body)]}
        data += body
    text = json.dumps(head, separators=(",", ":")).encode()
    return struct.pack("<Q", len(text)) + text + data


def floats(count, value=0.5):
    return struct.pack(f"<{count}f", *([value] * count))


def surfel_tensors(prefix, count, k, tint):
    shapes = {"position": [count, 3], "log_scale": [count, 2], "rotation": [count, 4], "opacity_logit": [count],
              "sh": [count, k, 3]}
    if tint:
        shapes["tint_logit"] = [count]
    result = {}
    for name, shape in shapes.items():
        size = 1
        for side in shape:
            size *= side
        result[prefix + name] = ("F32", shape, floats(size))
    return result


def scene(**more):
    return {"specular": "none", "centre": [0, 0, 0], "scale": 1, "extent": 2, "main_reach": 0, "environment": False,
            "map": False, **more}


def arrays():
    put("npy", "f4", npy("<f4", "(2, 3)", floats(6)))
    put("npy", "fortran", npy("<f8", "(3, 2)", struct.pack("<6d", *range(6)), fortran=True))
    put("npy", "bytes", npy("|u1", "(4, 1, 2, 1)", bytes(range(8))))
    put("npy", "half", npy("<f2", "(3,)", struct.pack("<3e", 1, -2, 0.25), version=2))
    put("npy", "scalar", npy("<i8", "()", struct.pack("<q", -7), version=3))
    put("npy", "none", npy("|b1", "(0, 3)", b""))
    one = npy("<f4", "(1, 2)", floats(2))
    put("npy", "stored.npz", archive({"a.npy": one}))
    put("npy", "deflated.npz", archive({"a.npy": npy("<u2", "(64, 2)", bytes(256))}, zipfile.ZIP_DEFLATED))
    put("npy", "zip64.npz", archive({"a.npy": one}, zipfile.ZIP_DEFLATED, zip64=True))


def images():
    put("png", "rgb", png(3, 2, 8, 2, [bytes(range(9))] * 2))
    put("png", "alpha", png(2, 2, 8, 6, [bytes(range(8))] * 2))
    put("png", "grey16", png(2, 2, 16, 0, [b"\x12\x34\xff\xff"] * 2))
    put("png", "alpha16", png(1, 1, 16, 4, [b"\x12\x34\x80\0"]))
    put("png", "palette", png(4, 2, 2, 3, [b"\x1b"] * 2, [(b"PLTE", bytes(range(12))), (b"tRNS", b"\0\x80")]))
    put("png", "bits", png(5, 1, 1, 0, [b"\xa8"], [(b"tRNS", b"\0\1")]))
    # Adam7 of one pixel is one pass of one row.
    put("png", "interlaced", png(1, 1, 8, 2, [b"\1\2\3"], interlace=1))
    put("png", "text", png(1, 1, 8, 0, [b"\7"], [(b"gAMA", struct.pack(">I", 45455)), (b"tEXt", b"a\0b"),
                                                 (b"zTXt", b"a\0\0" + zlib.compress(b"b" * 50))]))


def models():
    row = [0.5] * 13
    put("ply", "plain", ply(surfel(), [row, row]))
    put("ply", "tint", ply(surfel(9, True), [[0.25] * 23], ["extent 2.5", 'render {"degree":1}']))
    put("ply", "double", ply(surfel(kind="double") + [("uchar", "red")], [row + [7]], tail="element face 0\n"))
    put("safetensors", "types", safetensors(
        {"a": ("F32", [2, 1], floats(2)), "b": ("F64", [1], bytes(8)), "c": ("I32", [], bytes(4)),
         "d": ("I64", [1, 1, 1, 1], bytes(8)), "e": ("U8", [3], b"abc"), "f": ("F16", [2], b"\0\x3c\0\xc0"),
         "g": ("BF16", [0, 2], b"")}, {"key": "value"}))
    main = surfel_tensors("scene/main/", 1, 1, True)
    put("safetensors", "scene", safetensors(main, {"scene": json.dumps(scene())}))
    environment = surfel_tensors("scene/environment/", 1, 1, False)
    put("safetensors", "environment", safetensors(
        {**main, **environment},
        {"scene": json.dumps(scene(specular="environment-gaussians", environment=True))}))
    shape = {"depth": 1, "width": 16, "skip": 0, "position_frequencies": 0, "time_frequencies": 0, "outputs": 3}
    field = {"weight0": ("F32", [16, 4], floats(64)), "bias0": ("F32", [16], floats(16)),
             "head_weight": ("F32", [3, 16], floats(48)), "head_bias": ("F32", [3], floats(3))}
    put("safetensors", "map", safetensors(
        {**main, "scene/map/logit": ("F32", [6, 1, 3], floats(18)),
         **{"scene/map/field/" + name: tensor for name, tensor in field.items()}},
        {"scene": json.dumps(scene(specular="environment-map", map=True, map_field=shape))}))
    field["head_weight"] = ("F32", [11, 16], floats(176))
    field["head_bias"] = ("F32", [11], floats(11))
    put("safetensors", "field", safetensors(
        {**main, **{"scene/main_field/" + name: tensor for name, tensor in field.items()}},
        {"scene": json.dumps(scene(main_field={**shape, "outputs": 11}))}))


def settings():
    put("options", "toml", 't# all\non = false\ncount = 1_000\nnumber = 1e-3\ntext = "a\\u00e9"\n'
        'background = [0, 0.5, 1]\n[loss]\nweight = 0x1\norder = \'centre\'\n')
    put("options", "dotted", 'tloss.weight = 2\nloss = {order = "hit"}\nbytes = 9223372036854775807\n')
    put("options", "strange", 'tnumber = inf\ntext = 1979-05-27T07:32:00Z\n[[loss]]\n"a.b" = """\n"""\n')
    put("options", "json", 'j{"on":true,"count":3,"number":0.25,"background":[0,1,2],"loss":{"order":"hit"}}')
    put("options", "lines", "-on=off\ncount=-3\nnumber=+1e3\nbackground=1,2,3\nloss.order=centre\ntext=")


def captures():
    rotation = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    put("cameras", "list", json.dumps(
        [{"id": 0, "img_name": "a/b", "width": 4, "height": 2, "position": [0, 0, 1], "rotation": rotation,
          "fx": 3.5, "fy": 3, "cx": 1, "cy": 1, "time": 0.5}]))
    key = {"position": [0, 0, 1], "rotation": rotation, "fov_y": 40, "time": 0, "seconds": 0.1}
    put("cameras", "path", json.dumps(
        {"format": "traceflow camera path", "version": 1, "width": 4, "height": 2, "fps": 30, "closed": False,
         "keyframes": [key, {**key, "position": [1, 0, 0]}]}))
    camera = {"orientation": rotation, "position": [0, 0, -1], "focal_length": 5, "principal_point": [3, 2],
              "image_size": [6, 4], "skew": 0.1, "pixel_aspect_ratio": 1.1,
              "radial_distortion": [0.01, -0.02, 0.003], "tangential_distortion": [0.001, -0.002]}
    put("capture", "camera", " \n@camera/a.json\n" + json.dumps(camera))
    put("capture", "interp", ' \n@dataset.json\n{"train_ids":["a","x","b"],"val_ids":[]}\n@metadata.json\n'
        '{"a":{"warp_id":0},"b":{"warp_id":2}}\n@scene.json\n{"scale":1e-2,"center":[1,2,3]}')
    mask = png(6, 4, 1, 0, [b"\xa8"] * 4)
    put("capture", "mask", b" \n@mask/1x/a.png.png\n" + mask)
    normal = png(3, 2, 8, 2, [bytes([128, 128, 0] * 3)] * 2)
    put("capture", "normal", b" \n@normal/1x/a.png\n" + normal + b"\n@truth/normal/b.png\n" + normal)
    put("capture", "points", b" \n@points.npy\n" + npy("<f4", "(2, 3)", floats(6))
        + b"\n@truth/depth/b.npy\n" + npy("<f4", "(2, 3)", floats(6)))
    put("capture", "prior", b" \n@normal.npz\n" + archive({"normals.npy": npy("<f2", "(1, 2, 3, 3)", bytes(36))}))
    put("capture", "photographs", b" \n@rgb/1x/a.png\n" + png(6, 4, 8, 0, [bytes(6)] * 4)
        + b"\n@rgb/1x/b.png\n" + png(3, 2, 8, 6, [bytes(12)] * 2))


    put("capture", "dycheck", 'd\n@splits/val.json\n{"frame_names":["b","c"],"camera_ids":[1,2],"time_ids":[1,2]}')
    put("capture", "colmap", "c\n@sparse/0/cameras.txt\n1 OPENCV_FISHEYE 6 4 5 5 3 2 0.01 0 0 0\n"
        "@sparse/0/images.txt\n3 0.9 0.1 0 0 0 0 1 1 b.jpg\n1 2 -1\n7 1 0 0 0 1e-3 0 1 1 a.png\n")
    pose = [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]
    put("capture", "synthetic", "t\n@transforms_train.json\n" + json.dumps(
        {"camera_angle_x": 0.7, "frames": [{"file_path": "./images/a", "time": 0.5, "transform_matrix": pose}]}))
    put("capture", "nerfstudio", "t\n@transforms.json\n" + json.dumps(
        {"w": 6, "h": 4, "fl_x": 5, "fl_y": 5, "cx": 3, "cy": 2, "k1": 0.01, "camera_model": "OPENCV",
         "ply_file_path": "points.ply", "train_filenames": ["images/a.png"], "test_filenames": ["images/b.jpg"],
         "frames": [{"file_path": "images/a.png", "transform_matrix": pose},
                    {"file_path": "/home/me/images/b.jpg", "fl_x": 6, "transform_matrix": pose}]})
        + "\n@points.ply\nply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 1\n")


def models_of_colmap():
    put("colmap", "text", "t@cameras\n# words\n1 SIMPLE_PINHOLE 6 4 5 3 2\n@images\n1 1 0 0 0 0 0 1 1 a.png\n"
        "1.5 2.5 7 3 1 -1\n@points\n7 0.5 0.5 2 255 0 9 0.4 1 0 1 2\n")
    camera = struct.pack("<QIiQQ8d", 1, 1, 4, 6, 4, 5, 5, 3, 2, 0.01, -0.02, 0.001, 0)
    image = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 1, 1) + b"a.png\0" + struct.pack("<Qddq", 1, 1.5, 2.5, 7)
    point = struct.pack("<QQ3d3BdQII", 1, 7, 0.5, 0.5, 2, 255, 0, 9, 0.4, 1, 1, 0)
    put("colmap", "binary", b"b@cameras\n" + camera + b"@images\n" + image + b"@points\n" + point)


def archives():
    files = {"top/dataset.json": b"{}", "top/rgb/1x/a.png": b"png", "top/empty": b""}
    put("zip", "stored", archive(files))
    put("zip", "deflated", archive({"a/b": bytes(300), "c": b"ccc"}, zipfile.ZIP_DEFLATED))
    put("zip", "zip64", archive({"a": b"a"}, zip64=True))
    put("zip", "outside", archive({"../a": b"a", "b": b"b"}))


for make in (arrays, images, models, settings, captures, models_of_colmap, archives):
    make()
