#pragma once

#include <zlib.h>

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace traceflow {

inline std::string little_endian(uint64_t value, int width) {
  std::string bytes;
  for (int i = 0; i < width; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xff);
  return bytes;
}

inline std::string deflated(const std::string& data, int level = 6) {
  z_stream stream{};
  deflateInit2(&stream, level, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, data.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(data.data()));
  stream.avail_in = static_cast<uInt>(data.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

// A zip archive written independently of the reader, after the format's description. `zip64` puts the sizes
// into the extra field as numpy.savez does.
inline std::string zip_archive(const std::vector<std::pair<std::string, std::string>>& members,
                               bool deflate_them, bool zip64 = false) {
  std::string body, directory;
  for (const auto& [name, data] : members) {
    const std::string stored = deflate_them ? deflated(data) : data;
    const std::string method = little_endian(deflate_them ? 8 : 0, 2);
    const std::string extra = zip64 ? little_endian(1, 2) + little_endian(16, 2) +
                                          little_endian(data.size(), 8) + little_endian(stored.size(), 8)
                                    : "";
    const std::string sizes = zip64 ? little_endian(0xffffffff, 4) + little_endian(0xffffffff, 4)
                                    : little_endian(stored.size(), 4) + little_endian(data.size(), 4);
    const auto checksum =
        crc32(0, reinterpret_cast<const Bytef*>(data.data()), static_cast<uInt>(data.size()));
    const std::string common = little_endian(20, 2) + little_endian(0, 2) + method + little_endian(0, 4) +
                               little_endian(checksum, 4) + sizes + little_endian(name.size(), 2) +
                               little_endian(extra.size(), 2);
    directory += "PK\1\2" + little_endian(20, 2) + common + little_endian(0, 2) + little_endian(0, 2) +
                 little_endian(0, 2) + little_endian(0, 4) + little_endian(body.size(), 4) + name + extra;
    body += "PK\3\4" + common + name + extra + stored;
  }
  return body + directory + "PK\5\6" + little_endian(0, 4) + little_endian(members.size(), 2) +
         little_endian(members.size(), 2) + little_endian(directory.size(), 4) +
         little_endian(body.size(), 4) + little_endian(0, 2);
}

}  // namespace traceflow
