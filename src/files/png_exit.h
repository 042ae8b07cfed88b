#pragma once

#include <png.h>

#include <array>
#include <cstdio>
#include <new>

// How libpng leaves: by longjmp, which skips destructors. What owns memory lives outside the jump.
namespace traceflow {

struct PngExit {
  std::array<char, 200> text{};
  bool out_of_memory = false;

  [[noreturn]] static void leave(png_structp png, png_const_charp text) {
    auto* exit = static_cast<PngExit*>(png_get_error_ptr(png));
    std::snprintf(exit->text.data(), exit->text.size(), "%s", text);
    png_longjmp(png, 1);
  }
  static void ignore(png_structp, png_const_charp) {}
  // libpng's own memory, so that its want is told from a picture that is broken.
  static png_voidp take_memory(png_structp png, png_alloc_size_t size) {
    void* memory = ::operator new(size, std::nothrow);
    if (memory == nullptr) static_cast<PngExit*>(png_get_mem_ptr(png))->out_of_memory = true;
    return memory;
  }
  static void give_back(png_structp, png_voidp memory) { ::operator delete(memory); }

  // After a jump that there was no memory for.
  void throw_if_out_of_memory() const {
    if (out_of_memory) throw std::bad_alloc();
  }
};

}  // namespace traceflow
