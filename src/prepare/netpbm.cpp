#include "prepare/netpbm.h"

#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>

#include "base/error.h"
#include "base/work.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

constexpr size_t piece = size_t{1} << 18;
constexpr int64_t max_side = 16384;

}  // namespace

void NetpbmStream::fail(const std::string& found) const {
  throw InputError(source_, "picture", found, "pictures of 8 bits, of up to 16,384 pixels a side");
}

bool NetpbmStream::fill() {
  constexpr int glance = 100;  // ms
  pollfd pipe{pipe_.number(), POLLIN, 0};
  while (::poll(&pipe, 1, glance) == 0 || *stop_) {
    if (*stop_) throw Stopped{};
  }
  buffer_.resize(piece);
  begin_ = 0;
  ssize_t n = 0;
  do {
    n = ::read(pipe_.number(), buffer_.data(), piece);
  } while (n < 0 && errno == EINTR);
  buffer_.resize(n > 0 ? static_cast<size_t>(n) : 0);
  return n > 0;
}

int NetpbmStream::take() {
  if (begin_ == buffer_.size() && !fill()) return -1;
  return static_cast<unsigned char>(buffer_[begin_++]);
}

// Reads a number and the one space after it.
int64_t NetpbmStream::number() {
  int c = take();
  while (c >= 0 && std::isspace(c) != 0) c = take();
  int64_t value = 0;
  int digits = 0;
  for (; c >= 0 && std::isdigit(c) != 0 && digits < 6; c = take(), ++digits) value = value * 10 + (c - '0');
  if (digits == 0 || c < 0 || std::isspace(c) == 0) fail("a header that is not PGM's or PPM's");
  return value;
}

std::optional<Tensor<uint8_t>> NetpbmStream::next() {
  const int first = take();
  if (first < 0) return std::nullopt;
  const int kind = take();
  if (first != 'P' || (kind != '5' && kind != '6')) fail("something that is neither PGM nor PPM");
  const int64_t width = number(), height = number(), largest = number();
  if (width < 1 || height < 1 || width > max_side || height > max_side || largest != 255) {
    fail(std::to_string(width) + "×" + std::to_string(height) + " up to " + std::to_string(largest));
  }
  Tensor<uint8_t> picture({height, width, kind == '5' ? 1 : 3});
  const auto size = static_cast<size_t>(picture.size());
  for (size_t done = 0; done < size;) {
    if (begin_ == buffer_.size() && !fill())
      fail("a picture that ends after " + std::to_string(done) + " bytes");
    const size_t n = std::min(size - done, buffer_.size() - begin_);
    std::copy_n(buffer_.data() + begin_, n, picture.data() + done);
    begin_ += n;
    done += n;
  }
  return picture;
}

}  // namespace traceflow::prepare
