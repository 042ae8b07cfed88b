#pragma once

#include <boost/system/error_code.hpp>

namespace traceflow::serve {

// The completion handler of an asynchronous operation: calls a member function of the session with the error
// and keeps the session alive until then. An exception ends only this session.
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
