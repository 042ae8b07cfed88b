#pragma once

#include "serve/net/parser.h"
#include "serve/net/session.h"

namespace traceflow::serve {

// Upgrades a connection to a WebSocket after its request has passed the guard, and reports it to the handler.
std::shared_ptr<Session> start_websocket_session(Stream stream, SharedState& shared, ParsedRequest request);

}  // namespace traceflow::serve
