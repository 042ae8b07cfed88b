#include "base/atomic_file.h"
#include "cli/malformed_cases.h"
#include "files/safetensors.h"
#include "support/temp_folder.h"

namespace traceflow::cli {

namespace {

const std::vector<std::string> inspect = {"inspect", "-d", "capture"};
const std::vector<std::string> trace = {"trace", "scene.ply", "--rays", "rays.npy", "-o", "out"};
const std::vector<std::string> export_run = {"export", "run", "-o", "out"};
const std::string rays = "rays.npy", ply = "scene.ply", checkpoint = "run/checkpoint.safetensors";

// A .npy as numpy writes it, of what is said to be six numbers.
std::string npy(const std::string& type, const std::string& shape, size_t bytes) {
  const std::string head = "{'descr': " + type + ", 'fortran_order': False, 'shape': " + shape + ", }\n";
  return "\x93NUMPY" + std::string{'\1', '\0', static_cast<char>(head.size()), '\0'} + head +
         std::string(bytes, '\0');
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
    files[checkpoint] = read_bytes(path);
  };
}

}  // namespace

MalformedKind malformed_arrays() {
  const std::string points = "capture/points.npy", normals = "capture/normal.npz";
  return {"Arrays: .npy and .npz",
          {{"objects of Python", trace, put(rays, npy("'|O'", "(1, 6)", 24)), ""},
           {"records", trace, put(rays, npy("[('x', '<f4')]", "(1, 6)", 24)), ""},
           {"the other byte order", trace, put(rays, npy("'>f4'", "(1, 6)", 24)), ""},
           {"complex numbers", trace, put(rays, npy("'<c8'", "(1, 6)", 48)), ""},
           {"more numbers than the file has", trace, put(rays, npy("'<f4'", "(1000, 6)", 24)), ""},
           {"more numbers than any file has", trace,
            put(rays, npy("'<f4'", "(4294967296, 4294967296, 6)", 24)), ""},
           {"a size that no number holds, times nothing", trace,
            put(rays, npy("'<f4'", "(4294967296, 4294967296, 0)", 0)), ""},
           {"five dimensions", trace, put(rays, npy("'<f4'", "(1, 1, 1, 1, 6)", 24)), ""},
           {"a shape in words", trace, put(rays, npy("'<f4'", "(many,)", 24)), ""},
           {"a type that would clear the terminal", trace, put(rays, npy("'\x1b[2J'", "(1, 6)", 24)), ""},
           {"cut short", trace, cut(rays, 40), ""},
           {"another kind of file", trace, put(rays, "ply\n"), ""},
           {"rays of three numbers", trace, put(rays, npy("'<f4'", "(2, 3)", 24)), ""},
           {"points in the plane", inspect, put(points, npy("'<f4'", "(3, 2)", 24)), ""},
           {"priors for another number of views", inspect,
            [=](Files& files) {
              files.erase("capture/normal/1x/a.png");
              files["capture/normal.npy"] = npy("'<f4'", "(7, 1, 1, 3)", 84);
            },
            ""}}};
}

MalformedKind malformed_plys() {
  return {"Surfels: .ply",
          {{"another kind of file", trace, put(ply, "PK\3\4"), ""},
           {"no end of the header", trace, cut(ply, 60), ""},
           {"text in the place of bytes", trace, replace(ply, "binary_little_endian", "ascii"), ""},
           {"the other byte order", trace, replace(ply, "binary_little_endian", "binary_big_endian"), ""},
           {"a list among the properties", trace, replace(ply, "float nx", "list uchar int nx"), ""},
           {"the ellipsoids of 3DGS", trace, replace(ply, "float nx", "float scale_2"), ""},
           {"an attribute that is missing", trace, replace(ply, "float opacity", "float transparency"), ""},
           {"an attribute that comes twice", trace, replace(ply, "float y", "float x"), ""},
           {"harmonics of no degree", trace, replace(ply, "float nx", "float f_rest_0"), ""},
           {"more surfels than the file has", trace, replace(ply, "vertex 1", "vertex 2147483647"), ""},
           {"fewer than no surfels", trace, replace(ply, "vertex 1", "vertex -1"), ""}}};
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
  const auto header = [](const std::string& text) {
    std::string bytes(8, '\0');
    for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<char>(text.size() >> (8 * i));
    return put(checkpoint, bytes + text);
  };
  return {"Checkpoints: .safetensors",
          {{"cut short", export_run, cut(checkpoint, 100), ""},
           {"another kind of file", export_run, put(checkpoint, "ply\nformat"), ""},
           {"a header that is not JSON", export_run, header("{\"a\": "), ""},
           {"a tensor outside the file", export_run,
            header(R"({"a":{"dtype":"F32","shape":[9],"data_offsets":[0,36]}})"), ""},
           {"a tensor of another size than its shape", export_run,
            header(R"({"a":{"dtype":"F32","shape":[9223372036854775807,9],"data_offsets":[0,0]}})"), ""},
           {"a type that is not known", export_run,
            header(R"({"a":{"dtype":"F8","shape":[0],"data_offsets":[0,0]}})"), ""},
           {"a tensor that comes twice", export_run,
            header(R"({"a":{"dtype":"U8","shape":[0],"data_offsets":[0,0]},"a":{}})"), ""},
           {"no scene", export_run, edit([](Safetensors& file) { file.metadata.erase("scene"); }), ""},
           {"a scene that is not JSON", export_run, metadata("scene", "{"), ""},
           {"reflections of an unknown kind", export_run, scene("specular", "mirrors"), ""},
           {"an extent of no length", export_run, scene("extent", -1), ""},
           {"a field too large for any memory", export_run,
            scene("main_field", {{"depth", 2},
                                 {"width", 1024},
                                 {"skip", 0},
                                 {"position_frequencies", 0},
                                 {"time_frequencies", 0},
                                 {"outputs", 2147483647}}),
            ""},
           {"a tensor of another shape", export_run, edit([](Safetensors& file) {
              file.add("scene/main/rotation", Tensor<float>({7, 4}));
            }),
            ""},
           {"surfels on a line", export_run,
            edit([](Safetensors& file) { file.add("scene/main/position", Tensor<float>({7})); }), ""},
           {"an option of another version", export_run, metadata("options", R"({"iterationz": 5})"), ""},
           {"an iteration in words", export_run, metadata("iteration", "the last"), ""}}};
}

}  // namespace traceflow::cli
