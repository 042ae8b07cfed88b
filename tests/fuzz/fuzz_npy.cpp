// Bytes as a .npy, or, where they begin as a zip archive does, as a .npz.
#include <cstring>

#include "files/npy.h"
#include "fuzz/scratch_file.h"

using namespace traceflow;
using fuzz::promise;

namespace {

bool same(const Tensor<float>& a, const Tensor<float>& b) {
  return a.shape() == b.shape() &&
         (a.empty() || std::memcmp(a.data(), b.data(), static_cast<size_t>(a.size()) * sizeof(float)) == 0);
}

void check_slice(const NpyFile& file, const Tensor<float>& whole, int64_t i) {
  const Tensor<float> slice = file.slice(i);
  promise(slice.size() == whole.row_size(), "a slice is a row");
  promise(
      slice.empty() || std::memcmp(slice.data(), whole.row(i), static_cast<size_t>(slice.size()) * 4) == 0,
      "a slice is what the whole has there");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const std::string_view bytes = fuzz::text_of(data, size);
  const auto path = folder.write(bytes.starts_with("PK") ? "a.npz" : "a.npy", bytes);
  Tensor<float> whole;
  const bool accepted = fuzz::accepts(path.string(), [&] {
    const NpyFile file(path);
    whole = file.read();
    promise(whole.shape() == file.shape() && whole.size() == whole.shape().elements(), "sizes agree");
    // A deflated byte makes a thousand at most, of which each is a number at most.
    promise(whole.size() <= static_cast<int64_t>(1040 * size),
            "an array is no larger than its file can hold");
    if (whole.shape().rank() < 2 || whole.empty()) return;
    check_slice(file, whole, 0);
    check_slice(file, whole, whole.dim(0) - 1);
  });
  if (accepted) {
    write_npy(folder.path() / "b.npy", whole);
    promise(same(read_npy(folder.path() / "b.npy"), whole), "what is written reads back");
  }
  std::filesystem::remove(path);
  std::filesystem::remove(folder.path() / "b.npy");
  promise(folder.files() == 0, "nothing is left behind");
  return 0;
}
