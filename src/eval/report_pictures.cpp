#include "eval/report_pictures.h"

#include <algorithm>
#include <array>

#include "files/base64.h"
#include "files/jpeg.h"
#include "files/png.h"
#include "viz/contact_sheet.h"

namespace traceflow::eval {

namespace {

using viz::Layer;

constexpr size_t most_views = 12;
constexpr int64_t longest_side = 1280;
constexpr int64_t narrowest = 32;
constexpr std::array<int, 5> qualities = {92, 85, 75, 62, 50};

// The view's pictures, in the order of ReportPicture.
using Pictures = std::array<Tensor<uint8_t>, 7>;
constexpr std::array<std::string ReportPicture::*, 7> places = {
    &ReportPicture::photograph, &ReportPicture::rgb,    &ReportPicture::difference, &ReportPicture::diffuse,
    &ReportPicture::specular,   &ReportPicture::normal, &ReportPicture::depth};

// Encodes as data: URLs and returns their number of bytes.
size_t encode(const Pictures& pictures, int quality, ReportPicture& result) {
  size_t bytes = 0;
  for (size_t i = 0; i < pictures.size(); ++i) {
    result.*places[i] = "data:image/jpeg;base64," + base64(jpeg_bytes(pictures[i], quality));
    bytes += (result.*places[i]).size();
  }
  return bytes;
}

Pictures shrunk(const Pictures& pictures, int64_t width) {
  Pictures small;
  std::ranges::transform(pictures, small.begin(),
                         [&](const Tensor<uint8_t>& picture) { return viz::shrink(picture, width); });
  return small;
}

}  // namespace

bool among_spread(size_t i, size_t n, size_t wanted) {
  const size_t shown = std::min(n, wanted);
  for (size_t k = 0; k < shown; ++k) {
    if (i == (2 * k + 1) * n / (2 * shown)) return true;
  }
  return false;
}

ReportPictures::ReportPictures(size_t views, size_t budget)
    : views_(views), shown_(std::min(views, most_views)), share_(budget / std::max<size_t>(1, shown_)) {}

void ReportPictures::add(const std::string& id, const Tensor<float>& photograph, const Frame& frame,
                         const Tensor<uint8_t>& known) {
  const Tensor<float> render = viz::layer_values(frame, Layer::rgb, 1);
  const auto layer = [&](Layer which) {
    return viz::in_colour(painter_.paint(which, viz::layer_values(frame, which, 1)));
  };
  Pictures pictures = {
      to_8bit(photograph),   to_8bit(render),        to_8bit(viz::difference(photograph, render, known)),
      layer(Layer::diffuse), layer(Layer::specular), layer(Layer::normal),
      layer(Layer::depth)};
  const int64_t height = render.dim(0), width = render.dim(1);
  if (const int64_t side = std::max(height, width); side > longest_side)
    pictures = shrunk(pictures, std::max<int64_t>(1, width * longest_side / side));

  ReportPicture result;
  result.id = id;
  size_t quality = 0;
  while (encode(pictures, qualities.at(quality), result) > share_) {
    if (quality + 1 < qualities.size()) {
      ++quality;
    } else if (pictures[0].dim(1) > narrowest) {
      pictures = shrunk(pictures, pictures[0].dim(1) * 7 / 10);
    } else {
      break;
    }
  }
  result.height = pictures[0].dim(0);
  result.width = pictures[0].dim(1);
  pictures_.push_back(std::move(result));
}

}  // namespace traceflow::eval
