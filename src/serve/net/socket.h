#pragma once

#include "serve/net/parser.h"
#include "serve/net/session.h"

namespace traceflow::serve {

// Makes a connection the WebSocket that its request, let through by the gate, asks for: a guest of the room.
std::shared_ptr<Session> start_socket(Stream stream, Common& common, ParsedRequest request);

}  // namespace traceflow::serve
