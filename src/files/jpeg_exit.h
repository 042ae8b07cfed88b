#pragma once

#include <array>
#include <csetjmp>
#include <cstdio>
#include <new>

// libjpeg's header requires those above.
#include <jpeglib.h>
// The macros of its errors.
#include <jerror.h>

// Error handling for libjpeg, which leaves by longjmp and so skips destructors. Objects that own memory are
// outside the jump. The library passes back pointers to its own structs, so each is the first member of a
// struct of ours.
namespace traceflow {

struct JpegExit {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
  std::array<char, JMSG_LENGTH_MAX> text;

  // Directs the library's errors to this object and drops its messages.
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

  // Call after a jump. Throws if the cause was a lack of memory.
  void throw_if_out_of_memory() const {
    if (manager.msg_code == JERR_OUT_OF_MEMORY) throw std::bad_alloc();
  }
};

}  // namespace traceflow
