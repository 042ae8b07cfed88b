#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/tensor.h"

namespace traceflow::prepare {

// A stream of binary PGM and PPM images of 8 bits, as a program writes them into a pipe.
class NetpbmStream {
 public:
  // source: named in errors. stop: checked while the pipe has no data.
  NetpbmStream(Descriptor pipe, std::string source, const std::atomic<bool>& stop)
      : pipe_(std::move(pipe)), source_(std::move(source)), stop_(&stop) {}

  // The next image, H×W×1 or H×W×3; nothing at the end. Throws InputError for other data, for sides above
  // 16,384 pixels, and for a stream that ends within an image. Throws Stopped.
  std::optional<Tensor<uint8_t>> next();

 private:
  bool fill();
  int take();  // the next byte, or -1
  int64_t number();
  [[noreturn]] void fail(const std::string& found) const;

  Descriptor pipe_;
  std::string source_;
  const std::atomic<bool>* stop_;
  std::vector<char> buffer_;
  size_t begin_ = 0;
};

}  // namespace traceflow::prepare
