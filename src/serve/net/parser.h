#pragma once

#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>

#include "serve/net/limits.h"
#include "serve/net/request.h"

// Includes much of Boost, so only the files that read requests include this header.
namespace traceflow::serve {

using Parser = boost::beast::http::request_parser<boost::beast::http::empty_body>;
using ParsedRequest = Parser::value_type;

// Makes the parser refuse headers longer than the limit. Bodies are never read, so they have no limit.
void set_limits(Parser& parser, const Limits& limits);

// The parsed request, as views into the parser's result.
Request request_of(const ParsedRequest& parsed);

}  // namespace traceflow::serve
