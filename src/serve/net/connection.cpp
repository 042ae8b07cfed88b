#include "serve/net/connection.h"

#include <boost/asio/write.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http/read.hpp>

#include "serve/net/answer.h"
#include "serve/net/parser.h"
#include "serve/net/socket.h"
#include "serve/net/steps.h"

namespace traceflow::serve {

namespace {

namespace asio = boost::asio;
namespace http = boost::beast::http;
using boost::system::error_code;

class Connection final : public Session, public std::enable_shared_from_this<Connection> {
 public:
  Connection(Stream stream, Common& common, bool full)
      : stream_(std::move(stream)),
        common_(common),
        deadline_(stream_.get_executor()),
        buffer_(common.limits.header_bytes),
        full_(full) {}

  void start() { read(); }

  void end() override {
    error_code ignored;
    stream_.close(ignored);
    deadline_.clear();
  }
  bool known() const override { return known_; }

 private:
  // One deadline for the whole request, so that trickling bytes gain nothing.
  void read() {
    parser_.emplace();
    set_limits(*parser_, common_.limits);
    deadline_.set(full_ ? common_.limits.linger : common_.limits.request, weak_from_this());
    http::async_read_header(stream_, buffer_, *parser_, step(*this, &Connection::on_request));
  }

  void on_request(error_code error) {
    if (error == http::error::header_limit || error == http::error::buffer_overflow) {
      return send(plain_answer(431, "The request is too long."), {});
    }
    // What is not HTTP is told so; who went away is not.
    if (error && error.category() == http::make_error_code(http::error::bad_method).category() &&
        error != http::error::end_of_stream && error != http::error::partial_message) {
      return send(plain_answer(400, "The request cannot be read."), {});
    }
    if (error) return end();
    if (full_)
      return send(plain_answer(503, "Too many pages are open; close one, and load this one anew."), {});
    const Request request = request_of(parser_->get());
    const Answer reply = answer(common_.gate, common_.page, request);
    if (reply.status == 101) return become_socket();
    const bool goes_on = request.stays && (reply.status == 200 || reply.status == 404);
    known_ |= reply.status < 400 || reply.status == 404;
    send(reply, {request.method != "HEAD", goes_on});
  }

  void become_socket() {
    // A page that speaks before it was answered is none of ours.
    if (buffer_.size() > 0) return send(plain_answer(400, "The request is followed by more."), {});
    deadline_.clear();
    const auto socket = start_socket(std::move(stream_), common_, parser_->release());
    common_.sessions.push_back(socket);
  }

  void send(const Answer& reply, const Form& form) {
    out_ = wire_text(reply, form);
    deadline_.set(common_.limits.request, weak_from_this());
    asio::async_write(stream_, asio::buffer(out_),
                      step(*this, form.stays ? &Connection::on_sent : &Connection::on_sent_last));
  }

  void on_sent(error_code error) {
    if (error) return end();
    read();
  }

  void on_sent_last(error_code error) {
    if (error) return end();
    deadline_.set(common_.limits.linger, weak_from_this());
    farewell_.begin(*this, stream_);
  }

  Stream stream_;
  Common& common_;
  Deadline deadline_;
  boost::beast::flat_buffer buffer_;  // its size is the limit: the parser's own counts the first line apart
  std::optional<Parser> parser_;
  std::string out_;
  Farewell<Connection> farewell_;
  bool full_;
  bool known_ = false;
};

}  // namespace

std::shared_ptr<Session> start_connection(Stream stream, Common& common, bool full) {
  auto connection = std::make_shared<Connection>(std::move(stream), common, full);
  connection->start();
  return connection;
}

}  // namespace traceflow::serve
