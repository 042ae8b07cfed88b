#include "ops/field/gemm.h"

#include <omp.h>

#include <map>
#include <mutex>
#include <oneapi/dnnl/dnnl.hpp>
#include <unordered_map>

#include "base/tensor.h"
#include "ops/field/field.h"

namespace traceflow::field {

namespace {

// oneDNN asks OpenMP for the number of threads that it may use, when it compiles and when it runs. While an
// object of this class exists the answer is one.
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

dnnl::memory::data_type data_type(DType number) {
  return number == DType::fp32 ? dnnl::memory::data_type::f32 : dnnl::memory::data_type::bf16;
}

dnnl::memory::desc matrix(int64_t rows, int64_t columns, DType number, bool transposed = false) {
  const dnnl::memory::dims strides =
      transposed ? dnnl::memory::dims{1, rows} : dnnl::memory::dims{columns, 1};
  return {{rows, columns}, data_type(number), strides};
}

dnnl::memory::dims dims_of(const dnnl::memory::desc& description) {
#if DNNL_VERSION_MAJOR >= 3
  return description.get_dims();
#else
  return description.dims();
#endif
}

dnnl::primitive_attr attributes(const GemmShape& shape) {
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

dnnl::memory::desc operand_b(const GemmShape& shape);

dnnl::matmul::primitive_desc describe(const GemmShape& shape) {
  const auto a = matrix(shape.m, shape.k, shape.operands, shape.transposed);
  const auto b = operand_b(shape);
  const auto bias = shape.bias ? matrix(1, shape.n, DType::fp32) : dnnl::memory::desc();
  const auto c = matrix(shape.m, shape.n, shape.result);
#if DNNL_VERSION_MAJOR >= 3
  return {engine(), a, b, bias, c, attributes(shape)};
#else
  return {dnnl::matmul::desc(a, b, bias, c), attributes(shape), engine()};
#endif
}

// A product with a packed B may choose its order; other products take it as it is.
dnnl::memory::desc operand_b(const GemmShape& shape) {
  if (shape.packed_for == 0) return matrix(shape.k, shape.n, shape.operands);
  if (shape.packed_for == shape.m) {
    return {{shape.k, shape.n}, data_type(shape.operands), dnnl::memory::format_tag::any};
  }
  GemmShape chooser = shape;
  chooser.m = shape.packed_for;
  return describe(chooser).weights_desc();
}

dnnl::memory view(const dnnl::memory::desc& desc, const void* data) {
  return {desc, engine(), const_cast<void*>(data)};
}

dnnl::stream& stream() {
  thread_local dnnl::stream own(engine());
  return own;
}

// Each thread's own working memory, as large as the largest product so far needed.
void* scratchpad(size_t bytes) {
  thread_local Tensor<std::byte> memory;
  memory.resize({static_cast<int64_t>(bytes)});
  return memory.data();
}

}  // namespace

struct Gemm::Compiled {
  explicit Compiled(const GemmShape& shape) : description(describe(shape)), primitive(description) {}
  dnnl::matmul::primitive_desc description;
  dnnl::matmul primitive;
  dnnl::memory::desc a = description.src_desc();
  dnnl::memory::desc b = description.weights_desc();
  dnnl::memory::desc bias = description.bias_desc();
  dnnl::memory::desc c = description.dst_desc();
  dnnl::memory::desc scratch = description.scratchpad_desc();
};

Gemm::Gemm(const GemmShape& shape) {
  const OneThread one_thread;
  compiled_ = std::make_unique<const Compiled>(shape);
}

Gemm::~Gemm() = default;

int64_t Gemm::packed_bytes() const { return static_cast<int64_t>(compiled_->b.get_size()); }

void Gemm::pack(const float* b, int64_t row_stride, int64_t column_stride, void* packed) const {
  const OneThread one_thread;
  const dnnl::memory::desc from(dims_of(compiled_->b), dnnl::memory::data_type::f32,
                                dnnl::memory::dims{row_stride, column_stride});
  dnnl::primitive_attr attributes;
  attributes.set_scratchpad_mode(dnnl::scratchpad_mode::user);
  const dnnl::reorder::primitive_desc description(engine(), from, engine(), compiled_->b, attributes);
  const dnnl::memory::desc scratch = description.scratchpad_desc();
  dnnl::reorder(description)
      .execute(stream(), {{DNNL_ARG_FROM, view(from, b)},
                          {DNNL_ARG_TO, view(compiled_->b, packed)},
                          {DNNL_ARG_SCRATCHPAD, view(scratch, scratchpad(scratch.get_size()))}});
  stream().wait();
}

// The operands of a product as oneDNN's objects. Each thread creates its own once, because creation costs
// more than a small product.
struct Gemm::Arguments {
  explicit Arguments(const Compiled& p)
      : a(view(p.a, nullptr)),
        b(view(p.b, nullptr)),
        bias(p.bias.is_zero() ? dnnl::memory() : view(p.bias, nullptr)),
        c(view(p.c, nullptr)),
        scratch(view(p.scratch, nullptr)),
        all{{DNNL_ARG_SRC, a},
            {DNNL_ARG_WEIGHTS, b},
            {DNNL_ARG_BIAS, bias},
            {DNNL_ARG_DST, c},
            {DNNL_ARG_SCRATCHPAD, scratch}} {
    if (p.bias.is_zero()) all.erase(DNNL_ARG_BIAS);
  }
  dnnl::memory a, b, bias, c, scratch;
  std::unordered_map<int, dnnl::memory> all;
};

void Gemm::run(const void* a, const void* b, const float* bias, void* c) const {
  const OneThread one_thread;
  const Compiled& p = *compiled_;
  thread_local std::unordered_map<const Compiled*, Arguments> made;
  Arguments& arguments = made.try_emplace(&p, p).first->second;
  arguments.a.set_data_handle(const_cast<void*>(a));
  arguments.b.set_data_handle(const_cast<void*>(b));
  if (bias != nullptr) arguments.bias.set_data_handle(const_cast<float*>(bias));
  arguments.c.set_data_handle(c);
  arguments.scratch.set_data_handle(scratchpad(p.scratch.get_size()));
  p.primitive.execute(stream(), arguments.all);
  stream().wait();
}

const Gemm& gemm(const GemmShape& shape) {
  static std::mutex mutex;
  static std::map<GemmShape, std::unique_ptr<const Gemm>> compiled;
  const std::lock_guard lock(mutex);
  std::unique_ptr<const Gemm>& entry = compiled[shape];
  if (!entry) entry.reset(new Gemm(shape));
  return *entry;
}

bool bf16_is_fast() {
  const auto needed = static_cast<unsigned>(dnnl::cpu_isa::avx512_core_bf16);
  return (static_cast<unsigned>(dnnl::get_effective_cpu_isa()) & needed) == needed;
}

}  // namespace traceflow::field
