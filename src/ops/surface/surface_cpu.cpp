#include "base/parallel.h"
#include "ops/surface/surface.h"
#include "ops/surface/surface_backward.h"

// Pseudo-normals. On the CPU both passes process bands of rows. A band back-projects its own rows and the
// neighbouring rows that it needs to its own memory, so bands are independent. The backward pass gathers: a
// pixel sums over the four normals that it contributes to, so no two threads write to the same address.
namespace traceflow::surface {

namespace {

constexpr int64_t band_rows = 16;

template <class T>
DepthImage<T> checked(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                      const Tensor<T>& alpha, T depth_ratio) {
  require(depth.shape() == Shape({camera.height, camera.width}) && median_depth.shape() == depth.shape() &&
              alpha.shape() == depth.shape(),
          "depths and alpha have the camera's size", depth.shape().to_string());
  return {camera, depth.data(), median_depth.data(), alpha.data(), depth_ratio};
}

// Rows [first, last) of an image of vectors, addressed by their row in the whole image.
template <class T>
class RowBand {
 public:
  RowBand(int64_t first, int64_t last, int64_t width)
      : first_(first),
        last_(last),
        width_(width),
        values_(static_cast<size_t>((last - first) * width), Vec3<T>(T(0))) {}
  int64_t first() const { return first_; }
  int64_t last() const { return last_; }
  Vec3<T>& operator()(int64_t row, int64_t column) { return values_[index(row, column)]; }
  const Vec3<T>& operator()(int64_t row, int64_t column) const { return values_[index(row, column)]; }

 private:
  size_t index(int64_t row, int64_t column) const {
    return static_cast<size_t>((row - first_) * width_ + column);
  }

  int64_t first_, last_, width_;
  std::vector<Vec3<T>> values_;
};

template <class T>
RowBand<T> back_project(const DepthImage<T>& image, int64_t first, int64_t last) {
  RowBand<T> points(std::max<int64_t>(first, 0), std::min(last, image.height()), image.width());
  for (int64_t row = points.first(); row < points.last(); ++row) {
    for (int64_t column = 0; column < image.width(); ++column) {
      points(row, column) = image.point(row, column);
    }
  }
  return points;
}

bool on_border(int64_t row, int64_t height) { return row < 1 || row >= height - 1; }

// dL/d(across), dL/d(down) of the normals of rows [first, last); zero on the border and where there is no
// normal.
template <class T>
void normal_gradients(const DepthImage<T>& image, const Tensor<T>& grad_normal, const RowBand<T>& points,
                      RowBand<T>& grad_across, RowBand<T>& grad_down) {
  for (int64_t row = grad_across.first(); row < grad_across.last(); ++row) {
    if (on_border(row, image.height())) continue;
    for (int64_t column = 1; column < image.width() - 1; ++column) {
      const Vec3<T> g = load3<T>(&grad_normal(row, column, 0));
      if (!is_finite(points(row, column))) continue;
      const auto gradient = pseudo_normal_backward(points(row, column + 1) - points(row, column - 1),
                                                   points(row + 1, column) - points(row - 1, column), g);
      if (!is_finite(gradient.across) || !is_finite(gradient.down)) continue;
      grad_across(row, column) = gradient.across;
      grad_down(row, column) = gradient.down;
    }
  }
}

}  // namespace

template <class T>
void pseudo_normals(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                    const Tensor<T>& alpha, T depth_ratio, Tensor<T>& normal) {
  const DepthImage<T> image = checked(camera, depth, median_depth, alpha, depth_ratio);
  const int64_t height = image.height(), width = image.width();
  normal.place(depth.device());
  if (depth.device() == Device::cuda) {
    normal.resize({height, width, 3});
    parallel_for(Device::cuda, "surface: pseudo-normals", depth.size(),
                 PseudoNormals<T>{image, normal.data()});
    return;
  }
  normal.reset({height, width, 3});
  parallel_blocks("surface: pseudo-normals", height, band_rows, [&](int64_t begin, int64_t end) {
    const RowBand<T> points = back_project(image, begin - 1, end + 1);
    for (int64_t row = begin; row < end; ++row) {
      if (on_border(row, height)) continue;
      for (int64_t column = 1; column < width - 1; ++column) {
        if (!is_finite(points(row, column))) continue;
        store3(&normal(row, column, 0), pseudo_normal(points(row, column + 1) - points(row, column - 1),
                                                      points(row + 1, column) - points(row - 1, column)));
      }
    }
  });
}

template <class T>
void pseudo_normals_backward(const Camera<T>& camera, const Tensor<T>& depth, const Tensor<T>& median_depth,
                             const Tensor<T>& alpha, T depth_ratio, const Tensor<T>& grad_normal,
                             Tensor<T>& grad_depth, Tensor<T>& grad_median_depth,
                             CameraGradient<T>* grad_camera) {
  const DepthImage<T> image = checked(camera, depth, median_depth, alpha, depth_ratio);
  const int64_t height = image.height(), width = image.width();
  require(grad_normal.shape() == Shape({height, width, 3}) && grad_depth.shape() == depth.shape() &&
              grad_median_depth.shape() == depth.shape(),
          "gradients have the shapes of their values");
  if (depth.device() == Device::cuda) {
    const PseudoNormalsBackward<T> step{image, grad_normal.data(), grad_depth.data(),
                                        grad_median_depth.data()};
    backward_on_device("surface: pseudo-normals backward", depth.size(), step, grad_camera);
    return;
  }
  std::vector<CameraSum<T>> partial(static_cast<size_t>((height + band_rows - 1) / band_rows));
  parallel_blocks("surface: pseudo-normals backward", height, band_rows, [&](int64_t begin, int64_t end) {
    const RowBand<T> points = back_project(image, begin - 2, end + 2);
    const int64_t first = std::max<int64_t>(begin - 1, 0), last = std::min(end + 1, height);
    RowBand<T> grad_across(first, last, width), grad_down(first, last, width);
    normal_gradients(image, grad_normal, points, grad_across, grad_down);

    CameraSum<T> sum;
    for (int64_t row = begin; row < end; ++row) {
      for (int64_t column = 0; column < width; ++column) {
        Vec3<T> g(T(0));
        if (column > 0) g += grad_across(row, column - 1);
        if (column < width - 1) g -= grad_across(row, column + 1);
        if (row > 0) g += grad_down(row - 1, column);
        if (row < height - 1) g -= grad_down(row + 1, column);
        if (g == Vec3<T>(T(0))) continue;
        const T grad_z = dot(g, pixel_ray(camera, row, column));
        const T share = median_share(median_depth(row, column), depth_ratio);
        grad_depth(row, column) += (T(1) - share) * grad_z;
        grad_median_depth(row, column) += share * grad_z;
        add_point_gradient(camera, row, column, image.z(row, column), g, sum);
      }
    }
    partial[static_cast<size_t>(begin / band_rows)] = sum;
  });
  if (grad_camera != nullptr) add_in_order(partial, *grad_camera);
}

template void pseudo_normals(const Camera<float>&, const Tensor<float>&, const Tensor<float>&,
                             const Tensor<float>&, float, Tensor<float>&);
template void pseudo_normals(const Camera<double>&, const Tensor<double>&, const Tensor<double>&,
                             const Tensor<double>&, double, Tensor<double>&);
template void pseudo_normals_backward(const Camera<float>&, const Tensor<float>&, const Tensor<float>&,
                                      const Tensor<float>&, float, const Tensor<float>&, Tensor<float>&,
                                      Tensor<float>&, CameraGradient<float>*);
template void pseudo_normals_backward(const Camera<double>&, const Tensor<double>&, const Tensor<double>&,
                                      const Tensor<double>&, double, const Tensor<double>&, Tensor<double>&,
                                      Tensor<double>&, CameraGradient<double>*);

}  // namespace traceflow::surface
