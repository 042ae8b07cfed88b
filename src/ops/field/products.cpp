#include "ops/field/products.h"

#include <omp.h>

#include <map>
#include <mutex>
#include <oneapi/dnnl/dnnl.hpp>
#include <unordered_map>

#include "base/tensor.h"
#include "ops/field/field.h"

namespace traceflow::field {

namespace {

// oneDNN asks OpenMP how many threads it may start, both when it compiles and when it runs. While one of
// these lives the answer is one.
class OneThread {
 public:
  OneThread() : before_(omp_get_max_threads()) { omp_set_num_threads(1); }
  ~OneThread() { omp_set_num_threads(before_); }
  OneThread(const OneThread&) = delete;
  OneThread& operator=(const OneThread&) = delete;

 private:
  int before_;
};

const dnnl::engine& engine() {
  static const dnnl::engine cpu(dnnl::engine::kind::cpu, 0);
  return cpu;
}

dnnl::memory::data_type data_type(Number number) {
  return number == Number::fp32 ? dnnl::memory::data_type::f32 : dnnl::memory::data_type::bf16;
}

dnnl::memory::desc matrix(int64_t rows, int64_t columns, Number number, bool transposed = false) {
  const dnnl::memory::dims strides =
      transposed ? dnnl::memory::dims{1, rows} : dnnl::memory::dims{columns, 1};
  return {{rows, columns}, data_type(number), strides};
}

dnnl::primitive_attr attributes(const ProductShape& shape) {
  dnnl::post_ops after;
  if (shape.accumulate) after.append_sum(1.0F);
#if DNNL_VERSION_MAJOR >= 3
  if (shape.relu) after.append_eltwise(dnnl::algorithm::eltwise_relu, 0.0F, 0.0F);
#else
  if (shape.relu) after.append_eltwise(1.0F, dnnl::algorithm::eltwise_relu, 0.0F, 0.0F);
#endif
  dnnl::primitive_attr attributes;
  attributes.set_post_ops(after);
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  return attributes;
}

dnnl::matmul::primitive_desc describe(const ProductShape& shape) {
  const auto a = matrix(shape.m, shape.k, shape.operands, shape.transposed);
  const auto b = matrix(shape.k, shape.n, shape.operands);
  const auto bias = shape.bias ? matrix(1, shape.n, Number::fp32) : dnnl::memory::desc();
  const auto c = matrix(shape.m, shape.n, shape.result);
#if DNNL_VERSION_MAJOR >= 3
  return {engine(), a, b, bias, c, attributes(shape)};
#else
  return {dnnl::matmul::desc(a, b, bias, c), attributes(shape), engine()};
#endif
}

dnnl::memory view(const dnnl::memory::desc& desc, const void* data) {
  return {desc, engine(), const_cast<void*>(data)};
}

// Each thread's own working memory, as large as the largest product has needed.
void* scratchpad(size_t bytes) {
  thread_local Tensor<std::byte> memory;
  memory.resize({static_cast<int64_t>(bytes)});
  return memory.data();
}

}  // namespace

struct Product::Compiled {
  explicit Compiled(const ProductShape& shape) : description(describe(shape)), primitive(description) {}
  dnnl::matmul::primitive_desc description;
  dnnl::matmul primitive;
  dnnl::memory::desc a = description.src_desc();
  dnnl::memory::desc b = description.weights_desc();
  dnnl::memory::desc bias = description.bias_desc();
  dnnl::memory::desc c = description.dst_desc();
  dnnl::memory::desc scratch = description.scratchpad_desc();
};

Product::Product(const ProductShape& shape) {
  const OneThread one_thread;
  compiled_ = std::make_unique<const Compiled>(shape);
}

Product::~Product() = default;

void Product::run(const void* a, const void* b, const float* bias, void* c) const {
  const OneThread one_thread;
  thread_local dnnl::stream stream(engine());
  const Compiled& p = *compiled_;
  std::unordered_map<int, dnnl::memory> arguments{
      {DNNL_ARG_SRC, view(p.a, a)},
      {DNNL_ARG_WEIGHTS, view(p.b, b)},
      {DNNL_ARG_DST, view(p.c, c)},
      {DNNL_ARG_SCRATCHPAD, view(p.scratch, scratchpad(p.scratch.get_size()))}};
  if (bias != nullptr) arguments.emplace(DNNL_ARG_BIAS, view(p.bias, bias));
  p.primitive.execute(stream, arguments);
  stream.wait();
}

const Product& product(const ProductShape& shape) {
  static std::mutex mutex;
  static std::map<ProductShape, std::unique_ptr<const Product>> compiled;
  const std::lock_guard lock(mutex);
  std::unique_ptr<const Product>& entry = compiled[shape];
  if (!entry) entry = std::make_unique<const Product>(shape);
  return *entry;
}

bool bf16_is_fast() {
  const auto needed = static_cast<unsigned>(dnnl::cpu_isa::avx512_core_bf16);
  return (static_cast<unsigned>(dnnl::get_effective_cpu_isa()) & needed) == needed;
}

}  // namespace traceflow::field
