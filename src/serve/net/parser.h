#pragma once

#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/parser.hpp>

#include "serve/net/limits.h"
#include "serve/net/request.h"

// Includes much of Boost, so only the files that read requests include this header.
namespace traceflow::serve {

using Parser = boost::beast::http::request_parser<boost::beast::http::empty_body>;
using ParsedRequest = Parser::value_type;

// Refuses what is longer than the limit. Bodies are not its business: none is read.
void set_limits(Parser& parser, const Limits& limits);

// What was parsed, as views into it.
Request request_of(const ParsedRequest& parsed);

}  // namespace traceflow::serve
