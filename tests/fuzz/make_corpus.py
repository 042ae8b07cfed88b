#!/usr/bin/env python3
"""Writes the first inputs of the fuzzers that read files, small whole files of every kind, and of the one that reads what
a page says, into corpus/NAME/."""
import gzip
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


def spz_header(version, degree=0):
    return b"NGSP" + struct.pack("<IIBBBB", version, 1, degree, 12, 0, 0)


def spz_streams(parts):
    """The table and the Zstandard frames of version 4: one raw block each."""
    frames = [struct.pack("<IBB", 0xFD2FB528, 0x20, len(part)) + (len(part) << 3 | 1).to_bytes(3, "little") + part for part in parts]
    return b"".join(struct.pack("<QQ", len(frame), len(part)) for frame, part in zip(frames, parts)) + b"".join(frames)


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
    spz_gaussian = bytes([0, 16, 0, 0, 224, 255, 0, 8, 0, 51, 0, 128, 255, 0, 160, 128])
    put("spz", "version_2", gzip.compress(spz_header(2) + spz_gaussian + bytes([128, 218, 128]), mtime=0))
    put("spz", "version_3", gzip.compress(spz_header(3, 1) + spz_gaussian + bytes([0, 252, 7, 192] + [128] * 9), mtime=0))
    put("spz", "version_4", spz_header(4)[:15] + bytes([5]) + struct.pack("<I12x", 32) + spz_streams(
        [spz_gaussian[:9], spz_gaussian[9:10], spz_gaussian[10:13], spz_gaussian[13:], bytes([0, 252, 7, 192])]))
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
    turned = [[0, -1, 0], [0, 0, -1], [1, 0, 0]]
    bare = {"width": 4, "height": 2, "position": [1e3, -2, 0.5], "rotation": turned, "fx": 3.5, "fy": 3}
    put("cameras", "nameless", json.dumps([bare, {**bare, "time": 1}]))
    put("cameras", "ids", json.dumps(
        [{**bare, "id": "left/é 1"}, {**bare, "id": -7}, {**bare, "id": 7}], ensure_ascii=False))
    put("cameras", "twice", json.dumps([{**bare, "img_name": "a"}, {**bare, "img_name": "a"}]))
    put("cameras", "outside", json.dumps([{**bare, "img_name": "../a"}]))
    put("cameras", "large", json.dumps([{**bare, "width": 32768, "height": 1, "cx": -5, "cy": 1e4, "time": 0}]))
    put("cameras", "narrow", json.dumps([{**bare, "fx": 1e40}]))
    put("cameras", "not_turned", json.dumps([{**bare, "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}]))
    along = {"format": "traceflow camera path", "version": 1, "width": 6, "height": 4, "fps": 12.5, "closed": True}
    stops = [{**key, "fov_y": 0.1, "time": 0, "seconds": 1e-3},
             {**key, "position": [2, 0, 1], "rotation": turned, "fov_y": 90, "time": 0.5, "seconds": 2},
             {**key, "position": [0, 1, 1], "fov_y": 179, "time": 1, "seconds": 0.5}]
    put("cameras", "round", json.dumps({**along, "keyframes": stops}))
    put("cameras", "along", json.dumps({**along, "closed": False, "keyframes": stops[::-1] + stops}))
    put("cameras", "still", json.dumps({**along, "closed": False, "keyframes": [{**key, "seconds": 0}]}))
    put("cameras", "long", json.dumps({**along, "fps": 1000, "keyframes": [{**key, "seconds": 1e6}] * 2}))
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
    put("capture", "estimates", b" \n@depth/1x/a.npy\n" + npy("<f4", "(2, 3, 1)", floats(6))
        + b"\n@tracks.npy\n" + npy("<f4", "(1, 2, 3)", floats(6)))
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
    put("capture", "fisheye", "t\n@transforms.json\n" + json.dumps(
        {"is_fisheye": True, "k1": 0.01, "k2": -0.02, "k3": 0.003, "k4": -0.001,
         "frames": [{"file_path": "images/a.png", "K": [[5, 0.1, 3], [0, 5, 2], [0, 0, 1]], "transform_matrix": pose},
                    {"file_path": "images/b.jpg", "camera_angle_y": 0.6, "transform_matrix": pose[:3]}]}))
    # What is binary ends with the input, or else with the end of a line.
    for part, data in [("cameras", colmap_cameras([LENSES[6]])), ("images", colmap_images(["a.png", "b.jpg"])),
                       ("points3D", colmap_points(2))]:
        put("capture", "binary_" + part.lower(), f"c\n@sparse/0/{part}.bin\n".encode() + data)
    put("capture", "array", b" \n@normal.npy\n" + npy("<f4", "(2, 2, 3, 3)", floats(36)))

    # As an archive: the same letters with the highest bit set, and with the fourth what lies in it deflated.
    prior = archive({"normals.npy": npy("<f2", "(1, 2, 3, 3)", bytes(36))})
    tight = archive({"normals.npy": npy("<f2", "(1, 2, 3, 3)", bytes(36))}, zipfile.ZIP_DEFLATED)
    for name, first, npz in [("stored", 0xa0, prior), ("deflated", 0xa8, prior), ("tight", 0xa0, tight),
                             ("twice_tight", 0xa8, tight)]:
        put("capture", "packed_" + name, bytes([first]) + b"\n@normal.npz\n" + npz)
    put("capture", "packed_dycheck", b"\xe4\n@points.npy\n" + npy("<f4", "(2, 3)", floats(6)))
    put("capture", "packed_colmap", b"\xeb\n@sparse/0/points3D.txt\n1 0 0 2 9 9 9 0.5 1 0\n")
    put("capture", "packed_transforms", b"\xfc\n")


# COLMAP's lenses by their numbers: the name, and numbers that fit.
LENSES = [("SIMPLE_PINHOLE", [5, 3, 2]), ("PINHOLE", [5, 4, 3, 2]), ("SIMPLE_RADIAL", [5, 3, 2, 0.01]),
          ("RADIAL", [5, 3, 2, 0.01, -0.02]), ("OPENCV", [5, 4, 3, 2, 0.01, -0.02, 0.001, 0]),
          ("OPENCV_FISHEYE", [5, 4, 3, 2, 0.01, -0.02, 0.003, 0]),
          ("FULL_OPENCV", [5, 4, 3, 2, 0.01, -0.02, 0.001, 0, 0.003, 0.1, 0.01, 0]), ("FOV", [5, 4, 3, 2, 0.9]),
          ("SIMPLE_RADIAL_FISHEYE", [5, 3, 2, 0.01]), ("RADIAL_FISHEYE", [5, 3, 2, 0.01, -0.02]),
          ("THIN_PRISM_FISHEYE", [5, 4, 3, 2, 0.01, -0.02, 0.001, 0, 0.003, 0, 0.01, 0.02]),
          ("RAD_TAN_THIN_PRISM_FISHEYE", [5, 4, 3, 2] + [0.01] * 12), ("SIMPLE_DIVISION", [5, 3, 2, 0.01]),
          ("DIVISION", [5, 4, 3, 2, 0.01]), ("SIMPLE_FISHEYE", [5, 3, 2]), ("FISHEYE", [5, 4, 3, 2]),
          ("EUCM", [5, 4, 3, 2, 0.5, 1]), ("EQUIRECTANGULAR", [6, 4])]
NOT_READ = {"RAD_TAN_THIN_PRISM_FISHEYE", "SIMPLE_DIVISION", "DIVISION", "EUCM", "EQUIRECTANGULAR"}


def colmap_cameras(lenses):
    names = [name for name, _ in LENSES]
    return struct.pack("<Q", len(lenses)) + b"".join(
        struct.pack(f"<IiQQ{len(numbers)}d", i + 1, names.index(name), 6, 4, *numbers)
        for i, (name, numbers) in enumerate(lenses))


def colmap_images(names, cameras=1, seen=(7, -1)):
    data = struct.pack("<Q", len(names))
    for i, name in enumerate(names):
        data += struct.pack("<I7dI", i + 1, 0.9, 0.1, 0, -0.1, 0, 0.5 * i, 1, i % cameras + 1) + name.encode() + b"\0"
        data += struct.pack("<Q", len(seen)) + b"".join(struct.pack("<ddq", 1.5, 2.5, point) for point in seen)
    return data


def colmap_points(track):
    return struct.pack("<QQ3d3BdQ", 1, 7, 0.5, 0.5, 2, 255, 0, 9, 0.4, track) + struct.pack("<2I", 1, 0) * track


def models_of_colmap():
    put("colmap", "text", "t@cameras\n# words\n1 SIMPLE_PINHOLE 6 4 5 3 2\n@images\n1 1 0 0 0 0 0 1 1 a.png\n"
        "1.5 2.5 7 3 1 -1\n@points\n7 0.5 0.5 2 255 0 9 0.4 1 0 1 2\n")
    camera = struct.pack("<QIiQQ8d", 1, 1, 4, 6, 4, 5, 5, 3, 2, 0.01, -0.02, 0.001, 0)
    image = struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 1, 1) + b"a.png\0" + struct.pack("<Qddq", 1, 1.5, 2.5, 7)
    point = struct.pack("<QQ3d3BdQII", 1, 7, 0.5, 0.5, 2, 255, 0, 9, 0.4, 1, 1, 0)
    put("colmap", "binary", b"b@cameras\n" + camera + b"@images\n" + image + b"@points\n" + point)
    read = [lens for lens in LENSES if lens[0] not in NOT_READ]
    names = [f"{name.lower()}.png" for name, _ in read]
    put("colmap", "lenses_binary", b"b@cameras\n" + colmap_cameras(read) + b"@images\n"
        + colmap_images(names, len(read)) + b"@points\n" + colmap_points(3))
    put("colmap", "lenses_text", "t@cameras\n" + "".join(
        f"{i + 1} {name} 6 4 {' '.join(map(str, numbers))}\n" for i, (name, numbers) in enumerate(read))
        + "@images\n" + "".join(f"{i + 1} 1 0 0 0 0 0 1 {i + 1} {name}\n\n" for i, name in enumerate(names)))
    for lens in LENSES:
        if lens[0] in NOT_READ:
            put("colmap", lens[0].lower(),
                b"b@cameras\n" + colmap_cameras([lens]) + b"@images\n" + colmap_images(["a.png"]))
    one = "t@cameras\n1 PINHOLE 6 4 5 4 3 2\n@images\n"
    put("colmap", "spaces", "t@cameras\n# a\r\n\r\n 1\tPINHOLE 6 4 5 4 3 2 \r\n"
        "@images\n1 -2 0 0 1e-9 0 0 1 1 a b/ä.png\r\n1 2 -1 3 4 7\r\n# b\n2 0 0 0 -1 0 0 1 1 b.png")
    put("colmap", "absent", one + "1 1 0 0 0 0 0 1 2 a.png\n")
    put("colmap", "twice", one + "1 1 0 0 0 0 0 1 1 a.png\n\n1 1 0 0 0 0 0 1 1 a.png\n\n")
    put("colmap", "tracks", one + "1 1 0 0 0 0 0 1 1 a.png\n\n"
        "@points\n18446744073709551615 1e9 -1e-9 0 0 255 7 0 1 2 3 4 5 6\n2 0 0 0 0 0 0 -1\n")
    put("colmap", "no_images",
        b"b@cameras\n" + colmap_cameras([LENSES[0]]) + b"@images\n" + bytes(8) + b"@points\n" + bytes(8))


def messages():
    camera = {"position": [1, 2, 3], "rotation": [[0, -1, 0], [0, 0, -1], [1, 0, 0]], "fov_y": 40}
    shape = {"time": 0, "width": 96, "height": 54, "layer": "rgb", "exposure": 0, "map": "viridis", "moving": True}
    view = {"type": "view", "id": 1, "camera": camera, **shape}
    key = {**camera, "time": 0, "seconds": 1}
    path = {"format": "traceflow camera path", "version": 1, "width": 96, "height": 54, "fps": 30, "closed": True,
            "keyframes": [key, {**key, "position": [0, 0, 0], "time": 1}]}
    layers = [("normal", "turbo"), ("depth", "viridis"), ("specular", ""), ("é", "\t"), ("x" * 64, "y" * 64)]
    talks = {
        "moves": [view, {**view, "id": 2, "time": 0.5}, {**view, "id": 3, "moving": False},
                  {"type": "frame_shown", "frame": 1}, {"type": "frame_shown", "frame": 3},
                  {**view, "id": 4, "width": 4096, "height": 4096}],
        "layers": [{**view, "id": i, "layer": layer, "map": colours, "exposure": 2 * i - 5, "moving": False}
                   for i, (layer, colours) in enumerate(layers)],
        "photos": [{"type": "view", "id": 1, "photo": {"split": "train", "index": 0}, **shape},
                   {"type": "view", "id": 2, "photo": {"split": "test", "index": 1000000}, **shape},
                   {"type": "photo", "split": "test", "index": 2, "width": 4096},
                   {"type": "photo", "split": "all", "index": 0, "width": 50}],
        "probes": [view, {"type": "probe", "id": 2, "x": 0, "y": 1}, {"type": "probe", "id": 3, "x": 1e-300, "y": 0.5},
                   {"type": "probe", "id": 4, "x": -0.1, "y": 2}],
        "stills": [{"type": "still", "id": 1, "width": 8192, "height": 1}, view,
                   {"type": "still", "id": 2, "width": 1, "height": 8192},
                   {"type": "still", "id": 2 ** 53, "width": 0, "height": 8193}],
        "paths": [{"type": "path", "id": 5, "path": path}, {"type": "path", "id": 6, "path": [None, {}, "text", -0.0]}],
        "commands": [{"type": "command", "do": word} for word in ("pause", "resume", "save", "stop", "start")],
        "rests": [view, {"type": "sleep"}, {"type": "frame_shown", "frame": 2 ** 53}, {**view, "id": 9},
                  {"type": "sleep"}],
        "refused": [{"type": "view"}, {"type": 1}, {**view, "time": 2}, {**view, "id": 0.5}, {**view, "camera": {}},
                    [], None],
    }
    for name, talk in talks.items():
        put("message", name, "".join(json.dumps(line, ensure_ascii=False) + "\n" for line in talk))
    put("message", "broken", b'{"type":"view"\n\n{"type":"sleep"}}\n\xff\n' + b"[" * 300
        + b'\n{"type":"\\ud800","id":1}\n1e400')


def documents():
    put("json", "kinds",
        '{"a": {"b": [1, 2.5, -3]}, "w": 7, "t": "word", "y": true, "n": null, "i": ["x", 4], "": {}}')
    put("json", "rotation", "[[0, -1, 0], [1.004, 0, 0], [0, 0, 0.998]]")
    put("json", "numbers", "[0, -0.0, 1e308, 5e-324, -1, [1e15, -1e15, 1e16]]")
    put("json", "beyond", "[1, 1e400]")
    put("json", "whole", "[9007199254740992, 9007199254740993, -9223372036854775808, 18446744073709551616, 1e0, -3.0]")
    put("json", "texts", r'["\ud83d\ude00", "\u0000\u001b[2J", "\"\\/\b\f\n\r\t", "[{,", "é", {"a.b\u007f": "x"}]')
    put("json", "twice", b'\xef\xbb\xbf{"a": 1, "a": [2, [3]], "b": {"c": {"d": null}}}')
    put("json", "deep", "[" * 64 + "]" * 64)
    put("json", "deeper", '{"":' * 65 + "0" + "}" * 65)
    put("json", "halved", '{"a": [1, {"b": "\\')

    step = {"event": "step", "iterations": 40, "phase": "warm up", "loss": 0.5, "terms": {"colour": 0.25}}
    start = {"event": "started", "iteration": 0, "capture": "é", "surfels": {"main": 3, "environment": 0}}
    timed = {"event": "measured", "iteration": 10, "phase": "warm up", "iterations": 5,
             "steps": [{"name": "raster", "calls": 10, "seconds": 0.25}, {"name": "loss", "calls": 5, "seconds": 0.1}]}
    ended = {"event": "finished", "iteration": 20, "ending": "interrupted"}
    told = {"event": "warning", "iteration": 5, "text": "once"}
    session = [start, told, *({**step, "iteration": i, "seconds": i / 8} for i in (1, 5, 10)), timed,
               {"event": "phase_entered", "iteration": 10, "phase": "whole"},
               *({**step, "iteration": i, "phase": "whole", "seconds": i / 8} for i in (15, 20)), told, ended]
    resumed = [{**start, "iteration": 10}, *({**step, "iteration": i, "phase": "whole"} for i in (15, 20, 25))]
    lines = [json.dumps(line, ensure_ascii=False) for line in session + resumed]
    put("json", "log", "\n".join(lines[:6]) + "\n")
    put("json", "resumed", "\n".join(lines))
    put("json", "anew", "\r\n".join(lines[2:5] + lines[2:4] + [lines[9]] + lines[3:4]))
    put("json", "strange_log", '{"event":"step","iteration":1e3}\n{"event":"","iteration":1}\n[]\n\n{"event":"step"\n'
        '{"event":"measured","iteration":1,"iterations":1e-300,"steps":[{"name":"a","calls":1e14},0]}\n'
        '{"event":"step","iteration":-1}\n{"event":"a","iteration":18446744073709551615}\n'
        '{"event":"a","iteration":2,"b":' + "[" * 12 + "]" * 12 + "}\n" + '{"event":"step","iteration":3,"seconds":-1e308}')


def archives():
    files = {"top/dataset.json": b"{}", "top/rgb/1x/a.png": b"png", "top/empty": b""}
    put("zip", "stored", archive(files))
    put("zip", "deflated", archive({"a/b": bytes(300), "c": b"ccc"}, zipfile.ZIP_DEFLATED))
    put("zip", "zip64", archive({"a": b"a"}, zip64=True))
    put("zip", "outside", archive({"../a": b"a", "b": b"b"}))


for make in (arrays, images, models, settings, captures, models_of_colmap, messages, documents, archives):
    make()
