#include <algorithm>
#include <cmath>
#include <vector>

#include "math/encoding.h"
#include "ops/field/field.h"

// The network in double precision, one point after another (method §1.2).
namespace traceflow::field {

namespace {

using Row = std::vector<double>;

bool evaluated(const double* point) {
  return std::all_of(point, point + 3, [](double x) {
    return std::isfinite(x) && std::abs(x) <= static_cast<double>(coordinate_limit);
  });
}

// Intermediate values of one point: the encoding, the inputs of every layer and the last hidden values.
struct Trace {
  Row encoding;
  std::vector<Row> input;
  Row hidden;
};

Row linear(const Tensor<double>& weight, const Tensor<double>& bias, const Row& input) {
  Row result(static_cast<size_t>(weight.dim(0)));
  for (int64_t o = 0; o < weight.dim(0); ++o) {
    double sum = bias[o];
    for (int64_t i = 0; i < weight.dim(1); ++i) sum += weight(o, i) * input[i];
    result[o] = sum;
  }
  return result;
}

Trace trace_point(const BasicField<double>& field, const double* point, double time) {
  const NetworkOptions& shape = field.shape;
  Trace trace;
  trace.encoding.resize(static_cast<size_t>(shape.encoding_size()));
  positional_encoding(point, 3, shape.position_frequencies, trace.encoding.data());
  positional_encoding(&time, 1, shape.time_frequencies,
                      trace.encoding.data() + encoding_size(3, shape.position_frequencies));
  for (int layer = 0; layer < shape.depth; ++layer) {
    Row input;
    if (layer == 0 || layer == shape.skip) input = trace.encoding;
    input.insert(input.end(), trace.hidden.begin(), trace.hidden.end());
    trace.hidden = linear(field.weight[layer], field.bias[layer], input);
    for (double& h : trace.hidden) h = std::max(h, 0.0);
    trace.input.push_back(std::move(input));
  }
  return trace;
}

// Adds the gradients of `linear` to grad_weight and grad_bias, and returns the gradient of its input.
Row linear_backward(const Tensor<double>& weight, const Row& input, const Row& grad_output,
                    Tensor<double>& grad_weight, Tensor<double>& grad_bias) {
  Row grad_input(input.size(), 0.0);
  for (int64_t o = 0; o < weight.dim(0); ++o) {
    grad_bias[o] += grad_output[o];
    for (int64_t i = 0; i < weight.dim(1); ++i) {
      grad_weight(o, i) += grad_output[o] * input[i];
      grad_input[i] += grad_output[o] * weight(o, i);
    }
  }
  return grad_input;
}

void backward_point(const BasicField<double>& field, const double* point, double time, const Row& grad_output,
                    BasicField<double>& grad_field) {
  const Trace trace = trace_point(field, point, time);
  Row grad = linear_backward(field.head_weight, trace.hidden, grad_output, grad_field.head_weight,
                             grad_field.head_bias);
  const Row* hidden = &trace.hidden;
  for (int layer = field.shape.depth - 1; layer >= 0; --layer) {
    for (size_t i = 0; i < grad.size(); ++i) {
      if (!((*hidden)[hidden->size() - grad.size() + i] > 0)) grad[i] = 0;
    }
    const Row& input = trace.input[layer];
    grad =
        linear_backward(field.weight[layer], input, grad, grad_field.weight[layer], grad_field.bias[layer]);
    // The hidden values come last in the input, after the encoding at the skip.
    if (layer > 0) grad.erase(grad.begin(), grad.end() - field.shape.width);
    hidden = &input;
  }
}

}  // namespace

void forward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                       Tensor<double>& output) {
  const int64_t count = points.empty() ? 0 : points.dim(0);
  output.reset({count, field.outputs()});
  for (int64_t i = 0; i < count; ++i) {
    if (!evaluated(points.row(i))) continue;
    const Trace trace = trace_point(field, points.row(i), time);
    const Row row = linear(field.head_weight, field.head_bias, trace.hidden);
    std::copy(row.begin(), row.end(), output.row(i));
  }
}

void backward_reference(const BasicField<double>& field, const Tensor<double>& points, double time,
                        const Tensor<double>& grad_output, BasicField<double>& grad_field) {
  const int64_t count = points.empty() ? 0 : points.dim(0);
  for (int64_t i = 0; i < count; ++i) {
    const Row grad(grad_output.row(i), grad_output.row(i) + field.outputs());
    const bool finite = std::all_of(grad.begin(), grad.end(), [](double g) { return std::isfinite(g); });
    if (evaluated(points.row(i)) && finite) backward_point(field, points.row(i), time, grad, grad_field);
  }
}

}  // namespace traceflow::field
