#include "prepare/depth_source.h"

#include <algorithm>

#include "base/error.h"
#include "base/utf8.h"
#include "capture/formats/image_names.h"
#include "files/image.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

bool is_array(const fs::path& path) {
  const std::string extension = lower_extension(path);
  return extension == ".npy" || extension == ".npz";
}

// The array of an .npz that holds depths: `depths` (MegaSaM, Video Depth Anything) or `depth`; empty means
// the only one.
std::string depth_name(const fs::path& path) {
  if (lower_extension(path) != ".npz") return "";
  const std::vector<std::string> names = names_in_npz(path);
  for (const char* name : {"depths", "depth"}) {
    if (std::ranges::find(names, name) != names.end()) return name;
  }
  return "";
}

std::vector<fs::path> arrays_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const bool is_hidden = entry.path().filename().string().starts_with('.');
    if (entry.is_regular_file() && !is_hidden && is_array(entry.path())) files.push_back(entry.path());
  }
  std::ranges::sort(files, [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

// Without a dimension of 1 at either end.
Tensor<float> as_image(const fs::path& path, Tensor<float> values) {
  const Shape& shape = values.shape();
  if (shape.rank() == 3 && shape[2] == 1) values.resize({shape[0], shape[1]});
  if (shape.rank() == 3 && shape[0] == 1) values.resize({shape[1], shape[2]});
  if (values.shape().rank() != 2 || values.empty())
    throw InputError(path.string(), "shape", shape.to_string(), "H×W");
  return values;
}

// Estimators also write pictures for the eye, whose colours are no measure of depth.
void require_grey(const fs::path& path, const Tensor<uint16_t>& picture) {
  constexpr int same = 65535 / 32;
  if (picture.dim(2) < 3) return;
  for (int64_t i = 0; i < picture.size(); i += picture.dim(2)) {
    const auto [least, most] = std::minmax({picture[i], picture[i + 1], picture[i + 2]});
    if (most - least <= same) continue;
    throw InputError(path.string(), "colours", "a pixel that is not grey", "depth as grey",
                     "save depths without a colour map (Depth Anything: --pred-only --grayscale)");
  }
}

Tensor<float> first_channel(const Tensor<uint16_t>& picture) {
  constexpr float full = 65535;
  Tensor<float> values({picture.dim(0), picture.dim(1)});
  for (int64_t i = 0; i < values.size(); ++i)
    values[i] = static_cast<float>(picture[i * picture.dim(2)]) / full;
  return values;
}

}  // namespace

DepthSource::DepthSource(const fs::path& path, const fs::path& log, const std::atomic<bool>& stop) {
  if (fs::is_directory(path)) {
    files_ = arrays_in(path);
    if (files_.empty()) files_ = pictures_in(path);
    if (files_.empty())
      throw InputError(path.string(), "", "neither arrays nor pictures", ".npy, .npz, PNG or JPEG files");
    count_ = static_cast<int64_t>(files_.size());
  } else if (is_array(path)) {
    array_.emplace(path, depth_name(path));
    const Shape& shape = array_->shape();
    const bool has_channel = shape.rank() == 4 && shape[3] == 1;
    if ((shape.rank() != 3 && !has_channel) || shape.elements() == 0)
      throw InputError(path.string(), "shape", shape.to_string(), "T×H×W");
    count_ = shape[0];
  } else {
    video_.emplace(path, 0, log, stop);
    count_ = video_->count();
  }
}

std::vector<std::string> DepthSource::names() const {
  std::vector<std::string> names;
  names.reserve(files_.size());
  for (const fs::path& file : files_) names.push_back(as_utf8(file.filename().string()));
  return names;
}

Tensor<float> DepthSource::read(int64_t index) const {
  if (array_) return as_image(array_->path(), array_->slice(index));
  const fs::path& file = files_[static_cast<size_t>(index)];
  if (is_array(file)) return as_image(file, NpyFile(file, depth_name(file)).read());
  const Tensor<uint16_t> picture = read_image16(InputFile(file));
  require_grey(file, picture);
  return first_channel(picture);
}

void DepthSource::take(const std::vector<int64_t>& indices,
                       const std::function<void(int64_t place, Tensor<float>&& values)>& take) const {
  if (video_) {
    video_->take_some(true, indices, [&](int64_t place, Tensor<uint8_t>&& picture) {
      take(place, first_channel(in_16_bits(picture)));
    });
    return;
  }
  for (size_t i = 0; i < indices.size(); ++i) take(static_cast<int64_t>(i), read(indices[i]));
}

}  // namespace traceflow::prepare
