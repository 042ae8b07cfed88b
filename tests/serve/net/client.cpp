#include "serve/net/client.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <stdexcept>

namespace traceflow::serve {

HttpClient::HttpClient(int port) : handle_(socket(AF_INET, SOCK_STREAM, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  const timeval patience{20, 0};
  setsockopt(handle_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  setsockopt(handle_, SOL_SOCKET, SO_SNDTIMEO, &patience, sizeof patience);
  if (connect(handle_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error("no connection");
  }
}

HttpClient::~HttpClient() {
  if (handle_ >= 0) close(handle_);
}

bool HttpClient::send(std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(handle_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(sent));
  }
  return true;
}

bool HttpClient::more() {
  std::array<char, 65536> bytes{};
  errno = 0;
  const ssize_t got = recv(handle_, bytes.data(), bytes.size(), 0);
  if (got <= 0) return false;
  unread_.append(bytes.data(), static_cast<size_t>(got));
  return true;
}

std::optional<std::string> HttpClient::bytes(size_t count) {
  while (unread_.size() < count) {
    if (!more()) return std::nullopt;
  }
  std::string result = unread_.substr(0, count);
  unread_.erase(0, count);
  return result;
}

std::optional<Reply> HttpClient::reply(bool body) {
  size_t end;
  while ((end = unread_.find("\r\n\r\n")) == std::string::npos) {
    if (!more()) return std::nullopt;
  }
  const std::string head = unread_.substr(0, end + 2);
  unread_.erase(0, end + 4);
  Reply reply;
  reply.status = std::stoi(head.substr(head.find(' ') + 1));
  for (size_t at = head.find("\r\n") + 2; at < head.size();) {
    const size_t line_end = head.find("\r\n", at);
    const size_t colon = head.find(": ", at);
    std::string name = head.substr(at, colon - at);
    for (char& c : name) c = static_cast<char>(std::tolower(c));
    std::string& value = reply.fields[name];
    value += (value.empty() ? "" : " | ") + head.substr(colon + 2, line_end - colon - 2);
    at = line_end + 2;
  }
  if (!body || !reply.fields.contains("content-length")) return reply;
  auto text = bytes(std::stoul(reply.fields["content-length"]));
  if (!text) return std::nullopt;
  reply.body = std::move(*text);
  return reply;
}

bool HttpClient::ends() {
  while (more()) unread_.clear();
  return errno != EAGAIN;  // the same as EWOULDBLOCK here
}

WebSocketClient::WebSocketClient(int port, const std::string& lines) : client_(port) {
  // The key and its answer are those of RFC 6455, section 1.3.
  client_.send(
      "GET /ws HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n" +
      lines + "\r\n");
  welcome_ = client_.reply();
}

bool WebSocketClient::send_frame(int opcode, std::string_view payload, bool last, bool masked) {
  std::string bytes(1, static_cast<char>((last ? 0x80 : 0) | opcode));
  const char mask_bit = static_cast<char>(masked ? 0x80 : 0);
  const size_t size = payload.size();
  const auto append_size = [&](int first, int count) {
    bytes += static_cast<char>(mask_bit | first);
    for (int i = count - 1; i >= 0; --i) bytes += static_cast<char>(size >> (8 * i) & 255);
  };
  if (size < 126) {
    append_size(static_cast<int>(size), 0);
  } else if (size < 65536) {
    append_size(126, 2);
  } else {
    append_size(127, 8);
  }
  if (!masked) return client_.send(bytes.append(payload));
  constexpr std::string_view mask = "\x12\x34\x56\x78";
  bytes += mask;
  for (size_t i = 0; i < size; ++i) bytes += static_cast<char>(payload[i] ^ mask[i % 4]);
  return client_.send(bytes);
}

std::optional<Frame> WebSocketClient::frame() {
  const auto head = client_.bytes(2);
  if (!head) return std::nullopt;
  const auto byte = [](char c) { return static_cast<unsigned char>(c); };
  Frame frame{byte((*head)[0]) & 15, (byte((*head)[0]) & 0x80) != 0, {}};
  size_t size = byte((*head)[1]);  // never masked by a server
  if (size >= 126) {
    const auto digits = client_.bytes(size == 126 ? 2 : 8);
    if (!digits) return std::nullopt;
    size = 0;
    for (const char c : *digits) size = size << 8 | byte(c);
  }
  auto payload = client_.bytes(size);
  if (!payload) return std::nullopt;
  frame.payload = std::move(*payload);
  return frame;
}

std::optional<Frame> WebSocketClient::message() {
  std::optional<Frame> whole;
  while (auto part = frame()) {
    if (part->opcode == 8) return part;
    if (part->opcode > 8) continue;
    if (whole) {
      whole->payload += part->payload;
      whole->last = part->last;
    } else {
      whole = std::move(part);
    }
    if (whole->last) return whole;
  }
  return std::nullopt;
}

}  // namespace traceflow::serve
