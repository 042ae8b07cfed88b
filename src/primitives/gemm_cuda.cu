#include "primitives/gemm.h"

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "base/device_memory.h"
#include "base/kernel.h"
#include "base/tensor.h"
#include "primitives/cublas_lt.h"

namespace traceflow::cuda {

namespace {

constexpr size_t workspace_bytes = size_t{32} << 20;
// Every address and row is a multiple of this, so that algorithms may rely on it.
constexpr uint32_t alignment = 16;

const CublasLt& lt() {
  const CublasLt& found = CublasLt::instance();
  require(found.found(), "cuBLASLt answers", found.why_not());
  return found;
}

void check_blas(cublasStatus_t result, const char* what) {
  if (result == CUBLAS_STATUS_ALLOC_FAILED) throw memory::OutOfMemory(0, facts().free_bytes);
  require(result == CUBLAS_STATUS_SUCCESS, what,
          result == CUBLAS_STATUS_SUCCESS ? "" : lt().status_string(result));
}

cudaDataType_t type_of(DType number) { return number == DType::bf16 ? CUDA_R_16BF : CUDA_R_32F; }

cublasLtEpilogue_t epilogue_of(const GemmDescription& p) {
  if (p.mask == Mask::read) return CUBLASLT_EPILOGUE_DRELU;
  if (p.mask == Mask::written) {
    return p.bias ? CUBLASLT_EPILOGUE_RELU_AUX_BIAS : CUBLASLT_EPILOGUE_RELU_AUX;
  }
  if (p.relu) return p.bias ? CUBLASLT_EPILOGUE_RELU_BIAS : CUBLASLT_EPILOGUE_RELU;
  return p.bias ? CUBLASLT_EPILOGUE_BIAS : CUBLASLT_EPILOGUE_DEFAULT;
}

// A product for the library, which is column-major: a row-major matrix is its own transpose there, and C =
// A·B becomes Cᵀ = Bᵀ·Aᵀ. So the library's first operand is B.
class Plan {
 public:
  explicit Plan(const GemmDescription& p, cublasLtHandle_t handle);
  Plan(const Plan&) = delete;
  Plan& operator=(const Plan&) = delete;

  bool found() const { return found_; }
  void run(const GemmDescription& p, const GemmAddresses& at, cublasLtHandle_t handle, void* workspace) const;

 private:
  template <class T>
  void set(cublasLtMatmulDescAttributes_t attribute, const T& value) const {
    check_blas(lt().set_operation(operation_, attribute, &value, sizeof(value)), "a product is described");
  }
  void point(const GemmDescription& p, const void* bias, const void* mask) const {
    if (p.bias) set(CUBLASLT_MATMUL_DESC_BIAS_POINTER, bias);
    if (p.mask != Mask::none) set(CUBLASLT_MATMUL_DESC_EPILOGUE_AUX_POINTER, mask);
  }
  void choose(cublasLtHandle_t handle);

  // Kept until the program ends.
  cublasLtMatmulDesc_t operation_ = nullptr;
  cublasLtMatrixLayout_t b_ = nullptr, a_ = nullptr, c_ = nullptr;
  cublasLtMatmulAlgo_t algorithm_{};
  bool found_ = false;
};

cublasLtMatrixLayout_t layout(DType number, int64_t stored_rows, int64_t stored_columns, int64_t stride,
                              int64_t batches, int64_t batch_stride) {
  cublasLtMatrixLayout_t made = nullptr;
  check_blas(lt().create_layout(&made, type_of(number), static_cast<uint64_t>(stored_columns),
                                static_cast<uint64_t>(stored_rows), stride),
             "a product's matrix is described");
  if (batches > 1) {
    const auto count = static_cast<int32_t>(batches);
    check_blas(lt().set_layout(made, CUBLASLT_MATRIX_LAYOUT_BATCH_COUNT, &count, sizeof(count)),
               "a product's batches are described");
    check_blas(lt().set_layout(made, CUBLASLT_MATRIX_LAYOUT_STRIDED_BATCH_OFFSET, &batch_stride,
                               sizeof(batch_stride)),
               "a product's batches are described");
  }
  return made;
}

Plan::Plan(const GemmDescription& p, cublasLtHandle_t handle) {
  check_blas(lt().create_operation(&operation_, CUBLAS_COMPUTE_32F, CUDA_R_32F), "a product is described");
  set(CUBLASLT_MATMUL_DESC_TRANSA, p.transposed_b ? CUBLAS_OP_T : CUBLAS_OP_N);
  set(CUBLASLT_MATMUL_DESC_TRANSB, p.transposed_a ? CUBLAS_OP_T : CUBLAS_OP_N);
  set(CUBLASLT_MATMUL_DESC_EPILOGUE, epilogue_of(p));
  if (p.mask != Mask::none) set(CUBLASLT_MATMUL_DESC_EPILOGUE_AUX_LD, p.mask_stride);
  // The library chooses algorithms by the alignment of addresses: these have the least alignment that run()
  // uses.
  const auto* const least_aligned = reinterpret_cast<const void*>(uintptr_t{alignment});
  point(p, least_aligned, least_aligned);
  b_ = layout(p.operands, p.transposed_b ? p.n : p.k, p.transposed_b ? p.k : p.n, p.stride_b, p.batches,
              p.batch_b);
  a_ = layout(p.operands, p.transposed_a ? p.k : p.m, p.transposed_a ? p.m : p.k, p.stride_a, p.batches,
              p.batch_a);
  c_ = layout(p.result, p.m, p.n, p.stride_c, p.batches, p.batch_c);
  choose(handle);
}

void Plan::choose(cublasLtHandle_t handle) {
  cublasLtMatmulPreference_t preference = nullptr;
  check_blas(lt().create_preference(&preference), "a product's preferences");
  const auto prefer = [&](cublasLtMatmulPreferenceAttributes_t attribute, const auto& value) {
    check_blas(lt().set_preference(preference, attribute, &value, sizeof(value)), "a product's preferences");
  };
  prefer(CUBLASLT_MATMUL_PREF_MAX_WORKSPACE_BYTES, uint64_t{workspace_bytes});
  // Partial sums meet in the workspace and are added in order, not atomically in the order of arrival.
  prefer(CUBLASLT_MATMUL_PREF_REDUCTION_SCHEME_MASK,
         uint32_t{CUBLASLT_REDUCTION_SCHEME_NONE | CUBLASLT_REDUCTION_SCHEME_COMPUTE_TYPE});
  for (const auto attribute :
       {CUBLASLT_MATMUL_PREF_MIN_ALIGNMENT_A_BYTES, CUBLASLT_MATMUL_PREF_MIN_ALIGNMENT_B_BYTES,
        CUBLASLT_MATMUL_PREF_MIN_ALIGNMENT_C_BYTES, CUBLASLT_MATMUL_PREF_MIN_ALIGNMENT_D_BYTES}) {
    prefer(attribute, alignment);
  }
  cublasLtMatmulHeuristicResult_t result{};
  int count = 0;
  const cublasStatus_t status =
      lt().heuristic(handle, operation_, b_, a_, c_, c_, preference, 1, &result, &count);
  lt().destroy_preference(preference);
  found_ = status == CUBLAS_STATUS_SUCCESS && count == 1 && result.state == CUBLAS_STATUS_SUCCESS;
  if (found_) algorithm_ = result.algo;
}

void Plan::run(const GemmDescription& p, const GemmAddresses& at, cublasLtHandle_t handle,
               void* workspace) const {
  point(p, at.bias, at.mask);
  const float one = 1, before = p.accumulate ? 1.0F : 0.0F;
  check_blas(lt().matmul(handle, operation_, &one, at.b, b_, at.a, a_, &before, at.c, c_, at.c, c_,
                         &algorithm_, workspace, workspace_bytes, stream()),
             "a matrix product on the CUDA device");
}

// The library's handle, its workspace and all plans made so far. It is never destroyed, since the device may
// already be gone when static objects are.
class Library {
 public:
  static Library& instance() {
    static Library* const library = new Library;
    return *library;
  }
  bool supported(const GemmDescription& gemm) {
    if (gemm.has_epilogue() && !allows_epilogues) return false;
    if (gemm.operands == DType::bf16 && !multiplies_bf16_) return false;
    return plan(gemm).found();
  }
  void multiply(const GemmDescription& gemm, const GemmAddresses& at) {
    const std::lock_guard lock(mutex_);
    const Plan& chosen = plan_locked(gemm);
    require(chosen.found(), "cuBLASLt has the product",
            std::to_string(gemm.m) + "×" + std::to_string(gemm.k) + "×" + std::to_string(gemm.n));
    const profile::Scope scope("matrix product");
    chosen.run(gemm, at, handle_, workspace_.data());
    if (profile::is_on()) synchronise();
  }

  bool allows_epilogues = true;

 private:
  Library() : workspace_({static_cast<int64_t>(workspace_bytes)}, Device::cuda) {
    check_blas(lt().create(&handle_), "cuBLASLt answers");
    int major = 0;
    traceflow::cuda::check(cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, 0),
                           "the CUDA device's compute capability");
    multiplies_bf16_ = major >= 8;
  }
  const Plan& plan(const GemmDescription& gemm) {
    const std::lock_guard lock(mutex_);
    return plan_locked(gemm);
  }
  const Plan& plan_locked(const GemmDescription& gemm) {
    std::unique_ptr<const Plan>& made = plans_[gemm];
    if (!made) made = std::make_unique<const Plan>(gemm, handle_);
    return *made;
  }

  std::mutex mutex_;
  cublasLtHandle_t handle_ = nullptr;
  // Older devices have no units for bf16, and the library's replacement is slower than fp32.
  bool multiplies_bf16_ = false;
  Tensor<std::byte> workspace_;
  std::map<GemmDescription, std::unique_ptr<const Plan>> plans_;
};

}  // namespace

bool cublas_lt_answers(std::string& why_not) {
  why_not = CublasLt::instance().why_not();
  return CublasLt::instance().found();
}
bool supported(const GemmDescription& gemm) { return Library::instance().supported(gemm); }
void multiply(const GemmDescription& gemm, const GemmAddresses& at) {
  Library::instance().multiply(gemm, at);
}
void allow_epilogues(bool allowed) { Library::instance().allows_epilogues = allowed; }

}  // namespace traceflow::cuda
