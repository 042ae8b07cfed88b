#include "track/options.h"

namespace traceflow {

void TrackOptions::validate() const {
  check_not_negative(warm_up, "deform.track.warm_up");
  check_option(map_each > 0, "deform.track.map_each", map_each, "a positive number");
  check_option(steps > 0, "deform.track.steps", steps, "a positive number");
  check_not_negative(again, "deform.track.again");
  check_option(window > 0, "deform.track.window", window, "a positive number");
  check_not_negative(rounds, "deform.track.rounds");
  check_not_negative(adjust, "deform.track.adjust");
  check_not_negative(still, "deform.track.still");
  check_not_negative(blur, "deform.track.blur");
  check_not_negative(silhouette, "deform.track.silhouette");
  check_not_negative(normal, "deform.track.normal");
  check_not_negative(colour, "deform.track.colour");
  check_not_negative(tracks, "deform.track.tracks");
}

void BendOptions::validate() const {
  check_not_negative(nodes, "deform.bend.nodes");
  check_option(nodes <= 64, "deform.bend.nodes", nodes, "64 or fewer");
  check_option(every > 0, "deform.bend.every", every, "a positive number");
  check_not_negative(misfit, "deform.bend.misfit");
  check_not_negative(better, "deform.bend.better");
  check_not_negative(strain, "deform.bend.strain");
  check_not_negative(haste, "deform.bend.haste");
  check_not_negative(travel, "deform.bend.travel");
}

}  // namespace traceflow
