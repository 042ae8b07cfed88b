#include "serve/net/websocket_session.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/websocket/stream.hpp>

#include "serve/net/answer.h"
#include "serve/net/mailbox.h"
#include "serve/net/steps.h"

namespace traceflow::serve {

// Beast calls this to tear down a closed connection. Its default waits for the client without a time limit;
// LingeringClose has one.
template <class Handler>
void async_teardown(boost::beast::role_type /*role*/, Stream& stream, Handler&& handler) {
  boost::asio::post(stream.get_executor(),
                    [done = std::forward<Handler>(handler)]() mutable { done(boost::system::error_code()); });
}

namespace {

namespace asio = boost::asio;
namespace websocket = boost::beast::websocket;
using boost::system::error_code;

// Messages are sent in fragments, so that pings fit between them and a deadline for each fragment
// distinguishes a slow connection from a dead one.
constexpr size_t piece_bytes = 256 << 10;

class WebSocketSession final : public Session, public std::enable_shared_from_this<WebSocketSession> {
 public:
  WebSocketSession(Stream stream, SharedState& shared, ParsedRequest request)
      : stream_(std::move(stream)),
        shared_(shared),
        deadline_(stream_.get_executor()),
        request_(std::move(request)) {}

  void start() {
    websocket::stream_base::timeout times{};
    times.handshake_timeout = shared_.limits.request;
    times.idle_timeout = shared_.limits.silence;
    times.keep_alive_pings = true;
    stream_.set_option(times);
    stream_.set_option(websocket::stream_base::decorator([](websocket::response_type& response) {
      response.set("Server", "traceflow");
      for (const Field& field : safety_fields()) {
        response.set(boost::beast::string_view(field.name.data(), field.name.size()),
                     boost::beast::string_view(field.value.data(), field.value.size()));
      }
    }));
    stream_.read_message_max(shared_.limits.message_bytes);
    stream_.auto_fragment(false);
    stream_.async_accept(request_, step(*this, &WebSocketSession::on_accepted));
  }

  void end() override {
    on_disconnect();
    deadline_.clear();
    error_code ignored;
    stream_.next_layer().close(ignored);
  }
  bool is_authenticated() const override { return true; }

 private:
  void on_accepted(error_code error) {
    if (error) return end();
    client_ = ++shared_.clients;
    // Only the network thread touches this session. Other threads post a request to flush the mailbox.
    const auto wake = [weak = weak_from_this(), executor = stream_.get_executor()] {
      asio::post(executor, [weak] {
        if (const auto self = weak.lock()) step(*self, &WebSocketSession::flush)({});
      });
    };
    mailbox_ = std::make_shared<Mailbox>(shared_.limits.waiting_messages, shared_.limits.waiting_bytes, wake);
    const Send send = [mailbox = mailbox_](Outgoing message) { mailbox->put(std::move(message)); };
    if (notify([&](MessageHandler& handler) { handler.on_connect(client_, send); })) read();
  }

  void read() { stream_.async_read(received_, step(*this, &WebSocketSession::on_read)); }

  void on_read(error_code error) {
    if (error) return linger();
    if (!mailbox_) return;
    if (stream_.got_binary()) return close(websocket::close_code::unknown_data, "messages are text");
    const std::string_view text(static_cast<const char*>(received_.data().data()), received_.size());
    if (!notify([&](MessageHandler& handler) { handler.on_message(client_, text); })) return;
    received_.consume(received_.size());
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
    deadline_.set(shared_.limits.piece, weak_from_this());
    stream_.async_write_some(sent_ == sending_.bytes->size(), piece, step(*this, &WebSocketSession::on_sent));
  }

  void on_sent(error_code error) {
    if (!mailbox_) return;
    deadline_.clear();
    if (error) return end();
    if (sent_ < sending_.bytes->size()) return send_piece();
    sending_ = {};
    flush({});
  }

  // Returns false if the handler throws; the connection is then being closed.
  template <class Message>
  bool notify(Message message) {
    try {
      message(shared_.handler);
      return true;
    } catch (const std::exception& problem) {
      close(websocket::close_code::internal_error, problem.what());
      return false;
    }
  }

  void close(websocket::close_code code, std::string_view why) {
    on_disconnect();
    deadline_.set(shared_.limits.linger, weak_from_this());
    websocket::close_reason reason(code);
    size_t size = std::min(why.size(), reason.reason.max_size());
    // Does not split a UTF-8 character.
    while (size < why.size() && size > 0 && (static_cast<unsigned char>(why[size]) & 0xC0) == 0x80) --size;
    reason.reason.assign(why.data(), size);
    stream_.async_close(reason, step(*this, &WebSocketSession::on_closed));
  }

  void on_closed(error_code /*any*/) { linger(); }

  void linger() {
    on_disconnect();
    deadline_.set(shared_.limits.linger, weak_from_this());
    lingering_close_.begin(*this, stream_.next_layer());
  }

  void on_disconnect() {
    if (!mailbox_) return;
    mailbox_->close();
    mailbox_.reset();
    try {
      shared_.handler.on_disconnect(client_);
    } catch (...) {  // the client has disconnected in any case
    }
  }

  websocket::stream<Stream, false> stream_;  // false: no compression, since pictures are already compressed
  SharedState& shared_;
  Deadline deadline_;  // of a fragment, then of the close
  LingeringClose<WebSocketSession> lingering_close_;
  ParsedRequest request_;
  boost::beast::flat_buffer received_;
  uint64_t client_ = 0;
  std::shared_ptr<Mailbox> mailbox_;  // while the client is connected
  Outgoing sending_;                  // the message being sent
  size_t sent_ = 0;                   // bytes of it
};

}  // namespace

std::shared_ptr<Session> start_websocket_session(Stream stream, SharedState& shared, ParsedRequest request) {
  auto session = std::make_shared<WebSocketSession>(std::move(stream), shared, std::move(request));
  session->start();
  return session;
}

}  // namespace traceflow::serve
