#pragma once

#include <png.h>

#include <array>
#include <cstdio>
#include <new>

// Error handling for libpng, which leaves by longjmp and so skips destructors. Objects that own memory are
// outside the jump.
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
  // Allocates for libpng, so that a lack of memory can be told from a broken image.
  static png_voidp take_memory(png_structp png, png_alloc_size_t size) {
    void* memory = ::operator new(size, std::nothrow);
    if (memory == nullptr) static_cast<PngExit*>(png_get_mem_ptr(png))->out_of_memory = true;
    return memory;
  }
  static void give_back(png_structp, png_voidp memory) { ::operator delete(memory); }

  // Call after a jump. Throws if the cause was a lack of memory.
  void throw_if_out_of_memory() const {
    if (out_of_memory) throw std::bad_alloc();
  }
};

}  // namespace traceflow
