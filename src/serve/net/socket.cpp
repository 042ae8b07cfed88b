#include "serve/net/socket.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/stream.hpp>

#include "serve/net/answer.h"
#include "serve/net/mailbox.h"
#include "serve/net/steps.h"

namespace traceflow::serve {

// Beast's last step on a connection that is over. Its own would wait for the other side without end; see
// Farewell.
template <class Handler>
void async_teardown(boost::beast::role_type /*role*/, Stream& stream, Handler&& handler) {
  boost::asio::post(stream.get_executor(),
                    [done = std::forward<Handler>(handler)]() mutable { done(boost::system::error_code()); });
}

namespace {

namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

// Messages go in pieces, so that between two of them a sign of life has room, and a deadline for each tells a
// slow line from a dead one.
constexpr size_t piece_bytes = 256 << 10;

class Socket final : public Session, public std::enable_shared_from_this<Socket> {
 public:
  Socket(Stream stream, Common& common, ParsedRequest request)
      : stream_(std::move(stream)),
        common_(common),
        deadline_(stream_.get_executor()),
        request_(std::move(request)) {}

  void start() {
    websocket::stream_base::timeout times{};
    times.handshake_timeout = common_.limits.request;
    times.idle_timeout = common_.limits.silence;
    times.keep_alive_pings = true;
    stream_.set_option(times);
    stream_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set("Server", "traceflow");
      for (const Field& field : safety_fields()) {
        response.set(boost::beast::string_view(field.name.data(), field.name.size()),
                     boost::beast::string_view(field.value.data(), field.value.size()));
      }
    }));
    stream_.read_message_max(common_.limits.message_bytes);
    stream_.auto_fragment(false);
    stream_.async_accept(request_, step(*this, &Socket::on_accepted));
  }

  void end() override {
    leave();
    deadline_.clear();
    error_code ignored;
    stream_.next_layer().close(ignored);
  }
  bool known() const override { return true; }

 private:
  void on_accepted(error_code error) {
    if (error) return end();
    guest_ = ++common_.guests;
    // Nobody but the network's thread touches this session: others only ask it to look into the mailbox.
    const auto look = [weak = weak_from_this(), executor = stream_.get_executor()] {
      asio::post(executor, [weak] {
        if (const auto self = weak.lock()) step(*self, &Socket::flush)({});
      });
    };
    mailbox_ = std::make_shared<Mailbox>(common_.limits.waiting_messages, common_.limits.waiting_bytes, look);
    const Send send = [mailbox = mailbox_](Outgoing message) { mailbox->put(std::move(message)); };
    if (tell([&](Room& room) { room.enter(guest_, send); })) read();
  }

  void read() { stream_.async_read(heard_, step(*this, &Socket::on_heard)); }

  void on_heard(error_code error) {
    if (error) return say_farewell();
    if (!mailbox_) return;
    if (stream_.got_binary()) return close(websocket::close_code::unknown_data, "messages are text");
    const std::string_view text(static_cast<const char*>(heard_.data().data()), heard_.size());
    if (!tell([&](Room& room) { room.hear(guest_, text); })) return;
    heard_.consume(heard_.size());
    read();
  }

  void flush(error_code /*none*/) {
    if (!mailbox_) return;
    if (mailbox_->overflowed()) return end();
    if (sending_.bytes) return;
    auto next = mailbox_->take();
    if (!next) return;
    sending_ = std::move(*next);
    sent_ = 0;
    stream_.binary(sending_.binary);
    send_piece();
  }

  void send_piece() {
    const size_t size = std::min(piece_bytes, sending_.bytes->size() - sent_);
    const auto piece = asio::buffer(sending_.bytes->data() + sent_, size);
    sent_ += size;
    deadline_.set(common_.limits.piece, weak_from_this());
    stream_.async_write_some(sent_ == sending_.bytes->size(), piece, step(*this, &Socket::on_sent));
  }

  void on_sent(error_code error) {
    if (!mailbox_) return;
    deadline_.clear();
    if (error) return end();
    if (sent_ < sending_.bytes->size()) return send_piece();
    sending_ = {};
    flush({});
  }

  // False, and the connection is being closed, where the room could not bear it.
  template <class Message>
  bool tell(Message message) {
    try {
      message(common_.room);
      return true;
    } catch (const std::exception& problem) {
      close(websocket::close_code::internal_error, problem.what());
      return false;
    }
  }

  void close(websocket::close_code code, std::string_view why) {
    leave();
    deadline_.set(common_.limits.linger, weak_from_this());
    websocket::close_reason reason(code);
    size_t size = std::min(why.size(), reason.reason.max_size());
    // Not in the middle of a character.
    while (size < why.size() && size > 0 && (static_cast<unsigned char>(why[size]) & 0xC0) == 0x80) --size;
    reason.reason.assign(why.data(), size);
    stream_.async_close(reason, step(*this, &Socket::on_closed));
  }

  void on_closed(error_code /*any*/) { say_farewell(); }

  void say_farewell() {
    leave();
    deadline_.set(common_.limits.linger, weak_from_this());
    farewell_.begin(*this, stream_.next_layer());
  }

  void leave() {
    if (!mailbox_) return;
    mailbox_->close();
    mailbox_.reset();
    try {
      common_.room.leave(guest_);
    } catch (...) {  // it is gone either way
    }
  }

  websocket::stream<Stream, false> stream_;  // false: without compression, as pictures are compressed already
  Common& common_;
  Deadline deadline_;  // of a piece, then of the end
  Farewell<Socket> farewell_;
  ParsedRequest request_;
  boost::beast::flat_buffer heard_;
  uint64_t guest_ = 0;
  std::shared_ptr<Mailbox> mailbox_;  // while it is a guest
  Outgoing sending_;                  // what is being written
  size_t sent_ = 0;                   // of it
};

}  // namespace

std::shared_ptr<Session> start_socket(Stream stream, Common& common, ParsedRequest request) {
  auto socket = std::make_shared<Socket>(std::move(stream), common, std::move(request));
  socket->start();
  return socket;
}

}  // namespace traceflow::serve
