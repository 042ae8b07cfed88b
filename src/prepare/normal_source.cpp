#include "prepare/normal_source.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "capture/decode.h"
#include "files/image.h"
#include "math/types.h"

namespace traceflow::prepare {

namespace fs = std::filesystem;

NormalSource::NormalSource(const fs::path& path, const fs::path& log, const std::atomic<bool>& stop) {
  if (!fs::exists(path))
    throw InputError(path.string(), "", "nothing", "normals: .npz, .npy, a film or a folder of pictures");
  if (path.extension() == ".npz" || path.extension() == ".npy") {
    array_.emplace(path);
    const Shape& shape = array_->shape();
    if (shape.rank() != 4 || shape[3] != 3 || shape.elements() == 0)
      throw InputError(path.string(), "shape", shape.to_string(), "T×H×W×3");
    count_ = shape[0];
    return;
  }
  pictures_.emplace(path, 0, log, stop);
  if (pictures_->is_folder()) folder_ = path;
  count_ = pictures_->count();
}

std::vector<std::string> NormalSource::names() const {
  return pictures_ ? pictures_->names() : std::vector<std::string>();
}

void NormalSource::take(const std::vector<int64_t>& indices,
                        const std::function<void(int64_t place, Tensor<float>&& normals)>& take) const {
  if (pictures_ && folder_.empty()) {
    pictures_->take_some(false, indices, [&](int64_t place, Tensor<uint8_t>&& picture) {
      take(place, normals_of_picture(in_16_bits(picture), "film"));
    });
    return;
  }
  const std::vector<fs::path> files = folder_.empty() ? std::vector<fs::path>() : pictures_in(folder_);
  for (size_t i = 0; i < indices.size(); ++i) {
    if (array_) {
      take(static_cast<int64_t>(i), array_->slice(indices[i]));
      continue;
    }
    const fs::path& file = files[static_cast<size_t>(indices[i])];
    take(static_cast<int64_t>(i), normals_of_picture(read_image16(InputFile(file)), file.string()));
  }
}

Tensor<uint16_t> normal_picture(const Tensor<float>& normals) {
  constexpr float shortest = 0.1F, full = 65535;
  Tensor<uint16_t> picture(normals.shape());
  for (int64_t i = 0; i < normals.size(); i += 3) {
    const Vec3<float> n = load3<float>(&normals[i]);
    const float size = length(n);
    // Also skips vectors that are not finite.
    if (!(size > shortest && std::isfinite(size))) continue;
    for (int c = 0; c < 3; ++c)
      picture[i + c] =
          static_cast<uint16_t>(std::lround(full * 0.5F * (std::clamp(n[c] / size, -1.0F, 1.0F) + 1)));
  }
  return picture;
}

}  // namespace traceflow::prepare
