#include "viz/colour_map.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "base/error.h"

namespace traceflow::viz {

namespace {

using Stop = std::array<float, 3>;

constexpr std::array<Stop, 6> ramp_stops = {{{0.18F, 0.06F, 0.30F},
                                             {0.20F, 0.22F, 0.53F},
                                             {0.12F, 0.44F, 0.56F},
                                             {0.16F, 0.63F, 0.50F},
                                             {0.52F, 0.80F, 0.32F},
                                             {0.98F, 0.93F, 0.42F}}};

// These three tables have every 17th of the 256 published colours.
constexpr std::array<Stop, 16> viridis_stops = {{{0.26700F, 0.00487F, 0.32942F},
                                                 {0.28266F, 0.10020F, 0.42216F},
                                                 {0.27713F, 0.18523F, 0.48990F},
                                                 {0.25393F, 0.26525F, 0.52998F},
                                                 {0.22199F, 0.33916F, 0.54875F},
                                                 {0.19063F, 0.40706F, 0.55609F},
                                                 {0.16363F, 0.47113F, 0.55815F},
                                                 {0.13915F, 0.53381F, 0.55530F},
                                                 {0.12057F, 0.59642F, 0.54361F},
                                                 {0.13469F, 0.65864F, 0.51765F},
                                                 {0.20803F, 0.71870F, 0.47287F},
                                                 {0.32780F, 0.77398F, 0.40664F},
                                                 {0.47750F, 0.82144F, 0.31820F},
                                                 {0.64726F, 0.85840F, 0.20986F},
                                                 {0.82494F, 0.88472F, 0.10622F},
                                                 {0.99325F, 0.90616F, 0.14394F}}};

constexpr std::array<Stop, 16> magma_stops = {{{0.00146F, 0.00047F, 0.01387F},
                                               {0.04383F, 0.03383F, 0.14189F},
                                               {0.12383F, 0.06730F, 0.29588F},
                                               {0.23208F, 0.05989F, 0.43770F},
                                               {0.34148F, 0.08056F, 0.49263F},
                                               {0.44516F, 0.12272F, 0.50690F},
                                               {0.55029F, 0.16116F, 0.50572F},
                                               {0.65848F, 0.19603F, 0.49025F},
                                               {0.76740F, 0.23371F, 0.45776F},
                                               {0.86879F, 0.28773F, 0.40930F},
                                               {0.94401F, 0.37764F, 0.36514F},
                                               {0.98100F, 0.49843F, 0.36973F},
                                               {0.99474F, 0.62435F, 0.42740F},
                                               {0.99723F, 0.74798F, 0.51686F},
                                               {0.99317F, 0.87002F, 0.62619F},
                                               {0.98705F, 0.99144F, 0.74950F}}};

constexpr std::array<Stop, 16> turbo_stops = {{{0.18995F, 0.07176F, 0.23217F},
                                               {0.25369F, 0.26327F, 0.65406F},
                                               {0.27691F, 0.44145F, 0.91328F},
                                               {0.24427F, 0.60937F, 0.99697F},
                                               {0.13278F, 0.77165F, 0.88580F},
                                               {0.10342F, 0.89600F, 0.71500F},
                                               {0.27597F, 0.97092F, 0.51653F},
                                               {0.53255F, 0.99919F, 0.30581F},
                                               {0.72596F, 0.96470F, 0.20640F},
                                               {0.88331F, 0.86553F, 0.21719F},
                                               {0.98000F, 0.73000F, 0.22161F},
                                               {0.99297F, 0.55214F, 0.15417F},
                                               {0.94084F, 0.35566F, 0.07031F},
                                               {0.85380F, 0.22170F, 0.02677F},
                                               {0.70680F, 0.10680F, 0.00571F},
                                               {0.47960F, 0.01583F, 0.01055F}}};

constexpr std::array<Stop, 2> grey_stops = {{{0, 0, 0}, {1, 1, 1}}};

std::span<const Stop> stops_of(ColourMap map) {
  switch (map) {
    case ColourMap::ramp:
      return ramp_stops;
    case ColourMap::viridis:
      return viridis_stops;
    case ColourMap::magma:
      return magma_stops;
    case ColourMap::turbo:
      return turbo_stops;
    case ColourMap::grey:
      return grey_stops;
  }
  return grey_stops;
}

}  // namespace

ColourMap parse_colour_map(const std::string& name) {
  constexpr auto names = enum_names(ColourMap{});
  const auto* const found = std::ranges::find(names, name);
  if (found == names.end()) {
    std::string expected;
    for (const std::string_view known : names)
      expected += (expected.empty() ? "" : ", ") + std::string(known);
    throw InputError("option", "map", name, "one of " + expected);
  }
  return static_cast<ColourMap>(found - names.begin());
}

Vec3<float> map_colour(ColourMap map, float value) {
  if (std::isnan(value)) return Vec3<float>(0);
  const std::span<const Stop> stops = stops_of(map);
  const size_t last = stops.size() - 2;
  const float place = std::clamp(value, 0.0F, 1.0F) * static_cast<float>(last + 1);
  const size_t low = std::min(last, static_cast<size_t>(place));
  return mix(load3<float>(stops[low].data()), load3<float>(stops[low + 1].data()),
             place - static_cast<float>(low));
}

}  // namespace traceflow::viz
