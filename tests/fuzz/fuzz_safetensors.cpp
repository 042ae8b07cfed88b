// Bytes as a safetensors file, and as the scene of a checkpoint.
#include <cstring>

#include "fuzz/scratch_file.h"
#include "scene/scene_file.h"
#include "support/file_bytes.h"

using namespace traceflow;
using fuzz::promise;

namespace {

template <class T>
int take(const Safetensors& file, const std::string& name, size_t file_bytes) {
  try {
    const Tensor<T> tensor = file.tensor<T>(name);
    promise(tensor.size() == tensor.shape().elements(), "sizes agree");
    promise(static_cast<size_t>(tensor.size()) <= file_bytes, "no more numbers than the file can hold");
    return 1;
  } catch (const InputError&) {
    return 0;
  }
}

void check_tensors(const Safetensors& file, size_t file_bytes) {
  for (const std::string& name : file.names()) {
    const int types = take<float>(file, name, file_bytes) + take<double>(file, name, file_bytes) +
                      take<int32_t>(file, name, file_bytes) + take<int64_t>(file, name, file_bytes) +
                      take<uint8_t>(file, name, file_bytes);
    promise(types == 1, "a tensor has one type");
  }
}

void check(const Surfels& s) {
  const int64_t n = s.count();
  if (n == 0) return;
  promise(s.position.shape() == Shape{n, 3} && s.log_scale.shape() == Shape{n, 2} &&
              s.rotation.shape() == Shape{n, 4} && s.opacity_logit.shape() == Shape{n} &&
              s.sh.shape() == Shape{n, s.sh.dim(1), 3},
          "every surfel has everything");
  promise(s.tint_logit.empty() || s.tint_logit.shape() == Shape{n}, "every surfel has a tint or none has");
  promise(s.roughness_logit.empty() || s.roughness_logit.shape() == Shape{n},
          "every surfel has a roughness or none has");
  const int64_t k = s.sh.dim(1);
  promise(k == 1 || k == 4 || k == 9 || k == 16, "harmonics are of a degree");
}

void check(const std::optional<Field>& field, int outputs) {
  if (!field) return;
  field->shape.validate();
  promise(field->outputs() == outputs, "a field has its residuals");
}

void check(const Scene& scene) {
  check(scene.main);
  check(scene.environment);
  check(scene.main_field, residual::main_outputs);
  check(scene.environment_field, residual::environment_outputs);
  promise(scene.extent > 0 && std::isfinite(scene.extent), "an extent is a length");
  promise(scene.normalisation.scale > 0 && std::isfinite(scene.normalisation.scale), "a scale is a factor");
  if (!scene.environment_map) return;
  const Tensor<float>& logit = scene.environment_map->logit;
  const int64_t side = scene.environment_map->face_size();
  promise(side > 0 && logit.shape() == Shape{6 * side, side, 3}, "a cube has six faces");
  check(scene.environment_map->field, 3);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const auto path = folder.write("a.safetensors", fuzz::text_of(data, size));
  Safetensors file;
  if (!fuzz::accepts(path.string(), [&] { file = Safetensors::read(path); })) return 0;
  check_tensors(file, size);
  const auto again = folder.path() / "b.safetensors";
  file.write(again);
  const std::string bytes = bytes_of(again);
  const Safetensors read = Safetensors::read(again);
  promise(read.metadata == file.metadata && read.names() == file.names(), "what is written reads back");
  read.write(again);
  promise(bytes_of(again) == bytes, "equal contents are equal bytes");

  Scene scene;
  if (!fuzz::accepts(path.string(), [&] { scene = get_scene(file); })) return 0;
  check(scene);
  Safetensors put, twice;
  put_scene(scene, put);
  put_scene(get_scene(put), twice);
  put.write(again);
  const std::string once = bytes_of(again);
  twice.write(again);
  promise(bytes_of(again) == once, "a scene that is kept is the same scene");
  return 0;
}
