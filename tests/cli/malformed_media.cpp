#include <zlib.h>

#include "cli/malformed_cases.h"
#include "support/jpeg_writer.h"
#include "support/zip_writer.h"

namespace traceflow::cli {

namespace {

const std::vector<std::string> inspect_zip = {"inspect", "-d", "capture.zip"};
const std::string photograph = "capture/rgb/1x/a.png", prior = "capture/normal/1x/a.png",
                  archive = "capture.zip";

std::string big_endian(uint64_t value) {
  std::string bytes = little_endian(value, 4);
  return {bytes.rbegin(), bytes.rend()};
}

std::string chunk(const std::string& kind, const std::string& data) {
  const std::string body = kind + data;
  const uLong checksum =
      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()));
  return big_endian(data.size()) + body + big_endian(checksum);
}

// Eight bits, RGB.
std::string png_of_size(uint64_t width, uint64_t height) {
  return "\x89PNG\r\n\x1a\n" +
         chunk("IHDR", big_endian(width) + big_endian(height) + std::string("\x08\x02\0\0\0", 5)) +
         chunk("IDAT", "x") + chunk("IEND", "");
}

std::string jpeg(J_COLOR_SPACE stored, int components) {
  JpegKind kind;
  kind.stored = stored;
  kind.luma_wide = kind.luma_high = 1;
  return jpeg_of_kind(kind, 24, 16, components,
                      std::vector<unsigned char>(static_cast<size_t>(24 * 16 * components)));
}

std::function<void(Files&)> jpeg_prior(const std::string& bytes) { return put(prior, bytes); }

// The capture in an archive, with what follows changed in it.
std::function<void(Files&)> packed(const std::function<void(std::string&)>& change,
                                   bool deflate_them = true) {
  return [=](Files& files) {
    std::vector<std::pair<std::string, std::string>> members;
    for (const auto& [name, bytes] : files) {
      if (name.starts_with("capture/")) members.emplace_back(name, bytes);
    }
    files[archive] = zip_archive(members, deflate_them);
    change(files[archive]);
  };
}

std::function<void(Files&)> members(const std::vector<std::pair<std::string, std::string>>& list) {
  return put(archive, zip_archive(list, true));
}

// In the directory's first entry, at this place of it.
std::function<void(std::string&)> in_directory(size_t at, const std::string& bytes) {
  return [=](std::string& zip) { zip.replace(zip.find("PK\1\2") + at, bytes.size(), bytes); };
}

}  // namespace

MalformedKind malformed_images() {
  const std::string cmyk = jpeg(JCS_CMYK, 4), whole = jpeg(JCS_YCbCr, 3);
  return {"Images",
          {{"an empty photograph", inspect_capture, put(photograph, ""),
            "capture/rgb/1x/a.png: found an empty file, expected a PNG or JPEG image; convert it"},
           {"text for a photograph", inspect_capture, put(photograph, "<html>"),
            "capture/rgb/1x/a.png: found a file that begins with \"<html>\", expected a PNG or JPEG image; "
            "convert it"},
           {"a photograph in an unsupported format", inspect_capture, put(photograph, "GIF89a\1\1"),
            "capture/rgb/1x/a.png: found a GIF image, expected a PNG or JPEG image; convert it"},
           {"a photograph cut short in its header", inspect_capture, cut(photograph, 20),
            "capture/rgb/1x/a.png: found the file is cut short, expected a PNG image of at most 32,768 "
            "pixels a side and 2²⁸ in all; write or copy the file again"},
           {"a photograph of zero width", inspect_capture, put(photograph, png_of_size(0, 16)),
            "capture/rgb/1x/a.png: width: found 0, expected 1 to 32768 pixels; write or copy the file again"},
           {"a photograph over the width limit", inspect_capture, put(photograph, png_of_size(40000, 16)),
            "capture/rgb/1x/a.png: width: found 40000, expected 1 to 32768 pixels; scale the image down"},
           {"a photograph over the pixel limit", inspect_capture, put(photograph, png_of_size(32768, 32768)),
            "capture/rgb/1x/a.png: found 32768×32768, expected a PNG image of at most 32,768 pixels a side "
            "and 2²⁸ in all; write or copy the file again"},
           {"a photograph smaller than its camera says",
            {"inspect", "-d", "capture", "--set", "capture.downscale=32"},
            [](Files&) {},
            "capture/rgb/1x/a.png: size: found 24×16, expected at least 32 pixels a side; use a smaller "
            "--downscale"},
           {"a PNG shorter than its header says", inspect_capture, put(prior, png_of_size(16384, 16384)),
            "capture/normal/1x/a.png: found a file too short for an image of 16384×16384, expected a PNG "
            "image of at most 32,768 pixels a side and 2²⁸ in all; write or copy the file again"},
           {"a PNG cut short", inspect_capture, cut(prior, 300),
            "capture/normal/1x/a.png: found the file is cut short, expected a PNG image of at most 32,768 "
            "pixels a side and 2²⁸ in all; write or copy the file again"},
           {"a PNG with a byte changed", inspect_capture, [](Files& files) { files.at(prior)[100] ^= 1; },
            "capture/normal/1x/a.png: found IDAT: incorrect data check, expected a PNG image of at most "
            "32,768 pixels a side and 2²⁸ in all; write or copy the file again"},
           {"a grey PNG for normals", inspect_capture,
            [](Files& files) { files.at(prior) = jpeg(JCS_GRAYSCALE, 1); },
            "capture/normal/1x/a.png: channels: found 1, expected 3 (normals as 2v - 1)"},
           {"a JPEG cut short", inspect_capture, jpeg_prior(whole.substr(0, whole.size() - 40)),
            "capture/normal/1x/a.png: found a file that is cut short, expected a JPEG image, grey or RGB, of "
            "at most 32,768 pixels a side and 2²⁸ in all; write or copy the file again"},
           {"a CMYK JPEG", inspect_capture, jpeg_prior(cmyk),
            "capture/normal/1x/a.png: found CMYK colours, expected a JPEG image, grey or RGB, "
            "of at most 32,768 pixels a side and 2²⁸ in all; write or copy the file again"},
           {"a JPEG without image data", inspect_capture, jpeg_prior(whole.substr(0, 30)),
            "capture/normal/1x/a.png: found a file that is cut short, expected a JPEG image, grey or RGB, of "
            "at most 32,768 pixels a side and 2²⁸ in all; write or copy the file again"}}};
}

MalformedKind malformed_archives() {
  return {
      "Archives: .zip",
      {{"another file type", inspect_zip, put(archive, "Rar!\x1a\7"),
        "capture.zip: found a file that is not a zip archive, expected a whole zip archive, stored or "
        "deflated; "
        "pack or save "
        "it again"},
       {"cut short", inspect_zip, packed([](std::string& zip) { zip.resize(zip.size() / 2); }),
        "capture.zip: found a zip archive whose end is missing, expected a whole zip archive, stored or "
        "deflated; pack or save "
        "it again"},
       {"an encrypted member", inspect_zip, packed(in_directory(8, std::string("\1\0", 2))),
        "capture.zip: found an encrypted zip member, expected a whole zip archive, stored or deflated; pack "
        "or save it again"},
       {"an unsupported compression method", inspect_zip, packed(in_directory(10, std::string("\x0e\0", 2))),
        "capture.zip: found zip compression method 14, expected a whole zip archive, stored or deflated; "
        "pack or save it again"},
       {"a member outside the archive", inspect_zip, packed(in_directory(42, "\xff\xff\xff\x7f")),
        "capture.zip: found a zip record outside the file, expected a whole zip archive, stored or deflated; "
        "pack or save it again"},
       {"a path that leads out", inspect_zip, members({{"../dataset.json", "{}"}}),
        "capture.zip: found a member \"../dataset.json\", expected members inside the archive's own folder; "
        "pack the archive again"},
       {"an absolute path", inspect_zip, members({{"/etc/passwd", "{}"}}),
        "capture.zip: found a member \"/etc/passwd\", expected members inside the archive's own folder; pack "
        "the archive again"},
       {"a Windows path", inspect_zip, members({{"..\\dataset.json", "{}"}}),
        "capture.zip: found a member \"..\\dataset.json\", expected members inside the archive's own folder; "
        "pack the archive again"},
       {"a name with a zero byte", inspect_zip, members({{std::string("a\0b", 3), "{}"}}),
        "capture.zip: found a member \"a?b\", expected members inside the archive's own folder; pack the "
        "archive again"},
       {"two members with one name", inspect_zip, members({{"dataset.json", "{}"}, {"./dataset.json", "[]"}}),
        "capture.zip: found two members dataset.json, expected each name once; pack the archive again"},
       {"overlapping members", inspect_zip,
        [](Files& files) {
          std::string& zip = files[archive] = zip_archive({{"a", "12"}, {"b", "3"}}, false);
          const size_t second = zip.rfind("PK\1\2");
          zip.replace(second + 42, 4, std::string(4, '\0'));
        },
        "capture.zip: found overlapping zip members, expected a whole zip archive, stored or "
        "deflated; pack or save it again"},
       {"a member with an impossible size", inspect_zip, packed(in_directory(24, "\xff\xff\xff\x7f")),
        "capture.zip: found a zip member of 100 bytes that unpacks to 2147483647, expected a whole zip "
        "archive, stored or deflated; pack or save it again"},
       {"a member with a byte changed", inspect_zip, packed([](std::string& zip) {
          const std::string name = "capture/dataset.json";
          zip[zip.find(name) + name.size() + 12] ^= 1;
        }),
        "capture.zip: found a zip member with a wrong checksum, expected a whole zip archive, "
        "stored or deflated; pack or save it again"}}};
}

}  // namespace traceflow::cli
