#pragma once

#include "base/options.h"

// The options of tracking bodies (docs/train.md, Bodies).
namespace traceflow {

// How bodies are tracked through the video before everything trains (deform.kind = nodes).
struct TrackOptions {
  int warm_up = 300;
  int map_each = 4;
  int steps = 8;
  int again = 3;
  int window = 10;
  int rounds = 4;
  int adjust = 4;
  float still = 0.15F;
  float blur = 2;
  float silhouette = 0.5F;
  float normal = 0.3F;
  float colour = 0.3F;
  float tracks = 0.3F;
  bool new_surface = true;
  bool prior_turn = true;
  bool true_poses = false;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("warm_up", warm_up, "iterations",
            "Training on the first frame alone; at most an eighth of the run.");
    v.field("map_each", map_each, "iterations", "Training between one frame and the next, with fixed poses.");
    v.field("steps", steps, "", "Number of Gauss-Newton steps for the poses of a new frame.");
    v.field("again", again, "times",
            "Number of earlier frames whose poses are solved again before each new frame.");
    v.field("window", window, "times",
            "Number of recent frames from which the earlier frames (deform.track.again) are chosen.");
    v.field("rounds", rounds, "",
            "The run is divided into this many equal parts. All poses are solved again at the end of each "
            "part, and at least every 2,000 iterations, with fixed depths; 0: never.");
    v.field("adjust", adjust, "",
            "Photometric bundle adjustment of bodies that may deform and whose texture moves with them: "
            "maximum number of steps for each blur of the photographs; 0: no adjustment.");
    v.field("still", still, "",
            "Bodies are not tracked if the mean error of their silhouettes at rest, over the video, is less "
            "than this share of the masks' area; 0: bodies are always tracked.");
    v.field("blur", blur, "pixels",
            "Blur of the residuals at the first step; each further step has 0.7 of the blur before it.");
    v.field("silhouette", silhouette, "", "Weight of the silhouette residual.");
    v.field("normal", normal, "", "Weight of the normal residual.");
    v.field("colour", colour, "",
            "Weight of the colour residual, for bodies whose colour is found to rotate with them.");
    v.field("tracks", tracks, "",
            "Weight of the capture's point tracks, for bodies with which the tracks are found to rotate.");
    v.field("new_surface", new_surface, "",
            "Add surfels inside masks where no body has any, at each new frame.");
    v.field("prior_turn", prior_turn, "",
            "After tracking, rotate the normal priors in masks by one rotation in camera axes, so that they "
            "agree with the normals of the rendered depth.");
    v.field("true_poses", true_poses, "",
            "Use the poses of the capture's true motion, for tests: an upper bound for tracking.");
  }
  void validate() const;
};

// How bodies deform that one rigid pose does not explain (deform.kind = nodes).
struct BendOptions {
  int nodes = 16;
  int every = 3;
  float misfit = 1.4F;
  float better = 0.65F;
  float strain = 0.01F;
  float haste = 1e-5F;
  float travel = 0.05F;

  template <class Visitor>
  void visit(Visitor& v) {
    v.field("nodes", nodes, "nodes", "Number of nodes of a body that deforms; 0: bodies are rigid.");
    v.field(
        "every", every, "times",
        "Nodes have a rotation and a translation at every n-th frame, with linear interpolation between.");
    v.field("misfit", misfit, "",
            "All bodies deform if the mean error of the silhouettes exceeds this many times the error in the "
            "first view.");
    v.field("better", better, "",
            "A body also deforms if its photometric cost with nodes is less than this share of its cost "
            "without nodes.");
    v.field("strain", strain, "", "Weight of the loss that keeps neighbouring nodes together.");
    v.field("haste", haste, "", "Weight of the loss that keeps nodes slow.");
    v.field("travel", travel, "",
            "Weight of the loss that keeps nodes near their anchors: their rest positions, or the result of "
            "photometric bundle adjustment.");
  }
  void validate() const;
};

}  // namespace traceflow
