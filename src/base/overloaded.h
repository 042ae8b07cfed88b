#pragma once

namespace traceflow {

// For std::visit with one lambda per alternative: std::visit(Overloaded{[](const A& a) {…}, [](const B& b)
// {…}}, variant).
template <class... Visitors>
struct Overloaded : Visitors... {
  using Visitors::operator()...;
};
template <class... Visitors>
Overloaded(Visitors...) -> Overloaded<Visitors...>;

}  // namespace traceflow
