#include "files/zip.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <span>

#include "base/error.h"
#include "files/limits.h"

namespace traceflow {

namespace {

constexpr int64_t end_record_size = 22;
constexpr int64_t max_comment = 65535;
constexpr int64_t max_directory = int64_t{16} << 20;
constexpr uint32_t end_signature = 0x06054b50;
constexpr uint32_t end64_locator_signature = 0x07064b50;
constexpr uint32_t end64_signature = 0x06064b50;
constexpr uint32_t directory_signature = 0x02014b50;
constexpr uint32_t local_signature = 0x04034b50;
constexpr uint32_t in_zip64_16 = 0xffff;
constexpr uint32_t in_zip64_32 = 0xffffffff;

[[noreturn]] void fail(const InputFile& file, const std::string& found) {
  throw InputError(file.path().string(), "", found, "a whole zip archive, stored or deflated",
                   "pack or save it again");
}

// Reads little-endian numbers from a buffer; reading past its end means a broken archive.
class Bytes {
 public:
  Bytes(const InputFile& file, int64_t offset, int64_t count) : file_(file) {
    if (offset < 0 || count < 0 || offset > file.size() || count > file.size() - offset) {
      fail(file, "a zip record outside the file");
    }
    bytes_.resize(static_cast<size_t>(count));
    file.read_at(offset, bytes_);
  }
  int64_t size() const { return static_cast<int64_t>(bytes_.size()); }
  uint64_t number(int64_t at, int width) const {
    check(at, width);
    uint64_t value = 0;
    for (int i = width - 1; i >= 0; --i)
      value = value << 8 | std::to_integer<uint64_t>(bytes_[static_cast<size_t>(at + i)]);
    return value;
  }
  uint32_t u16(int64_t at) const { return static_cast<uint32_t>(number(at, 2)); }
  uint32_t u32(int64_t at) const { return static_cast<uint32_t>(number(at, 4)); }
  int64_t u64(int64_t at) const {
    const uint64_t value = number(at, 8);
    if (value > INT64_MAX) fail(file_, "a zip record of impossible size");
    return static_cast<int64_t>(value);
  }
  std::string text(int64_t at, int64_t count) const {
    check(at, count);
    return {reinterpret_cast<const char*>(bytes_.data()) + at, static_cast<size_t>(count)};
  }

 private:
  void check(int64_t at, int64_t count) const {
    if (at < 0 || at + count > size()) fail(file_, "a zip record that is cut short");
  }
  const InputFile& file_;
  std::vector<std::byte> bytes_;
};

struct Directory {
  int64_t offset, size;
};

Directory find_directory(const InputFile& file) {
  const int64_t tail = std::min(file.size(), end_record_size + max_comment);
  const int64_t tail_offset = file.size() - tail;
  const Bytes bytes(file, tail_offset, tail);
  for (int64_t at = tail - end_record_size; at >= 0; --at) {
    if (bytes.u32(at) != end_signature) continue;
    const Directory directory{bytes.u32(at + 16), bytes.u32(at + 12)};
    const bool zip64 =
        directory.offset == in_zip64_32 || directory.size == in_zip64_32 || bytes.u16(at + 10) == in_zip64_16;
    if (!zip64 || at < 20 || bytes.u32(at - 20) != end64_locator_signature) return directory;
    const Bytes end64(file, bytes.u64(at - 20 + 8), 56);
    if (end64.u32(0) != end64_signature) fail(file, "a broken zip64 record");
    return {end64.u64(48), end64.u64(40)};
  }
  const bool begins_as_one = bytes.size() >= 4 && Bytes(file, 0, 4).u32(0) == local_signature;
  fail(file, begins_as_one ? "a zip archive whose end is missing" : "a file that is not a zip archive");
}

// Sizes of 4 GiB and more are in an extra field, in a fixed order; it has only those that did not fit.
void apply_zip64(const Bytes& bytes, int64_t extra, int64_t extra_end, ZipMember& member, int64_t& header) {
  while (extra + 4 <= extra_end) {
    const uint32_t id = bytes.u16(extra);
    int64_t at = extra + 4;
    if (id == 1) {
      for (int64_t* field : {&member.size, &member.stored_size, &header}) {
        if (*field != in_zip64_32) continue;
        *field = bytes.u64(at);
        at += 8;
      }
      return;
    }
    extra = at + bytes.u16(extra + 2);
  }
}

void refuse_overlaps(const InputFile& file, std::vector<ZipMember> members) {
  std::ranges::sort(members, {}, &ZipMember::offset);
  for (size_t i = 1; i < members.size(); ++i) {
    const ZipMember& before = members[i - 1];
    if (members[i].offset < before.offset + std::max<int64_t>(before.stored_size, 1))
      fail(file, "overlapping zip members");
  }
}

}  // namespace

std::vector<ZipMember> list_zip(const InputFile& file) {
  const Directory directory = find_directory(file);
  if (directory.size > max_directory)
    fail(file, "a zip directory of " + std::to_string(directory.size) + " bytes");
  const Bytes bytes(file, directory.offset, directory.size);
  std::vector<ZipMember> members;
  for (int64_t at = 0; at + 46 <= bytes.size();) {
    if (bytes.u32(at) != directory_signature) fail(file, "a broken zip directory");
    const int64_t name = bytes.u16(at + 28), extra = bytes.u16(at + 30), comment = bytes.u16(at + 32);
    ZipMember member{bytes.text(at + 46, name), false, 0, bytes.u32(at + 20), bytes.u32(at + 24),
                     bytes.u32(at + 16)};
    int64_t header = bytes.u32(at + 42);
    apply_zip64(bytes, at + 46 + name, at + 46 + name + extra, member, header);
    const uint32_t method = bytes.u16(at + 10);
    if ((bytes.u16(at + 8) & 1U) != 0) fail(file, "an encrypted zip member");
    if (method != 0 && method != 8) fail(file, "zip compression method " + std::to_string(method));
    member.deflated = method == 8;
    const Bytes local(file, header, 30);
    if (local.u32(0) != local_signature) fail(file, "a broken zip member");
    member.offset = header + 30 + local.u16(26) + local.u16(28);
    if (member.offset > file.size() || member.stored_size > file.size() - member.offset ||
        (!member.deflated && member.size != member.stored_size)) {
      fail(file, "a zip member outside the file");
    }
    if (member.deflated && member.size / max_inflation > member.stored_size) {
      fail(file, "a zip member of " + std::to_string(member.stored_size) + " bytes that unpacks to " +
                     std::to_string(member.size));
    }
    members.push_back(member);
    at += 46 + name + extra + comment;
  }
  refuse_overlaps(file, members);
  return members;
}

namespace {

// Owns zlib's state.
struct Inflater {
  z_stream stream{};
  Inflater() {
    // Negative window bits: raw deflate, without zlib's own header.
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

void require_room(const InputFile& file, const ZipMember& member) {
  std::error_code error;
  const auto folder = std::filesystem::temp_directory_path(error);
  const auto room = std::filesystem::space(folder, error);
  if (error || static_cast<uintmax_t>(member.size) <= room.available) return;
  throw InputError(
      file.path().string(), member.name, std::to_string(member.size) + " bytes to unpack",
      "no more than the " + std::to_string(room.available) + " that " + folder.string() + " has room for",
      "set TMPDIR to a folder with space");
}

}  // namespace

InputFile inflate_to_scratch(const InputFile& file, const ZipMember& member) {
  constexpr size_t piece = size_t{1} << 18;
  require_room(file, member);
  std::vector<std::byte> input(piece), output(piece);
  InputFile scratch = InputFile::scratch(file.path());
  Inflater inflater;
  z_stream& stream = inflater.stream;
  int64_t consumed = 0;
  uLong checksum = crc32(0, nullptr, 0);
  for (int status = Z_OK; status != Z_STREAM_END;) {
    if (stream.avail_in == 0) {
      const auto count =
          static_cast<size_t>(std::min<int64_t>(static_cast<int64_t>(piece), member.stored_size - consumed));
      // `count` may be 0 while zlib still holds output that did not fit into the last piece.
      file.read_at(member.offset + consumed, std::span(input).first(count));
      consumed += static_cast<int64_t>(count);
      stream.next_in = reinterpret_cast<Bytef*>(input.data());
      stream.avail_in = static_cast<uInt>(count);
    }
    stream.next_out = reinterpret_cast<Bytef*>(output.data());
    stream.avail_out = static_cast<uInt>(piece);
    status = inflate(&stream, Z_NO_FLUSH);
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR)
      fail(file, "broken compressed data");
    const size_t made = piece - stream.avail_out;
    if (status == Z_BUF_ERROR && made == 0) fail(file, "compressed data that is cut short");
    if (scratch.size() + static_cast<int64_t>(made) > member.size)
      fail(file, "more data than the zip directory says");
    scratch.append(std::span(output).first(made));
    checksum = crc32(checksum, reinterpret_cast<const Bytef*>(output.data()), static_cast<uInt>(made));
  }
  if (scratch.size() != member.size || checksum != member.checksum)
    fail(file, "a zip member with a wrong checksum");
  return scratch;
}

}  // namespace traceflow
