#pragma once

#include <cublasLt.h>
#include <dlfcn.h>

#include <string>

// cuBLASLt, loaded on first use. The library is half a gigabyte: programs that use only the CPU need not load
// it, nor have it installed.
namespace traceflow::cuda {

class CublasLt {
 public:
  // The library, searched for once; why_not() is the reason if it was not found.
  static const CublasLt& instance() {
    static const CublasLt library;
    return library;
  }
  bool found() const { return missing_.empty(); }
  const std::string& why_not() const { return missing_; }

  decltype(&::cublasLtCreate) create = nullptr;
  decltype(&::cublasLtGetStatusString) status_string = nullptr;
  decltype(&::cublasLtMatmul) matmul = nullptr;
  decltype(&::cublasLtMatmulAlgoGetHeuristic) heuristic = nullptr;
  decltype(&::cublasLtMatmulDescCreate) create_operation = nullptr;
  decltype(&::cublasLtMatmulDescSetAttribute) set_operation = nullptr;
  decltype(&::cublasLtMatmulPreferenceCreate) create_preference = nullptr;
  decltype(&::cublasLtMatmulPreferenceSetAttribute) set_preference = nullptr;
  decltype(&::cublasLtMatmulPreferenceDestroy) destroy_preference = nullptr;
  decltype(&::cublasLtMatrixLayoutCreate) create_layout = nullptr;
  decltype(&::cublasLtMatrixLayoutSetAttribute) set_layout = nullptr;

 private:
  CublasLt() {
    // The version of the headers, first by the loader's search path, then in the toolkit's folder.
    const std::string name = "libcublasLt.so." + std::to_string(CUBLAS_VER_MAJOR);
    library_ = dlopen(name.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library_ == nullptr) library_ = dlopen((TRACEFLOW_CUDA_LIBRARIES "/" + name).c_str(), RTLD_NOW);
    if (library_ == nullptr) {
      missing_ = name + " is not there; it comes with the CUDA toolkit";
      return;
    }
    find(create, "cublasLtCreate");
    find(status_string, "cublasLtGetStatusString");
    find(matmul, "cublasLtMatmul");
    find(heuristic, "cublasLtMatmulAlgoGetHeuristic");
    find(create_operation, "cublasLtMatmulDescCreate");
    find(set_operation, "cublasLtMatmulDescSetAttribute");
    find(create_preference, "cublasLtMatmulPreferenceCreate");
    find(set_preference, "cublasLtMatmulPreferenceSetAttribute");
    find(destroy_preference, "cublasLtMatmulPreferenceDestroy");
    find(create_layout, "cublasLtMatrixLayoutCreate");
    find(set_layout, "cublasLtMatrixLayoutSetAttribute");
  }
  template <class F>
  void find(F& function, const char* name) {
    function = reinterpret_cast<F>(dlsym(library_, name));
    if (function == nullptr) missing_ = std::string("cuBLASLt has no ") + name;
  }

  void* library_ = nullptr;  // kept until the program ends
  std::string missing_;
};

}  // namespace traceflow::cuda
