#include "serve/net/http_session.h"

#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/read.hpp>

#include "serve/net/answer.h"
#include "serve/net/parser.h"
#include "serve/net/steps.h"
#include "serve/net/websocket_session.h"

namespace traceflow::serve {

namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;
using boost::system::error_code;

class HttpSession final : public Session, public std::enable_shared_from_this<HttpSession> {
 public:
  HttpSession(Stream stream, SharedState& shared, bool full)
      : stream_(std::move(stream)),
        shared_(shared),
        deadline_(stream_.get_executor()),
        buffer_(shared.limits.header_bytes),
        full_(full) {}

  void start() { read(); }

  void end() override {
    error_code ignored;
    stream_.close(ignored);
    deadline_.clear();
  }
  bool is_authenticated() const override { return is_authenticated_; }

 private:
  // One deadline for the whole request, so that slow clients cannot extend it.
  void read() {
    parser_.emplace();
    set_limits(*parser_, shared_.limits);
    deadline_.set(full_ ? shared_.limits.linger : shared_.limits.request, weak_from_this());
    http::async_read_header(stream_, buffer_, *parser_, step(*this, &HttpSession::on_request));
  }

  void on_request(error_code error) {
    if (error == http::error::header_limit || error == http::error::buffer_overflow) {
      return send(plain_answer(431, "The request is too long."), {});
    }
    // Malformed requests are answered; a closed connection is not.
    if (error && error.category() == http::make_error_code(http::error::bad_method).category() &&
        error != http::error::end_of_stream && error != http::error::partial_message) {
      return send(plain_answer(400, "The request cannot be read."), {});
    }
    if (error) return end();
    if (full_)
      return send(plain_answer(503, "Too many pages are open; close one, and load this one anew."), {});
    const Request request = request_of(parser_->get());
    const Answer reply = answer(shared_.guard, shared_.page, request);
    if (reply.status == 101) return upgrade();
    const bool goes_on = request.stays && (reply.status == 200 || reply.status == 404);
    is_authenticated_ |= reply.status < 400 || reply.status == 404;
    send(reply, {request.method != "HEAD", goes_on});
  }

  void upgrade() {
    // The viewer's page sends nothing before the upgrade is answered.
    if (buffer_.size() > 0) return send(plain_answer(400, "The request is followed by more."), {});
    deadline_.clear();
    const auto socket = start_websocket_session(std::move(stream_), shared_, parser_->release());
    shared_.sessions.push_back(socket);
  }

  void send(const Answer& reply, const Form& form) {
    out_ = wire_text(reply, form);
    deadline_.set(shared_.limits.request, weak_from_this());
    asio::async_write(stream_, asio::buffer(out_),
                      step(*this, form.stays ? &HttpSession::on_sent : &HttpSession::on_sent_last));
  }

  void on_sent(error_code error) {
    if (error) return end();
    read();
  }

  void on_sent_last(error_code error) {
    if (error) return end();
    deadline_.set(shared_.limits.linger, weak_from_this());
    lingering_close_.begin(*this, stream_);
  }

  Stream stream_;
  SharedState& shared_;
  Deadline deadline_;
  boost::beast::flat_buffer buffer_;  // its size is the limit: the parser's own limit excludes the first line
  std::optional<Parser> parser_;
  std::string out_;
  LingeringClose<HttpSession> lingering_close_;
  bool full_;
  bool is_authenticated_ = false;
};

}  // namespace

std::shared_ptr<Session> start_http_session(Stream stream, SharedState& shared, bool full) {
  auto session = std::make_shared<HttpSession>(std::move(stream), shared, full);
  session->start();
  return session;
}

}  // namespace traceflow::serve
