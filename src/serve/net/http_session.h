#pragma once

#include "serve/net/session.h"

namespace traceflow::serve {

// Answers the requests of a connection, one after another, until one upgrades it to a WebSocket. full: the
// connection limit is reached, so the first request is answered with status 503.
std::shared_ptr<Session> start_http_session(Stream stream, SharedState& shared, bool full);

}  // namespace traceflow::serve
