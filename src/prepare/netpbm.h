#pragma once

#include <atomic>
#include <optional>
#include <string>
#include <vector>

#include "base/descriptor.h"
#include "base/tensor.h"

namespace traceflow::prepare {

// Binary PGM and PPM pictures of 8 bits, one after the other, as a program writes them into a pipe.
class NetpbmStream {
 public:
  // source: what errors name. stop: looked at while the pipe is silent.
  NetpbmStream(Descriptor pipe, std::string source, const std::atomic<bool>& stop)
      : pipe_(std::move(pipe)), source_(std::move(source)), stop_(&stop) {}

  // The next picture, H×W×1 or H×W×3; nothing at the end. Throws InputError for anything else, for sides of
  // more than 16,384 pixels, and for a stream that ends within a picture. Throws
  // Stopped.
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
