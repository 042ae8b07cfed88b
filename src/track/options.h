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
            "Training on the first time alone; at most an eighth of the run.");
    v.field("map_each", map_each, "iterations", "Training between one time and the next, poses held.");
    v.field("steps", steps, "", "Gauss-Newton steps for the poses of a new time.");
    v.field("again", again, "times", "Recent times whose poses are solved again before each new one.");
    v.field("window", window, "times", "How far back these lie at most.");
    v.field(
        "rounds", rounds, "",
        "All poses are solved again, depths held, at the end of each of so many equal parts of the run, at "
        "least every 2,000 iterations; 0: never.");
    v.field("adjust", adjust, "",
            "Photometric bundle adjustment of bodies that may bend and whose texture is seen to move with "
            "them: steps on photographs of each size; 0: none.");
    v.field(
        "still", still, "",
        "Bodies whose silhouettes at rest are off by less, over the film, stand still and are not followed; "
        "a share of the masks' area; 0: all are followed.");
    v.field("blur", blur, "pixels", "Blur of the first step's residuals; 0.7 of it at each that follows.");
    v.field("silhouette", silhouette, "", "Weight of the silhouette's residual.");
    v.field("normal", normal, "", "Weight of the residual of normals.");
    v.field("colour", colour, "",
            "Weight of the residual of colour, on bodies whose colour is seen to turn with them.");
    v.field("tracks", tracks, "",
            "Weight of the capture's tracked points, on bodies that they are seen to turn with.");
    v.field("new_surface", new_surface, "",
            "Add surfels inside masks where no body has any, at each new time.");
    v.field("prior_turn", prior_turn, "",
            "Turn normal priors in masks, once all times have been followed, by the one rotation in the "
            "camera's axes that makes them agree with the normals of the rendered depth.");
    v.field("true_poses", true_poses, "",
            "Take poses from the capture's true motion, for tests: an upper bound for tracking.");
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
    v.field("nodes", nodes, "nodes", "Nodes of a body that bends; 0: bodies are rigid.");
    v.field("every", every, "times", "Nodes have a turn and a shift at one of so many times.");
    v.field("misfit", misfit, "",
            "Bodies bend where silhouettes are off by so many times as much as at the first time.");
    v.field("better", better, "",
            "So do bodies whose photographs differ by so many times as much with nodes as without.");
    v.field("strain", strain, "", "Weight of the loss that keeps neighbouring nodes together.");
    v.field("haste", haste, "", "Weight of the loss that keeps nodes slow.");
    v.field("travel", travel, "",
            "Weight of the loss that keeps nodes at their anchors: where they were at first, or were "
            "adjusted to.");
  }
  void validate() const;
};

}  // namespace traceflow
