#pragma once

#include <array>
#include <csetjmp>
#include <cstdio>
#include <new>

// libjpeg's header wants the above before it.
#include <jpeglib.h>
// Its macros for errors.
#include <jerror.h>

// How libjpeg leaves: by longjmp, which skips destructors. What owns memory lives outside the jump. The
// library hands back pointers to its own structs, which are therefore the first members of those that hold
// them.
namespace traceflow {

struct JpegExit {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
  std::array<char, JMSG_LENGTH_MAX> text;

  // Makes the library's errors end here; what it would print is dropped.
  jpeg_error_mgr* prepare() {
    jpeg_std_error(&manager);
    manager.error_exit = [](j_common_ptr info) { leave(info); };
    manager.output_message = [](j_common_ptr) {};
    return &manager;
  }
  [[noreturn]] static void leave(j_common_ptr info) {
    auto* exit = reinterpret_cast<JpegExit*>(info->err);
    (*info->err->format_message)(info, exit->text.data());
    std::longjmp(exit->jump, 1);
  }
  [[noreturn]] static void leave(j_common_ptr info, const char* text) {
    auto* exit = reinterpret_cast<JpegExit*>(info->err);
    std::snprintf(exit->text.data(), exit->text.size(), "%s", text);
    std::longjmp(exit->jump, 1);
  }

  // After a jump that there was no memory for.
  void throw_if_out_of_memory() const {
    if (manager.msg_code == JERR_OUT_OF_MEMORY) throw std::bad_alloc();
  }
};

}  // namespace traceflow
