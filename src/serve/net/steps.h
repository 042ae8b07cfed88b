#pragma once

#include <boost/system/error_code.hpp>

namespace traceflow::serve {

// What to do when a wait of a session is over: its member function, called with the error. Keeps the session
// alive until then; whatever the function throws ends this session and no other.
template <class Session>
auto step(Session& session, void (Session::*next)(boost::system::error_code)) {
  return [self = session.shared_from_this(), next](boost::system::error_code error, auto...) {
    try {
      ((*self).*next)(error);
    } catch (...) {
      self->end();
    }
  };
}

}  // namespace traceflow::serve
