// The one place where Asio and Beast are compiled (CMakeLists.txt); the others only declare them.
#include <boost/asio/impl/src.hpp>
#include <boost/beast/src.hpp>
