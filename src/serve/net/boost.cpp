// The only file that compiles Asio and Beast (CMakeLists.txt); the others only declare them.
#include <boost/asio/impl/src.hpp>
#include <boost/beast/src.hpp>
