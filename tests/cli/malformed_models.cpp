#include <zlib.h>

#include "base/atomic_file.h"
#include "cli/malformed_cases.h"
#include "files/safetensors.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow::cli {

namespace {

const std::vector<std::string> trace = {"trace", "scene.ply", "--rays", "rays.npy", "-o", "out"};
const std::vector<std::string> trace_spz = {"trace", "scene.spz", "--rays", "rays.npy", "-o", "out"};
const std::vector<std::string> export_run = {"export", "run", "-o", "out"};
const std::string rays = "rays.npy", ply = "scene.ply", spz = "scene.spz",
                  checkpoint = "run/checkpoint.safetensors";

// A .npy as numpy writes it, of what is said to be six numbers.
std::string npy(const std::string& type, const std::string& shape, size_t bytes) {
  const std::string head = "{'descr': " + type + ", 'fortran_order': False, 'shape': " + shape + ", }\n";
  return "\x93NUMPY" + std::string{'\1', '\0', static_cast<char>(head.size()), '\0'} + head +
         std::string(bytes, '\0');
}

// Normal priors in an archive, with what follows changed in it.
std::function<void(Files&)> put_normals(const std::vector<std::pair<std::string, std::string>>& members,
                                        const std::function<void(std::string&)>& change = nullptr) {
  return [=](Files& files) {
    files.erase("capture/normal/1x/a.png");
    std::string& bytes = files["capture/normal.npz"] = zip_archive(members, true);
    if (change) change(bytes);
  };
}

// A checkpoint read, changed, and written again.
std::function<void(Files&)> edit(const std::function<void(Safetensors&)>& change) {
  return [change](Files& files) {
    const TempFolder folder;
    const auto path = folder / "checkpoint.safetensors";
    write_atomically(path, std::string_view(files.at(checkpoint)));
    Safetensors file = Safetensors::read(path);
    change(file);
    file.write(path);
    files[checkpoint] = bytes_of(path);
  };
}

}  // namespace

MalformedKind malformed_arrays() {
  const std::string points = "capture/points.npy", pictures = npy("'<f4'", "(2, 1, 1, 3)", 24);
  return {
      "Arrays: .npy and .npz",
      {{"pickled Python objects", trace, put(rays, npy("'|O'", "(1, 6)", 24)),
        "rays.npy: descr: found an array of Python objects, expected numbers of one type; save the array "
        "again"},
       {"a structured dtype", trace, put(rays, npy("[('x', '<f4')]", "(1, 6)", 24)),
        "rays.npy: descr: found a structured array, expected numbers of one type; save the array again"},
       {"big-endian data", trace, put(rays, npy("'>f4'", "(1, 6)", 24)),
        "rays.npy: descr: found big-endian >f4, expected little-endian numbers; save the array again"},
       {"complex numbers", trace, put(rays, npy("'<c8'", "(1, 6)", 48)),
        "rays.npy: descr: found <c8, expected float16/32/64, a whole number of 8 to 64 bits, or bool; save "
        "the array again"},
       {"more numbers than the file holds", trace, put(rays, npy("'<f4'", "(1000, 6)", 24)),
        "rays.npy: shape: found 1000x6, expected an array that the file holds; the file is cut short or "
        "broken"},
       {"more numbers than any file has", trace, put(rays, npy("'<f4'", "(4294967296, 4294967296, 6)", 24)),
        "rays.npy: shape: found 4294967296x4294967296x6, expected an array that the file holds; the file is "
        "cut short or broken"},
       {"a shape whose product overflows", trace, put(rays, npy("'<f4'", "(4294967296, 4294967296, 0)", 0)),
        "rays.npy: shape: found 4294967296x4294967296x0, expected an array that the file holds; the file is "
        "cut short or broken"},
       {"five dimensions", trace, put(rays, npy("'<f4'", "(1, 1, 1, 1, 6)", 24)),
        "rays.npy: shape: found 5 dimensions, expected 4 at most; reshape the array"},
       {"a string in the shape", trace, put(rays, npy("'<f4'", "(many,)", 24)),
        "rays.npy: shape: found (many,), expected a tuple of whole numbers; save the array again"},
       {"a dtype with a terminal escape sequence", trace, put(rays, npy("'\x1b[2J'", "(1, 6)", 24)),
        "rays.npy: descr: found ?[2J, expected float16/32/64, a whole number of 8 to 64 bits, or bool; save "
        "the array again"},
       {"cut short", trace, cut(rays, 40),
        "rays.npy: header: found 118 bytes, expected a header within the file, of 64 KiB at most; save the "
        "array again"},
       {"another file type", trace, put(rays, "ply\n"),
        "rays.npy: found a file without the .npy signature, expected a .npy array; save the array again"},
       {"rays of three numbers", trace, put(rays, npy("'<f4'", "(2, 3)", 24)),
        "rays.npy: shape: found 2x3, expected Nx6: origin and direction of each ray; or Nx7: the width of "
        "its cone too"},
       {"2D points", inspect_capture, put(points, npy("'<f4'", "(3, 2)", 24)),
        "capture/points.npy: shape: found 3x2, expected P×3"},
       {"priors for another number of views", inspect_capture,
        [=](Files& files) {
          files.erase("capture/normal/1x/a.png");
          files["capture/normal.npy"] = npy("'<f4'", "(7, 1, 1, 3)", 84);
        },
        "capture/normal.npy: shape: found 7x1x1x3, expected T×H×W×3 with T the training views (1) or all "
        "(2); make the priors again or take the file away"},
       {"tracks of another number of views", inspect_capture,
        [=](Files& files) { files["capture/tracks.npy"] = npy("'<f4'", "(7, 1, 3)", 84); },
        "capture/tracks.npy: shape: found 7x1x3, expected T×N×3 with T the training views (1) or all (2); "
        "attach the tracks again or take the file away"},
       {"an archive without arrays", inspect_capture, put_normals({}),
        "capture/normal.npz: found an archive without arrays, expected one array; save the array again"},
       {"an archive with two arrays", inspect_capture,
        put_normals({{"normal.npy", pictures}, {"depth.npy", pictures}}),
        "capture/normal.npz: found 2 arrays (normal.npy, depth.npy), expected one array; save the array "
        "again"},
       {"pickled Python objects in an archive", inspect_capture,
        put_normals({{"normal.npy", npy("'|O'", "(2, 1, 1, 3)", 24)}}),
        "capture/normal.npz: descr: found an array of Python objects, expected numbers of one type; save the "
        "array again"},
       {"text for an array in an archive", inspect_capture,
        put_normals({{"normal.npy", "normals of all views"}}),
        "capture/normal.npz: found a file without the .npy signature, expected a .npy array; save the array "
        "again"},
       {"an archive: more numbers than the array holds", inspect_capture,
        put_normals({{"normal.npy", npy("'<f4'", "(2, 100, 100, 3)", 24)}}),
        "capture/normal.npz: shape: found 2x100x100x3, expected an array that the file holds; the file is "
        "cut short or broken"},
       {"an archive cut short", inspect_capture,
        put_normals({{"normal.npy", pictures}}, [](std::string& zip) { zip.resize(zip.size() / 2); }),
        "capture/normal.npz: found a zip archive whose end is missing, expected a whole zip archive, stored "
        "or deflated; pack or save it again"},
       {"an array for an archive", inspect_capture,
        [=](Files& files) {
          put_normals({})(files);
          files["capture/normal.npz"] = pictures;
        },
        "capture/normal.npz: found a file that is not a zip archive, expected a whole zip archive, stored or "
        "deflated; pack or save it again"},
       {"priors in an archive for another number of views", inspect_capture,
        put_normals({{"normal.npy", npy("'<f4'", "(7, 1, 1, 3)", 84)}}),
        "capture/normal.npz: shape: found 7x1x1x3, expected T×H×W×3 with T the training views (1) or all "
        "(2); make the priors again or take the file away"}}};
}

MalformedKind malformed_plys() {
  return {
      "Surfels: .ply",
      {{"another file type", trace, put(ply, "PK\3\4"),
        "scene.ply: first line: found \"PK??\", expected \"ply\"; write it with 2DGS or `traceflow export`"},
       {"a header without an end", trace, cut(ply, 60),
        "scene.ply: header: found no end_header line, expected one within the first 65536 bytes; write it "
        "with 2DGS or `traceflow export`"},
       {"an ASCII file for a binary one", trace, replace(ply, "binary_little_endian", "ascii"),
        "scene.ply: format: found \"format ascii 1.0\", expected binary_little_endian 1.0; write it with "
        "2DGS or `traceflow export`"},
       {"big-endian data", trace, replace(ply, "binary_little_endian", "binary_big_endian"),
        "scene.ply: format: found \"format binary_big_endian 1.0\", expected binary_little_endian 1.0; write "
        "it with 2DGS or `traceflow export`"},
       {"a list among the properties", trace, replace(ply, "float nx", "list uchar int nx"),
        "scene.ply: property: found \"property list uchar int nx\", expected a scalar type and a name; write "
        "it with 2DGS or `traceflow export`"},
       {"a missing attribute", trace, replace(ply, "float opacity", "float transparency"),
        "scene.ply: property opacity: found none, expected every attribute of 2DGS; write it with 2DGS or "
        "`traceflow export`"},
       {"an attribute listed twice", trace, replace(ply, "float y", "float x"),
        "scene.ply: property \"x\": found two of it, expected one; write it with 2DGS or `traceflow export`"},
       {"harmonics of no whole degree", trace, replace(ply, "float nx", "float f_rest_0"),
        "scene.ply: f_rest_*: found 1 of them, expected 0, 9, 24 or 45 (degree 0 to 3); write it with 2DGS "
        "or `traceflow export`"},
       {"more surfels than the file holds", trace, replace(ply, "vertex 1", "vertex 2147483647"),
        "scene.ply: element vertex: found 2147483647 vertices of 64 bytes in a body of 64 bytes, expected as "
        "many bytes as the header promises; write it with 2DGS or `traceflow export`"},
       {"a negative number of surfels", trace, replace(ply, "vertex 1", "vertex -1"),
        "scene.ply: first element: found \"element vertex -1\", expected element vertex COUNT; write it with "
        "2DGS or `traceflow export`"}}};
}

MalformedKind malformed_spzs() {
  const auto gzipped = [](uint32_t version, uint32_t count, int degree, int fractional_bits, size_t bytes) {
    const TempFolder folder;
    const std::string header = "NGSP" + little_endian(version, 4) + little_endian(count, 4) +
                               static_cast<char>(degree) + static_cast<char>(fractional_bits) +
                               std::string(2, '\0');
    gzFile file = gzopen((folder / "a").c_str(), "wb");
    const std::string all = header + std::string(bytes, '\0');
    gzwrite(file, all.data(), static_cast<unsigned>(all.size()));
    gzclose(file);
    return put(spz, bytes_of(folder / "a"));
  };
  const std::string remedy = "; write it with Niantic's spz, splat-transform or `traceflow export`";
  return {"Gaussians: .spz",
          {{"an .spz cut short", trace_spz, gzipped(3, 1, 0, 12, 19),
            "scene.spz: found a gzip stream that is broken or ends early, expected a whole .spz" + remedy},
           {"a gzip file of something else", trace_spz,
            [](Files& files) {
              const TempFolder folder;
              gzFile file = gzopen((folder / "a").c_str(), "wb");
              gzwrite(file, "a tar archive or so", 19);
              gzclose(file);
              files[spz] = bytes_of(folder / "a");
            },
            "scene.spz: magic number: found 1635000417, expected \"NGSP\"" + remedy},
           {"an .spz of version 1", trace_spz, gzipped(1, 1, 0, 12, 20),
            "scene.spz: version: found 1, expected 2 or 3 in a gzip stream" + remedy},
           {"harmonics of degree 4", trace_spz, gzipped(3, 1, 4, 12, 92),
            "scene.spz: degree of the harmonics: found 4, expected 0 to 3" + remedy},
           {"more fractional bits than a position has", trace_spz, gzipped(3, 1, 0, 99, 20),
            "scene.spz: fractional bits: found 99, expected 0 to 24" + remedy},
           {"an .spz of version 4 without its table", trace_spz,
            put(spz, "NGSP" + little_endian(4, 4) + little_endian(1, 4) + std::string("\0\f\0\5", 4) +
                         little_endian(1000, 4) + std::string(12, '\0')),
            "scene.spz: table of contents: found offset 1000, expected one within the file" + remedy}}};
}

MalformedKind malformed_checkpoints() {
  const auto metadata = [](const std::string& key, const std::string& value) {
    return edit([=](Safetensors& file) { file.metadata[key] = value; });
  };
  const auto scene = [](const std::string& field, const nlohmann::json& value) {
    return edit([=](Safetensors& file) {
      nlohmann::json json = nlohmann::json::parse(file.metadata.at("scene"));
      json[field] = value;
      file.metadata["scene"] = json.dump();
    });
  };
  const auto promised = [](size_t length, const std::string& text) {
    std::string bytes(8, '\0');
    for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<char>(length >> (8 * i));
    return put(checkpoint, bytes + text);
  };
  const auto header = [=](const std::string& text) { return promised(text.size(), text); };
  return {
      "Checkpoints: .safetensors",
      {{"cut short", export_run, promised(23000, std::string(92, ' ')),
        "run/checkpoint.safetensors: header length: found 23000, expected at most 92; the file is cut "
        "short or is not a safetensors file; there is no checkpoint before it to go back to"},
       {"another file type", export_run, put(checkpoint, "ply\nformat"),
        "run/checkpoint.safetensors: header length: found 7886488381532236912, expected at most 2; the "
        "file is cut short or is not a safetensors file; there is no checkpoint before it to go back to"},
       {"a header that is not JSON", export_run, header("{\"a\": "),
        "run/checkpoint.safetensors: header: found text that is not JSON, expected a JSON object; there "
        "is no checkpoint before it to go back to"},
       {"a tensor outside the file", export_run,
        header(R"({"a":{"dtype":"F32","shape":[9],"data_offsets":[0,36]}})"),
        "run/checkpoint.safetensors: tensor a data_offsets: found [0,36], expected a range within 0 "
        "bytes of data; there is no checkpoint before it to go back to"},
       {"a tensor of another size than its shape", export_run,
        header(R"({"a":{"dtype":"F32","shape":[9223372036854775807,9],"data_offsets":[0,0]}})"),
        "run/checkpoint.safetensors: tensor a shape: found [9223372036854775807,9], expected a size that "
        "fits 63 bits; there is no checkpoint before it to go back to"},
       {"an unknown dtype", export_run, header(R"({"a":{"dtype":"F8","shape":[0],"data_offsets":[0,0]}})"),
        "run/checkpoint.safetensors: tensor a dtype: found \"F8\", expected F32, F64, I32, I64, U8, F16 "
        "or BF16; there is no checkpoint before it to go back to"},
       {"a tensor listed twice", export_run,
        header(R"({"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]},"a":{}})"),
        "run/checkpoint.safetensors: header: found the name \"a\" twice, expected every tensor once; "
        "there is no checkpoint before it to go back to"},
       {"no scene", export_run, edit([](Safetensors& file) { file.metadata.erase("scene"); }),
        "run/checkpoint.safetensors: scene: found no such metadata, expected a checkpoint written by "
        "traceflow train"},
       {"a scene that is not JSON", export_run, metadata("scene", "{"),
        "run/checkpoint.safetensors: scene: byte 2: found text that is not JSON, expected JSON"},
       {"an unknown reflection model", export_run, scene("specular", "mirrors"),
        "run/checkpoint.safetensors: scene: specular: found \"mirrors\", expected none, "
        "environment-gaussians or environment-map"},
       {"a negative extent", export_run, scene("extent", -1),
        "run/checkpoint.safetensors: scene: extent: found -1, expected 1e-12 to 1000000000000"},
       {"a field larger than any memory", export_run,
        scene("main_field", {{"depth", 2},
                             {"width", 1024},
                             {"skip", 0},
                             {"position_frequencies", 0},
                             {"time_frequencies", 0},
                             {"outputs", 2147483647}}),
        "run/checkpoint.safetensors: scene: main_field.outputs: found 2147483647, expected 11"},
       {"a tensor of another shape", export_run, edit([](Safetensors& file) {
          file.add("scene/main/rotation", Tensor<float>({7, 4}));
        }),
        "run/checkpoint.safetensors: scene/main/rotation: found shape 7x4, expected 2x4"},
       {"a position tensor of one dimension", export_run,
        edit([](Safetensors& file) { file.add("scene/main/position", Tensor<float>({7})); }),
        "run/checkpoint.safetensors: scene/main/: found shapes 7 and 2x9x3, expected N×3 positions and "
        "N×K×3 harmonics, K of 1, 4, 9 or 16"},
       {"an unknown option", export_run, metadata("options", R"({"iterationz": 5})"),
        "run/checkpoint.safetensors: options: iterationz: found no option of this name, expected one "
        "that `traceflow --help-options` lists; did you mean iterations?"},
       {"a string for an iteration", export_run, metadata("iteration", "the last"),
        "run/checkpoint.safetensors: iteration: found the last, expected a number"}}};
}

}  // namespace traceflow::cli
