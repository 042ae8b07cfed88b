#pragma once

#include "serve/net/session.h"

namespace traceflow::serve {

// Answers the requests of a connection, one after another, until one becomes a WebSocket. full: there are too
// many already: the first request is told so, whatever it is.
std::shared_ptr<Session> start_connection(Stream stream, Common& common, bool full);

}  // namespace traceflow::serve
